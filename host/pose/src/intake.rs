//! The photographs of a folder: read, turned upright as their EXIF orientation says, brought to working size; and those
//! that cannot be used, by name with the reason.

mod checks;
mod crops;
mod working;

use crate::exif::Exif;
use checks::{is_same, sharpness, unread};
pub(crate) use crops::warning as crop_warning;
use image::imageops;
use image::metadata::Orientation;
use image::{DynamicImage, RgbImage};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_job::files::Scratch;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_job::shell::quoted;
use viewfuse_job::text::listed;
use viewfuse_scene::reader::{ImageFile, folders, list};
use viewfuse_scene::write::{Layout, check_name};
use viewfuse_scene::{SceneError, encode_png, read_picture};
use working::{FINE_SIDE, MAX_ENLARGEMENT, WORKING_SIDE, resized, scaled};

/// Most photographs of a folder: every pair of them is matched.
pub const MAX_PHOTOGRAPHS: usize = 100;

/// Longest side in pixels of the coloured copies.
const COPY_SIDE: u32 = 512;

/// Photographs decoded at the same time: each takes some 20 bytes a pixel.
const AT_ONCE: usize = 4;

/// Folders within folders in which photographs are looked for: `flight/DCIM/100MEDIA`.
const MAX_DEPTH: usize = 4;

/// A photograph with less than this share of the others' median sharpness is blurred.
const MIN_SHARPNESS: f64 = 0.1;

/// Files of photographs that are read.
const READ: [&str; 6] = ["jpg", "jpeg", "png", "webp", "tif", "tiff"];

/// A photograph, read.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Its name: the file's in the folder of photographs, without the extension; `card1_001` for `card1/001.jpg`.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// The file's place in the folder of photographs, with `/`.
    pub file: String,
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
    /// Files that were not taken for photographs of this folder, a line for each reason.
    pub passed_over: Vec<Unusable>,
    /// Copies at working size, which go with it.
    scratch: Scratch,
}

/// Why a folder's photographs could not be taken in.
#[derive(Debug, thiserror::Error)]
pub enum IntakeError {
    /// The folder cannot be read, or two photographs have one name.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// There are no photographs.
    #[error("{}: no photographs here (JPEG, PNG, WebP){}", .0.display(), others(.0))]
    None(PathBuf),
    /// A photograph's format that is not read, and a command that converts it.
    #[error("{0}: {1} is not read; convert it to JPEG first, for example `{2}`")]
    Format(PathBuf, &'static str, String),
    /// In a folder, so many are more than are matched; and a step that leaves few enough.
    #[error("{0}: {1} photographs, more than {MAX_PHOTOGRAPHS}: every pair is matched, so take one in {2}")]
    Many(PathBuf, usize, usize),
    /// A photograph whose name the layouts of scenes do not hold, and why.
    #[error("{0}: {1}; rename it")]
    Name(PathBuf, String),
    /// In a folder, two files of one name, and which.
    #[error("{0}: two photographs have the name {1}: {2}; rename one")]
    Names(PathBuf, String, String),
    /// The operating system reported an error for a file or folder.
    #[error("{0}: {1}")]
    Io(PathBuf, std::io::Error),
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
        let Listed { root, files, passed_over } = files(folder, every)?;
        let scratch = Scratch::new().map_err(|cause| IntakeError::Io(folder.to_path_buf(), cause))?;
        progress.expect(files.len());
        let mut read = Vec::with_capacity(files.len());
        for some in files.chunks(AT_ONCE) {
            let one = |path: &PathBuf| {
                progress.check()?;
                let photo = photo(path, &root, scratch.path());
                progress.step();
                Ok(photo)
            };
            read.extend(some.par_iter().map(one).collect::<Result<Vec<_>, Interrupted>>()?);
        }
        let (mut photos, mut unusable) = (Vec::new(), Vec::new());
        for (path, photo) in files.iter().zip(read) {
            match photo {
                Ok(photo) => match photos.iter_mut().find(|other| is_same(&photo, other)) {
                    // Of copies the largest is the photograph, and of equally large ones that of the most bytes.
                    Some(other) => {
                        let bytes = |photo: &Photo| fs::metadata(&photo.path).map_or(0, |about| about.len());
                        let worth = |photo: &Photo| (photo.size[0] * photo.size[1], bytes(photo));
                        let is_better = worth(&photo) > worth(other);
                        let copy = if is_better { std::mem::replace(other, photo) } else { photo };
                        let reason = format!("the same picture as {}", other.file);
                        unusable.push(Unusable { name: copy.file, reason });
                    }
                    None => photos.push(photo),
                },
                Err(Refused::Photograph(reason)) => unusable.push(Unusable { name: place_in(&root, path), reason }),
                Err(Refused::Work(error)) => return Err(error),
            }
        }
        unusable.extend(blurred(&mut photos));
        let files = lengths(&root, &files)?;
        Ok(Intake { folder: folder.to_path_buf(), files, photos, unusable, passed_over, scratch })
    }

