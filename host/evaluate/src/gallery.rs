//! Pictures of an evaluation for its report: of a job's first target the sources, every scheme's prediction, the truth.

use crate::baseline::Baseline;
use crate::run_folder::Finished;
use crate::{PSNR, Score};
use image::{DynamicImage, RgbImage, imageops};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_field::held_out::nearest;
use viewfuse_field::render::Frame;
use viewfuse_job::files::{WriteError, read_at_most, write_whole};
use viewfuse_output::png::write_png;
use viewfuse_scene::photographs::SourceImages;

/// Name of the folder of pictures in that of the evaluation.
pub const PICTURES: &str = "pictures";

/// Longest side of a source as it is shown.
const THUMBNAIL: u32 = 96;

/// Why pictures cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GalleryError {
    /// One cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A file cannot be read.
    #[error("{}: cannot be read: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A file names something that is no picture in its folder.
    #[error("{}: names {file:?}, which is no picture in the folder of pictures; nothing of it is \
        shown", path.display())]
    Outside {
        /// The file.
        path: PathBuf,
        /// The name.
        file: String,
    },
    /// A file is not a PNG.
    #[error("{}: is not a PNG", path.display())]
    NoPicture {
        /// The file.
        path: PathBuf,
    },
    /// A file does not describe pictures.
    #[error("{}: does not describe pictures of an evaluation: {cause}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: serde_json::Error,
    },
}

/// Most bytes of the description of a target's pictures.
const LONGEST_DESCRIPTION: u64 = 16 << 20;
/// Most bytes of a picture.
const LONGEST_PICTURE: u64 = 256 << 20;
/// What a PNG begins with.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The pictures of a target. File names are relative to the folder of pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetPictures {
    /// The job's number.
    pub job: usize,
    /// The scene's name.
    pub scene: String,
    /// The target's name.
    pub target: String,
    /// The photograph at the target.
    pub truth: String,
    /// A copy of the nearest source; null in folders of versions that kept none.
    #[serde(default)]
    pub copy: Option<CopyPicture>,
    /// The sources in their order.
    pub sources: Vec<SourcePicture>,
    /// The schemes in theirs.
    pub schemes: Vec<SchemePicture>,
}

impl TargetPictures {
    /// The names of all its pictures.
    fn files(&self) -> impl Iterator<Item = &str> {
        let sources = self.sources.iter().map(|source| source.file.as_str());
        let schemes = self.schemes.iter().map(|scheme| scheme.file.as_str());
        [self.truth.as_str()].into_iter().chain(sources).chain(schemes)
    }
}

/// Whether a name is that of a picture in the folder itself.
fn is_picture_name(name: &str) -> bool {
    let path = Path::new(name);
    path.file_name() == Some(path.as_os_str())
        && !name.contains(['/', '\\', ':'])
        && path.extension().is_some_and(|extension| extension == "png")
}

/// The bytes of a picture of an evaluation: a file in its folder of pictures, no link that leads out of it, and a PNG.
///
/// # Errors
/// [`GalleryError`].
pub fn picture(folder: &Path, name: &str) -> Result<Vec<u8>, GalleryError> {
    let path = picture_path(folder, name)?;
    match read_at_most(&path, LONGEST_PICTURE) {
        Ok(bytes) if bytes.starts_with(PNG) => Ok(bytes),
        Ok(_) => Err(GalleryError::NoPicture { path }),
        Err(cause) => Err(GalleryError::Read { path, cause }),
    }
}

/// The path of a picture that a run's record names, which must lie in the run's own folder of pictures.
///
/// # Errors
/// [`GalleryError`].
pub fn picture_path(folder: &Path, name: &str) -> Result<PathBuf, GalleryError> {
    let folder = folder.join(PICTURES);
    let path = folder.join(name);
    let canonical = fs::canonicalize(&path).map_err(|cause| GalleryError::Read { path: path.clone(), cause })?;
    let is_inside = canonical.parent() == fs::canonicalize(&folder).ok().as_deref();
    match is_picture_name(name) && is_inside {
        true => Ok(path),
        false => Err(GalleryError::Outside { path: folder, file: name.to_owned() }),
    }
}

/// A source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourcePicture {
    /// The view's name.
    pub name: String,
    /// Its photograph.
    pub file: String,
}

/// The copy of the nearest source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CopyPicture {
    /// The source's name.
    pub source: String,
    /// Its photograph at the target's size.
    pub file: String,
    /// Its peak signal to noise ratio, decibels; null if it is not finite.
    pub psnr: Option<f64>,
}

/// A scheme's picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SchemePicture {
    /// The scheme.
    pub scheme: String,
    /// The rendered picture.
    pub file: String,
    /// Weight of each source as used, in the order of the sources.
    pub weights: Vec<f32>,
    /// Scores by name of the metric; null for a score that is not finite.
    pub values: Vec<(String, Option<f64>)>,
}

/// Collects the pictures of a job's first target.
#[derive(Debug, Default)]
pub struct Gallery {
    sources: Vec<RgbImage>,
    truth: Option<RgbImage>,
    /// The nearest source by its index, and its copy.
    copy: Option<(usize, RgbImage)>,
    schemes: Vec<(RgbImage, SchemePicture)>,
}

