//! A scene folder in the layout of Scene Representation Networks (SRN).
//!
//! ```text
//! intrinsics.txt     focal cx cy 0 / 0 0 0 / 1 / height width
//! pose/000000.txt    camera-to-world, 4 x 4 row-major on one line, OpenCV axes
//! rgb/000000.png     straight RGBA
//! ```
//!
//! Numbers are written with the fewest digits that read back as the same `f32`. The folder is filled under a temporary
//! name beside its own and then renamed: a run that is killed leaves no folder that looks finished.

use crate::scenes::object::Object;
use crate::scenes::render::render_with;
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_job::files::WholeFolder;
use viewfuse_job::progress::{Interrupted, Progress};

/// Most views in a folder: their names have six digits.
pub const MAX_VIEW_COUNT: usize = 1_000_000;

/// Why a scene folder was not written. Nothing stands at its path then that was not there before.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error("{path}: exists already and is not overwritten", path = .path.display())]
    Exists { path: PathBuf },
    #[error("{path}: does not name a folder", path = .path.display())]
    NoName { path: PathBuf },
    #[error("{path}: a scene has 1 to {MAX_VIEW_COUNT} views, not {count}", path = .path.display())]
    ViewCount { path: PathBuf, count: usize },
    #[error(
        "{path}: view {view} has intrinsics that this layout cannot hold beside the first view's",
        path = .path.display()
    )]
    Intrinsics { path: PathBuf, view: usize },
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
    #[error("{path}: cannot be written", path = .path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{path}: cannot be stored as a JPEG", path = .path.display())]
    Jpeg { path: PathBuf, source: image::ImageError },
    #[error("{path}: cannot be stored as a PNG", path = .path.display())]
    Png { path: PathBuf, source: image::ImageError },
}

/// Renders `object` from every camera and writes the scene to `folder`, which must not exist; its parent is created
/// where it is missing. Views are named by the index of their camera. A pixel is the mean of `rays_per_side` squared
/// rays ([`render_with`]). It checks `progress` between the views, stops if it says so, and tells it each view's step,
/// which the caller has told it to expect.
pub fn write_scene(
    folder: &Path,
    object: &Object,
    cameras: &[Camera],
    rays_per_side: u32,
    progress: &dyn Progress,
) -> Result<(), WriteError> {
    let pinhole = shared_pinhole(folder, cameras)?;
    create_whole(folder, |unfinished| {
        for path in [unfinished.join("pose"), unfinished.join("rgb")] {
            fs::create_dir(&path).map_err(io_error(&path))?;
        }
        write_text(&unfinished.join("intrinsics.txt"), &intrinsics_text(&pinhole))?;
        for (index, camera) in cameras.iter().enumerate() {
            progress.check()?;
            write_text(&unfinished.join(format!("pose/{index:06}.txt")), &pose_text(camera))?;
            let picture = render_with(object, camera, rays_per_side);
            write_picture(&unfinished.join(format!("rgb/{index:06}.png")), &picture)?;
            progress.step();
        }
        Ok(())
    })
}

/// Creates a folder that must not exist, filled by `fill` under another name beside it and then renamed; its parent is
/// created where it is missing.
pub(crate) fn create_whole(
    folder: &Path,
    fill: impl FnOnce(&Path) -> Result<(), WriteError>,
) -> Result<(), WriteError> {
    folder.file_name().ok_or_else(|| WriteError::NoName { path: folder.to_owned() })?;
    // `symlink_metadata`: a dangling link is something that stands there, too.
    if folder.symlink_metadata().is_ok() {
        return Err(WriteError::Exists { path: folder.to_owned() });
    }
    let unfinished = WholeFolder::create(folder).map_err(io_error(folder))?;
    fill(&unfinished.path())?;
    unfinished.finish().map_err(io_error(folder))
}

pub(crate) fn shared_pinhole(folder: &Path, cameras: &[Camera]) -> Result<Pinhole, WriteError> {
    let count = cameras.len();
    let Some(first) = cameras.first().filter(|_| count <= MAX_VIEW_COUNT) else {
        return Err(WriteError::ViewCount { path: folder.to_owned(), count });
    };
    let [focal_x, focal_y] = first.pinhole.focal();
    let misfit = if focal_x == focal_y { cameras.iter().position(|c| c.pinhole != first.pinhole) } else { Some(0) };
    match misfit {
        Some(view) => Err(WriteError::Intrinsics { path: folder.to_owned(), view }),
        None => Ok(first.pinhole),
    }
}

/// The four lines of `intrinsics.txt`, with the full stops that the layout's own files have.
fn intrinsics_text(pinhole: &Pinhole) -> String {
    let [focal, _] = pinhole.focal();
    let [x, y] = pinhole.principal();
    let (width, height) = (pinhole.width(), pinhole.height());
    format!("{} {} {} 0.\n0. 0. 0.\n1.\n{height} {width}\n", decimal(focal), decimal(x), decimal(y))
}

fn pose_text(camera: &Camera) -> String {
    let numbers: Vec<String> = camera.pose.to_opencv().iter().flatten().map(|&number| decimal(number)).collect();
    numbers.join(" ") + "\n"
}

/// The fewest digits that read back as the same `f32`, always with a full stop.
fn decimal(number: f32) -> String {
    let digits = number.to_string();
    if digits.contains('.') { digits } else { digits + "." }
}

pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    fs::write(path, text).map_err(io_error(path))
}

pub(crate) fn write_picture(path: &Path, picture: &image::RgbaImage) -> Result<(), WriteError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgba8)
        .map_err(|source| WriteError::Png { path: path.to_owned(), source })?;
    fs::write(path, bytes).map_err(io_error(path))
}

pub(crate) fn io_error(path: &Path) -> impl FnOnce(io::Error) -> WriteError {
    move |source| WriteError::Io { path: path.to_owned(), source }
}