    /// The photographs at a finer working size, decoded again; `None` if none of them is larger then.
    pub(crate) fn finer(&self, progress: &dyn Progress) -> Result<Option<Vec<Photo>>, IntakeError> {
        let size = |photo: &Photo| scaled(photo.size, FINE_SIDE, MAX_ENLARGEMENT);
        if self.photos.iter().all(|photo| size(photo) == photo.working_size) {
            return Ok(None);
        }
        let folder = self.scratch.path().join("finer");
        fs::create_dir_all(&folder).map_err(|cause| IntakeError::Io(folder.clone(), cause))?;
        let one = |photo: &Photo| {
            progress.check()?;
            let grey = resized(&read_picture(&photo.path)?.to_luma8(), size(photo));
            let working = folder.join(format!("{}.png", photo.name));
            put(&working, &DynamicImage::ImageLuma8(grey))?;
            Ok(Photo { working, working_size: size(photo), ..photo.clone() })
        };
        self.photos.iter().map(one).collect::<Result<_, IntakeError>>().map(Some)
    }
}

/// Names and lengths of the photographs of a folder, of every one, as [`Intake::files`].
pub(crate) fn files_in(folder: &Path) -> Result<Vec<(String, u64)>, IntakeError> {
    let Listed { root, files, .. } = files(folder, 1)?;
    lengths(&root, &files)
}

fn lengths(root: &Path, files: &[PathBuf]) -> Result<Vec<(String, u64)>, IntakeError> {
    let length = |path: &PathBuf| match fs::metadata(path) {
        Ok(about) => Ok((place_in(root, path), about.len())),
        Err(cause) => Err(IntakeError::Io(path.clone(), cause)),
    };
    files.iter().map(length).collect()
}

/// How many times less detail is blur; beyond, there is none.
const MAX_BLUR: f64 = 1.0e5;

/// Takes the blurred ones out.
fn blurred(photos: &mut Vec<Photo>) -> Vec<Unusable> {
    let mut all: Vec<f64> = photos.iter().map(|photo| photo.sharpness).collect();
    all.sort_by(f64::total_cmp);
    let Some(&median) = all.get(all.len() / 2).filter(|_| all.len() > 2) else { return Vec::new() };
    let is_sharp = |photo: &Photo| photo.sharpness >= MIN_SHARPNESS * median;
    let refused = |photo: &Photo| Unusable {
        name: photo.file.clone(),
        reason: match median / photo.sharpness.max(1.0e-9) {
            times if times < MAX_BLUR => format!("blurred: {times:.0} times less detail than the others"),
            _ => "nothing is to be seen in it: it has no detail".to_owned(),
        },
    };
    let found = photos.iter().filter(|photo| !is_sharp(photo)).map(refused).collect();
    photos.retain(is_sharp);
    found
}

/// Pictures of other formats in a folder, for an error.
fn others(folder: &Path) -> String {
    const OTHERS: [&str; 6] = ["bmp", "gif", "tga", "ppm", "jp2", "psd"];
    let is_other = |path: &Path| OTHERS.contains(&extension(path).as_str());
    match list(folder, is_other).unwrap_or_default().first() {
        Some(first) => format!("; convert {} and the like to JPEG", file_name(first)),
        None => String::new(),
    }
}

/// `my 4.HEIC.jpg` for `my 4.HEIC`.
fn appended(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".jpg");
    name.into()
}