impl Gallery {
    /// Stores the parts of a frame that the report needs. `scheme` is its row's name.
    pub fn add(&mut self, scheme: &str, frame: &Frame, values: &[(String, f64)], sources: &SourceImages) {
        let Some(truth) = &frame.truth else { return };
        if self.sources.is_empty() {
            self.sources = (0..sources.images.len()).map(|source| thumbnail(sources.picture(source))).collect();
            self.truth = Some(truth.picture.clone());
            let distance = |source: usize| sources.images[source].camera.pose.distance(&frame.target.camera.pose);
            self.copy = nearest(0..sources.images.len(), distance, 1).pop().map(|source| {
                let (width, height) = truth.picture.dimensions();
                let picture = sources.picture(source);
                (source, imageops::resize(&picture, width, height, imageops::FilterType::Triangle))
            });
        }
        let finite = |(name, value): &(String, f64)| (name.clone(), Some(*value).filter(|value| value.is_finite()));
        let shown = SchemePicture {
            scheme: scheme.to_owned(),
            file: String::new(),
            weights: frame.omission.weights.values()[..sources.images.len()].to_vec(),
            values: values.iter().map(finite).collect(),
        };
        self.schemes.push((frame.picture.clone(), shown));
    }

    /// Writes the pictures of a job at a target, and then their description.
    ///
    /// # Errors
    /// [`GalleryError::Write`].
    pub fn write(self, folder: &Path, done: &Finished, target: &str) -> Result<(), GalleryError> {
        let &Finished { job, ref scene_name, sources: ref names, ref scores, .. } = done;
        let Some(truth) = self.truth else { return Ok(()) };
        let folder = folder.join(PICTURES);
        let write = |name: String, picture: RgbImage| -> Result<String, GalleryError> {
            write_png(&folder.join(&name), &DynamicImage::ImageRgb8(picture))?;
            Ok(name)
        };
        let copy = match self.copy {
            Some((source, picture)) => {
                // That of its row: of what counts.
                let is_copy = |score: &&Score| score.target == target && score.scheme == Baseline::NearestCopy.name();
                let psnr = scores.iter().find(is_copy).and_then(|score| score.value(PSNR));
                let psnr = psnr.filter(|psnr| psnr.is_finite());
                let file = write(format!("job-{job:05}-copy.png"), picture)?;
                Some(CopyPicture { source: names.get(source).cloned().unwrap_or_default(), file, psnr })
            }
            None => None,
        };
        let truth = write(format!("job-{job:05}-truth.png"), truth)?;
        let mut sources = Vec::new();
        for (index, (picture, name)) in self.sources.into_iter().zip(names).enumerate() {
            let file = write(format!("job-{job:05}-source-{index:03}.png"), picture)?;
            sources.push(SourcePicture { name: name.clone(), file });
        }
        let mut schemes = Vec::new();
        for (index, (picture, shown)) in self.schemes.into_iter().enumerate() {
            let file = write(format!("job-{job:05}-scheme-{index:03}.png"), picture)?;
            schemes.push(SchemePicture { file, ..shown });
        }
        let (scene, target) = (scene_name.clone(), target.to_owned());
        let shown = TargetPictures { job, scene, target, truth, copy, sources, schemes };
        let path = folder.join(format!("job-{job:05}.json"));
        let json = serde_json::to_vec(&shown).map_err(|cause| GalleryError::Json { path: path.clone(), cause })?;
        Ok(write_whole(&path, &json)?)
    }
}

/// At most [`THUMBNAIL`] pixels on a side.
fn thumbnail(picture: RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    let longest = width.max(height);
    if longest <= THUMBNAIL {
        return picture;
    }
    let scaled = |side: u32| (side * THUMBNAIL / longest).max(1);
    imageops::resize(&picture, scaled(width), scaled(height), imageops::FilterType::Triangle)
}

/// The pictures in the folder of an evaluation, by number of job; empty if it has none.
///
/// # Errors
/// [`GalleryError`].
pub fn shown(folder: &Path) -> Result<Vec<TargetPictures>, GalleryError> {
    let folder = folder.join(PICTURES);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let unreadable = |path: &Path| {
        let path = path.to_path_buf();
        move |cause| GalleryError::Read { path, cause }
    };
    let mut all = Vec::new();
    for entry in fs::read_dir(&folder).map_err(unreadable(&folder))? {
        let path = entry.map_err(unreadable(&folder))?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let text = read_at_most(&path, LONGEST_DESCRIPTION).map_err(unreadable(&path))?;
            let shown: TargetPictures =
                serde_json::from_slice(&text).map_err(|cause| GalleryError::Json { path: path.clone(), cause })?;
            // A folder may come from somebody else: a page must not hold files of whoever makes it.
            if let Some(file) = shown.files().find(|file| !is_picture_name(file)) {
                return Err(GalleryError::Outside { path, file: file.to_owned() });
            }
            all.push(shown);
        }
    }
    all.sort_by_key(|shown| shown.job);
    Ok(all)
}
