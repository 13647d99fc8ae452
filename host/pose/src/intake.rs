//! The photographs of a folder: read, turned upright as their EXIF orientation says, reduced to working size; and those
//! that cannot be used, by name with the reason.

mod checks;

use crate::exif::Exif;
use checks::{cut_short, is_same, sharpness, unread};
use image::imageops::{self, FilterType};
use image::metadata::Orientation;
use image::{DynamicImage, RgbImage};
use rayon::prelude::*;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_scene::reader::{ImageFile, list};
use viewfuse_scene::{SceneError, encode_png, read_picture};

/// Most photographs of a folder: every pair of them is matched.
pub const MAX_PHOTOGRAPHS: usize = 100;

/// Longest side in pixels at which solvers look for features.
pub(crate) const WORKING_SIDE: u32 = 1200;

/// Longest side in pixels of the coloured copies.
const COPY_SIDE: u32 = 512;

/// Photographs decoded at the same time: each takes some 20 bytes a pixel.
const AT_ONCE: usize = 4;

/// A photograph with less than this share of the others' median sharpness is blurred.
const MIN_SHARPNESS: f64 = 0.1;

/// Files of photographs that are read.
const READ: [&str; 6] = ["jpg", "jpeg", "png", "webp", "tif", "tiff"];

/// A photograph, read.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Its name: the file's, without the extension.
    pub name: String,
    /// The file in the folder.
    pub path: PathBuf,
    /// The file whose pixels are upright as they are stored: `path`, or a copy.
    pub(crate) upright: PathBuf,
    /// Width and height upright, in pixels.
    pub size: [u32; 2],
    /// What it states of its camera.
    pub exif: Exif,
    /// Grey, upright, at working size.
    pub(crate) working: PathBuf,
    /// Width and height at working size.
    pub(crate) working_size: [u32; 2],
    /// In colour, small.
    pub(crate) copy: RgbImage,
    sharpness: f64,
}

/// A photograph that is not used, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unusable {
    /// Its file's name.
    pub name: String,
    /// The reason.
    pub reason: String,
}

/// The photographs of a folder.
#[derive(Debug)]
pub struct Intake {
    /// The folder.
    pub folder: PathBuf,
    /// All that were taken, usable or not: names and lengths in bytes.
    pub files: Vec<(String, u64)>,
    /// Those that can be used, in natural order of their names.
    pub photos: Vec<Photo>,
    /// Those that cannot.
    pub unusable: Vec<Unusable>,
    /// Copies at working size, which go with it.
    _scratch: TempDir,
}