/// Whether a JPEG or PNG of a photograph's name lies beside it.
fn is_converted(path: &Path, all: &HashSet<PathBuf>) -> bool {
    let replaced = ["jpg", "jpeg", "png", "JPG", "JPEG", "PNG"].map(|extension| path.with_extension(extension));
    all.contains(&appended(path)) || replaced.iter().any(|other| all.contains(other))
}

/// The photographs of a folder, and what else is there.
struct Listed {
    /// The folder that their places are in.
    root: PathBuf,
    /// In natural order.
    files: Vec<PathBuf>,
    passed_over: Vec<Unusable>,
}

/// The photographs of a folder, or of `images` in it: those that lie in it, and where none does, those in its folders
/// (cards, flights, cameras) and in theirs.
fn files(folder: &Path, every: usize) -> Result<Listed, IntakeError> {
    let inner = folder.join("images");
    let inner = inner.as_path();
    let (mut root, mut all) = (folder, Vec::new());
    for (place, is_deep) in [(folder, false), (inner, false), (inner, true), (folder, true)] {
        if all.is_empty() && (place == folder || place.is_dir()) {
            (root, all) = (place, if is_deep { below(place, MAX_DEPTH)? } else { list(place, is_photograph)? });
        }
    }
    if all.is_empty() {
        return Err(IntakeError::None(folder.to_path_buf()));
    }
    let root = root.to_path_buf();
    // What was converted, as it is advised, lies beside it.
    let converted: HashSet<PathBuf> = all.iter().cloned().collect();
    all.retain(|path| unread(&extension(path)).is_none() || !is_converted(path, &converted));
    for path in &all {
        if let Some((format, way)) = unread(&extension(path)) {
            let word = |word: &str| match word {
                "FILE" => quoted(path),
                "FILE.jpg" => quoted(appended(path)),
                word => word.to_owned(),
            };
            let way = way.split(' ').map(word).collect::<Vec<_>>().join(" ");
            return Err(IntakeError::Format(path.clone(), format, way));
        }
    }
    let is_flat = all.iter().any(|path| path.parent() == Some(&root));
    let deeper = if is_flat { below(&root, MAX_DEPTH)? } else { Vec::new() };
    let passed_over = passed_over(&root, &deeper)?;
    let files: Vec<PathBuf> = all.into_iter().step_by(every.max(1)).collect();
    if files.len() > MAX_PHOTOGRAPHS {
        let (count, step) = (files.len(), every.max(1) * files.len().div_ceil(MAX_PHOTOGRAPHS));
        return Err(IntakeError::Many(folder.to_path_buf(), count, step));
    }
    let mut names: HashMap<String, &Path> = HashMap::new();
    for path in &files {
        let name = name_in(&root, path);
        // Those of every layout that a scene is written in.
        for layout in [Layout::ColmapBinary, Layout::Transforms] {
            check_name(layout, &name).map_err(|reason| IntakeError::Name(path.clone(), reason))?;
        }
        if name.contains(['\n', '\r']) {
            return Err(IntakeError::Name(path.clone(), format!("the name {name:?} has a line break in it")));
        }
        if let Some(other) = names.insert(name.clone(), path) {
            let [one, other] = [path, other].map(|path| path.strip_prefix(&root).unwrap_or(path).display());
            return Err(IntakeError::Names(folder.to_path_buf(), name, format!("{other} and {one}")));
        }
    }
    Ok(Listed { root, files, passed_over })
}

/// The photographs in the folders of a folder, and in theirs down to a depth.
fn below(folder: &Path, depth: usize) -> Result<Vec<PathBuf>, SceneError> {
    let mut all = Vec::new();
    for inner in folders(folder)?.iter().filter(|inner| !is_of_masks(inner)) {
        all.extend(list(inner, is_photograph)?);
        if depth > 0 {
            all.extend(below(inner, depth - 1)?);
        }
    }
    Ok(all)
}

/// Whether a folder is, by its name, one of masks.
fn is_of_masks(folder: &Path) -> bool {
    ["mask", "masks"].iter().any(|name| folder.file_name().is_some_and(|found| found.eq_ignore_ascii_case(name)))
}

