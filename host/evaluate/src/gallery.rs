//! Pictures of an evaluation for its report: of a job's first target the sources, every scheme's prediction, the truth.

use image::{DynamicImage, RgbImage, imageops};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_core::metrics::psnr;
use viewfuse_field::render::Frame;
use viewfuse_job::files::{WriteError, write_whole};
use viewfuse_output::png::write_png;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::Weighting;

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
    /// A file does not describe pictures.
    #[error("{}: does not describe pictures of an evaluation: {cause}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: serde_json::Error,
    },
}

/// The pictures of a target. File names are relative to the folder of pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shown {
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
    pub copy: Option<ShownCopy>,
    /// The sources in their order.
    pub sources: Vec<ShownSource>,
    /// The schemes in theirs.
    pub schemes: Vec<ShownScheme>,
}

/// A source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShownSource {
    /// The view's name.
    pub name: String,
    /// Its photograph.
    pub file: String,
}

/// The copy of the nearest source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShownCopy {
    /// The source's name.
    pub source: String,
    /// Its photograph at the target's size.
    pub file: String,
    /// Its peak signal to noise ratio, decibels; null if it is not finite.
    pub psnr: Option<f64>,
}

/// A scheme's picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShownScheme {
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
    schemes: Vec<(RgbImage, ShownScheme)>,
}

impl Gallery {
    /// Stores the parts of a frame that the report needs.
    pub fn add(&mut self, weighting: &Weighting, frame: &Frame, values: &[(String, f64)], sources: &SourceImages) {
        let Some(truth) = &frame.truth else { return };
        if self.sources.is_empty() {
            self.sources = (0..sources.images.len()).map(|source| thumbnail(sources.picture(source))).collect();
            self.truth = Some(truth.picture.clone());
            self.copy = nearest(frame, sources).map(|source| {
                let (width, height) = truth.picture.dimensions();
                let own = sources.picture(source);
                (source, imageops::resize(&own, width, height, imageops::FilterType::Triangle))
            });
        }
        let finite = |(name, value): &(String, f64)| (name.clone(), Some(*value).filter(|value| value.is_finite()));
        let shown = ShownScheme {
            scheme: weighting.to_string(),
            file: String::new(),
            weights: frame.omission.weights.values()[..sources.images.len()].to_vec(),
            values: values.iter().map(finite).collect(),
        };
        self.schemes.push((frame.picture.clone(), shown));
    }

    /// Writes the pictures and then their description. `names` are those of the sources.
    ///
    /// # Errors
    /// [`GalleryError::Write`].
    pub fn write(
        self,
        folder: &Path,
        job: usize,
        scene: &str,
        target: &str,
        names: &[String],
    ) -> Result<(), GalleryError> {
        let Some(truth) = self.truth else { return Ok(()) };
        let folder = folder.join(PICTURES);
        let write = |name: String, picture: RgbImage| -> Result<String, GalleryError> {
            write_png(&folder.join(&name), &DynamicImage::ImageRgb8(picture))?;
            Ok(name)
        };
        let copy = match self.copy {
            Some((source, picture)) => {
                let psnr = Some(psnr(&picture, &truth)).filter(|psnr| psnr.is_finite());
                let file = write(format!("job-{job:05}-copy.png"), picture)?;
                Some(ShownCopy { source: names.get(source).cloned().unwrap_or_default(), file, psnr })
            }
            None => None,
        };
        let truth = write(format!("job-{job:05}-truth.png"), truth)?;
        let mut sources = Vec::new();
        for (index, (picture, name)) in self.sources.into_iter().zip(names).enumerate() {
            let file = write(format!("job-{job:05}-source-{index:03}.png"), picture)?;
            sources.push(ShownSource { name: name.clone(), file });
        }
        let mut schemes = Vec::new();
        for (index, (picture, shown)) in self.schemes.into_iter().enumerate() {
            let file = write(format!("job-{job:05}-scheme-{index:03}.png"), picture)?;
            schemes.push(ShownScheme { file, ..shown });
        }
        let shown = Shown { job, scene: scene.to_owned(), target: target.to_owned(), truth, copy, sources, schemes };
        let path = folder.join(format!("job-{job:05}.json"));
        let json = serde_json::to_vec(&shown).map_err(|cause| GalleryError::Json { path: path.clone(), cause })?;
        Ok(write_whole(&path, &json)?)
    }
}

/// The source whose camera is nearest to the target's, by its index; of equally near ones the first.
fn nearest(frame: &Frame, sources: &SourceImages) -> Option<usize> {
    let distance = |source: usize| sources.images[source].camera.pose.distance(&frame.target.camera.pose);
    (0..sources.images.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
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
pub fn shown(folder: &Path) -> Result<Vec<Shown>, GalleryError> {
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
            let text = fs::read(&path).map_err(unreadable(&path))?;
            let shown: Shown = serde_json::from_slice(&text).map_err(|cause| GalleryError::Json { path, cause })?;
            all.push(shown);
        }
    }
    all.sort_by_key(|shown| shown.job);
    Ok(all)
}