/// Why a folder's photographs could not be taken in.
#[derive(Debug, thiserror::Error)]
pub enum IntakeError {
    /// The folder cannot be read, or two photographs have one name.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// There are no photographs.
    #[error("{}: no photographs here (JPEG, PNG, WebP)", folder.display())]
    None {
        /// The folder.
        folder: PathBuf,
    },
    /// A format that is not read.
    #[error("{}: {format} is not read; convert it to JPEG first, for example `{way}`", path.display())]
    Format {
        /// The photograph.
        path: PathBuf,
        /// The format's name.
        format: &'static str,
        /// A command that converts it.
        way: String,
    },
    /// More than are matched.
    #[error("{}: {count} photographs, more than {MAX_PHOTOGRAPHS}: every pair is matched, so take one in {step}", folder.display())]
    Many {
        /// The folder.
        folder: PathBuf,
        /// How many.
        count: usize,
        /// A step that leaves few enough.
        step: usize,
    },
    /// Two files of one name.
    #[error("{}: two photographs have the name {name}; rename one", folder.display())]
    Names {
        /// The folder.
        folder: PathBuf,
        /// The name.
        name: String,
    },
    /// The operating system reported an error.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The person stopped the work.
    #[error("interrupted")]
    Interrupted(#[from] Interrupted),
}

impl Hinted for IntakeError {
    fn hint(&self) -> Option<Hint> {
        match self {
            IntakeError::Many { .. } => Some(Hint::FewerPhotographs),
            _ => None,
        }
    }
}

/// Whether a file is, by its name, a photograph that is read or of a format that cameras write.
pub fn is_photograph(path: &Path) -> bool {
    let extension = extension(path);
    READ.contains(&extension.as_str()) || unread(&extension).is_some()
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

impl Intake {
    /// Reads every `every`th photograph of a folder, or of `images` in it.
    ///
    /// # Errors
    /// [`IntakeError`].
    pub fn read(folder: &Path, every: usize, progress: &dyn Progress) -> Result<Intake, IntakeError> {
        let files = files(folder, every)?;
        let scratch = tempfile::tempdir().map_err(|cause| IntakeError::Io { path: folder.to_path_buf(), cause })?;
        progress.expect(files.len());
        let mut read = Vec::with_capacity(files.len());
        for some in files.chunks(AT_ONCE) {
            let one = |path: &PathBuf| {
                progress.check()?;
                let photo = photo(path, scratch.path());
                progress.step();
                Ok(photo)
            };
            read.extend(some.par_iter().map(one).collect::<Result<Vec<_>, Interrupted>>()?);
        }
        let (mut photos, mut unusable) = (Vec::new(), Vec::new());
        for (path, photo) in files.iter().zip(read) {
            let mut refuse = |reason| unusable.push(Unusable { name: file_name(path), reason });
            match photo {
                Ok(photo) => match photos.iter().find(|other| is_same(&photo, other)) {
                    Some(Photo { path, .. }) => refuse(format!("the same picture as {}", file_name(path))),
                    None => photos.push(photo),
                },
                Err(Refused::Photograph(reason)) => refuse(reason),
                Err(Refused::Work(error)) => return Err(error),
            }
        }
        unusable.extend(blurred(&mut photos));
        let files = lengths(&files)?;
        Ok(Intake { folder: folder.to_path_buf(), files, photos, unusable, _scratch: scratch })
    }
}

/// Names and lengths of the photographs of a folder, of every one, as [`Intake::files`].
pub(crate) fn listed(folder: &Path) -> Result<Vec<(String, u64)>, IntakeError> {
    lengths(&files(folder, 1)?)
}

fn lengths(files: &[PathBuf]) -> Result<Vec<(String, u64)>, IntakeError> {
    let of = |path: &PathBuf| match fs::metadata(path) {
        Ok(about) => Ok((file_name(path), about.len())),
        Err(cause) => Err(IntakeError::Io { path: path.clone(), cause }),
    };
    files.iter().map(of).collect()
}

/// Takes the blurred ones out.
fn blurred(photos: &mut Vec<Photo>) -> Vec<Unusable> {
    let mut all: Vec<f64> = photos.iter().map(|photo| photo.sharpness).collect();
    all.sort_by(f64::total_cmp);
    let Some(&median) = all.get(all.len() / 2).filter(|_| all.len() > 2) else { return Vec::new() };
    let is_sharp = |photo: &Photo| photo.sharpness >= MIN_SHARPNESS * median;
    let of = |photo: &Photo| Unusable {
        name: file_name(&photo.path),
        reason: format!("blurred: {:.0} times less detail than the others", median / photo.sharpness.max(1.0e-9)),
    };
    let found = photos.iter().filter(|photo| !is_sharp(photo)).map(of).collect();
    photos.retain(is_sharp);
    found
}

/// The photographs of a folder in natural order.
fn files(folder: &Path, every: usize) -> Result<Vec<PathBuf>, IntakeError> {
    let of = |folder: &Path| -> Result<Vec<PathBuf>, SceneError> { list(folder, is_photograph) };
    let mut all = of(folder)?;
    let inner = folder.join("images");
    if all.is_empty() && inner.is_dir() {
        all = of(&inner)?;
    }
    if all.is_empty() {
        return Err(IntakeError::None { folder: folder.to_path_buf() });
    }
    for path in &all {
        if let Some((format, way)) = unread(&extension(path)) {
            let way = way.replace("FILE", &file_name(path));
            return Err(IntakeError::Format { path: path.clone(), format, way });
        }
    }
    let all: Vec<PathBuf> = all.into_iter().step_by(every.max(1)).collect();
    if all.len() > MAX_PHOTOGRAPHS {
        let (count, step) = (all.len(), every.max(1) * all.len().div_ceil(MAX_PHOTOGRAPHS));
        return Err(IntakeError::Many { folder: folder.to_path_buf(), count, step });
    }
    let mut names = HashSet::new();
    match all.iter().map(|path| stem(path)).find(|name| !names.insert(name.clone())) {
        Some(name) => Err(IntakeError::Names { folder: folder.to_path_buf(), name }),
        None => Ok(all),
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Why a photograph is not there.
enum Refused {
    Photograph(String),
    Work(IntakeError),
}

/// Reads one, and writes its copies.
fn photo(path: &Path, scratch: &Path) -> Result<Photo, Refused> {
    let unreadable = |error: SceneError| Refused::Photograph(in_words(path, &error));
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |cause| Refused::Work(IntakeError::Io { path, cause })
    };
    let header = ImageFile::open(path).map_err(unreadable)?;
    if cut_short(path).map_err(failed(path))? {
        return Err(Refused::Photograph("the file ends before the picture does".to_owned()));
    }
    let exif = Exif::read(path, header.size());
    let picture = read_picture(path).map_err(unreadable)?;
    let name = stem(path);
    let mut upright = path.to_path_buf();
    if header.orientation() != Orientation::NoTransforms {
        upright = scratch.join(format!("{name}.png"));
        put(&upright, &picture).map_err(failed(&upright))?;
    }
    let size = [picture.width(), picture.height()];
    let working_size = reduced(size, WORKING_SIDE);
    let grey = picture.to_luma8();
    let grey = match working_size == size {
        true => grey,
        false => imageops::resize(&grey, working_size[0], working_size[1], FilterType::Triangle),
    };
    let [width, height] = reduced(size, COPY_SIDE);
    let copy = imageops::thumbnail(&picture.into_rgb8(), width, height);
    let sharpness = sharpness(&grey);
    let folder = scratch.join("grey");
    fs::create_dir_all(&folder).map_err(failed(&folder))?;
    let working = folder.join(format!("{name}.png"));
    put(&working, &DynamicImage::ImageLuma8(grey)).map_err(failed(&working))?;
    Ok(Photo { name, path: path.to_path_buf(), upright, size, exif, working, working_size, copy, sharpness })
}

fn put(path: &Path, picture: &DynamicImage) -> std::io::Result<()> {
    fs::write(path, encode_png(picture).map_err(std::io::Error::other)?)
}

/// The error without the path, which stands before it.
fn in_words(path: &Path, error: &SceneError) -> String {
    let (text, path) = (error.to_string(), path.display().to_string());
    text.strip_prefix(&path).map_or(text.as_str(), |rest| rest.trim_start_matches([':', ' '])).to_owned()
}

/// The size with a longest side of at most `side`.
fn reduced([width, height]: [u32; 2], side: u32) -> [u32; 2] {
    let scale = (f64::from(side) / f64::from(width.max(height))).min(1.0);
    [width, height].map(|own| ((f64::from(own) * scale).round() as u32).max(1))
}