/// What lies beside the photographs and is not taken, by its name: a line a reason.
fn passed_over(root: &Path, deeper: &[PathBuf]) -> Result<Vec<Unusable>, IntakeError> {
    let other = list(root, |path| !is_photograph(path))?;
    let failed = |cause| IntakeError::Io(root.to_path_buf(), cause);
    let entries = fs::read_dir(root).and_then(Iterator::collect::<Result<Vec<_>, _>>).map_err(failed)?;
    let mut hidden: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    hidden.retain(|path| file_name(path).starts_with('.') && is_photograph(path) && path.is_file());
    hidden.sort();
    let line = |files: &[PathBuf], reason: &str| {
        let names: Vec<String> = files.iter().map(|file| place_in(root, file)).collect();
        (!names.is_empty()).then(|| Unusable { name: listed(&names, 1), reason: reason.to_owned() })
    };
    let lines = [
        line(&hidden, "hidden, by a name that begins with a dot"),
        line(&other, "no photograph by its name"),
        line(deeper, "in a folder beside photographs: pose it by itself, or put all into folders"),
    ];
    Ok(lines.into_iter().flatten().collect())
}

/// The name of a photograph: its place in the folder without the extension, its folders before it as in `card1_001`.
fn name_in(root: &Path, path: &Path) -> String {
    let folders = path.strip_prefix(root).ok().and_then(Path::parent).into_iter().flat_map(Path::components);
    let folders: String = folders.map(|part| part.as_os_str().to_string_lossy().into_owned() + "_").collect();
    folders + &path.file_stem().unwrap_or_default().to_string_lossy()
}

/// Where a file lies in a folder, with `/`.
fn place_in(root: &Path, path: &Path) -> String {
    let inside = path.strip_prefix(root).unwrap_or(path).components();
    inside.map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
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
fn photo(path: &Path, root: &Path, scratch: &Path) -> Result<Photo, Refused> {
    let unreadable = |error: SceneError| match error.hint() {
        Some(Hint::BuildWithTiff) => {
            Refused::Photograph("TIFF is not read by this build; convert it to JPEG".to_owned())
        }
        _ => Refused::Photograph(error.fault.to_string()),
    };
    let header = ImageFile::open(path).map_err(unreadable)?;
    let exif = Exif::read(path, header.size());
    let picture = read_picture(path).map_err(unreadable)?;
    let (name, file) = (name_in(root, path), place_in(root, path));
    let mut upright = path.to_path_buf();
    if header.orientation() != Orientation::NoTransforms {
        upright = scratch.join(format!("{name}.png"));
        put(&upright, &picture).map_err(Refused::Work)?;
    }
    let size = [picture.width(), picture.height()];
    let grey = picture.to_luma8();
    let working_size = scaled(size, WORKING_SIDE, MAX_ENLARGEMENT);
    let resized = resized(&grey, working_size);
    // Enlarging adds no detail: how sharp a photograph is, its own pixels tell.
    let sharpness = sharpness(if working_size > size { &grey } else { &resized });
    let [width, height] = scaled(size, COPY_SIDE, 1.0);
    let copy = imageops::thumbnail(&picture.into_rgb8(), width, height);
    let folder = scratch.join("grey");
    fs::create_dir_all(&folder).map_err(|cause| Refused::Work(IntakeError::Io(folder.clone(), cause)))?;
    let working = folder.join(format!("{name}.png"));
    put(&working, &DynamicImage::ImageLuma8(resized)).map_err(Refused::Work)?;
    Ok(Photo { name, path: path.to_path_buf(), file, upright, size, exif, working, working_size, copy, sharpness })
}

fn put(path: &Path, picture: &DynamicImage) -> Result<(), IntakeError> {
    let written = encode_png(picture).map_err(std::io::Error::other).and_then(|bytes| fs::write(path, bytes));
    written.map_err(|cause| IntakeError::Io(path.to_path_buf(), cause))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_job::progress::Silent;

    /// A picture of its own for each name.
    fn put_all(folder: &Path, names: &[&str]) {
        for (index, name) in names.iter().enumerate() {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("folders");
            let level = |x: u32, y: u32| image::Rgb([((x * 7 + y * 13 + 40 * index as u32) % 256) as u8; 3]);
            put(&path, &DynamicImage::ImageRgb8(RgbImage::from_fn(24, 16, level))).expect("a picture");
        }
    }

    fn names(folder: &Path) -> Vec<(String, String)> {
        let intake = Intake::read(folder, 1, &Silent).expect("photographs");
        assert_eq!(intake.files.iter().map(|(file, _)| file).collect::<Vec<_>>().len(), intake.photos.len());
        intake.photos.into_iter().map(|photo| (photo.name, photo.file)).collect()
    }

    fn expected(all: &[(&str, &str)]) -> Vec<(String, String)> {
        all.iter().map(|(name, file)| ((*name).to_owned(), (*file).to_owned())).collect()
    }

    #[test]
    fn photographs_in_folders_have_names_of_their_places() {
        let scratch = tempfile::tempdir().expect("a folder");
        let cards = ["card1/001.png", "card1/002.png", "card2/DCIM/001.png", "masks/001.png", ".trash/001.png"];
        put_all(scratch.path(), &cards);
        let taken = [("card1_001", cards[0]), ("card1_002", cards[1]), ("card2_DCIM_001", cards[2])];
        assert_eq!(names(scratch.path()), expected(&taken));
        // A folder `images` is taken alone, with the folders in it.
        put_all(scratch.path(), &["images/left/1.png", "images/right/1.png"]);
        assert_eq!(names(scratch.path()), expected(&[("left_1", "left/1.png"), ("right_1", "right/1.png")]));
        // Two places of one name.
        put_all(scratch.path(), &["images/a_b/c.png", "images/a/b_c.png"]);
        let error = Intake::read(scratch.path(), 1, &Silent).expect_err("two of a name").to_string();
        assert!(error.ends_with("two photographs have the name a_b_c: a/b_c.png and a_b/c.png; rename one"), "{error}");
    }

    #[test]
    fn what_is_passed_over_by_its_name_is_said() {
        let scratch = tempfile::tempdir().expect("a folder");
        put_all(scratch.path(), &["1.png", "2.png", "._1.png", "._2.png", "edited/1.png"]);
        fs::write(scratch.path().join("clip.mp4"), "a video").expect("a file");
        assert_eq!(names(scratch.path()), expected(&[("1", "1.png"), ("2", "2.png")]));
        let passed = Intake::read(scratch.path(), 1, &Silent).expect("photographs").passed_over;
        let told: Vec<String> = passed.into_iter().map(|file| format!("{}: {}", file.name, file.reason)).collect();
        let parts = ["._1.png and 1 more: hidden", "clip.mp4: no photograph by its name", "edited/1.png: in a folder"];
        assert_eq!(told.len(), 3, "{told:?}");
        assert!(told.iter().zip(parts).all(|(line, part)| line.starts_with(part)), "{told:?}");
    }

    #[test]
    fn small_photographs_are_enlarged_to_working_size() {
        let scratch = tempfile::tempdir().expect("a folder");
        for (name, size) in [("1.png", (24, 16)), ("2.png", (600, 450)), ("3.png", (1500, 2400)), ("4.png", (1200, 7))]
        {
            let level = |x: u32, y: u32| image::Rgb([((x * 7 + y * 13 + size.0) % 256) as u8; 3]);
            let picture = DynamicImage::ImageRgb8(RgbImage::from_fn(size.0, size.1, level));
            put(&scratch.path().join(name), &picture).expect("a picture");
        }
        let mut photos = Intake::read(scratch.path(), 1, &Silent).expect("photographs").photos;
        let sizes: Vec<_> = photos.iter().map(|photo| photo.working_size).collect();
        assert_eq!(sizes, [[96, 64], [1200, 900], [750, 1200], [1200, 7]], "four times as large at most");
        assert_eq!(photos[1].size, [600, 450], "cameras are those of the photograph");
        // Enlarged photographs are not taken for blurred ones.
        assert!(blurred(&mut photos).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn names_that_no_scene_holds_are_refused_before_the_work() {
        for name in ["line\nbreak.png", "back\\slash.png"] {
            let scratch = tempfile::tempdir().expect("a folder");
            put_all(scratch.path(), &["1.png", name]);
            let error = Intake::read(scratch.path(), 1, &Silent).expect_err("no name");
            assert!(matches!(error, IntakeError::Name { .. }) && error.to_string().contains("rename it"), "{error}");
        }
    }
}
