//! The checks that every reader shares: numbers become poses and pinholes here, and nowhere else.
//!
//! All arithmetic is in f64; what is handed to core is rounded once.

use std::path::Path;

use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::{Pose, PoseError};

use super::View;
use super::error::SceneError;
use super::fault::{IntrinsicsFault, Place};
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawView};

/// The views of a scene, those with photographs first.
pub(super) fn views(found: &Path, form: &'static str, raw: Vec<RawView>) -> Result<Vec<View>, SceneError> {
    let (photographs, targets): (Vec<RawView>, Vec<RawView>) = raw.into_iter().partition(|view| view.image.is_some());
    let mut views: Vec<View> = Vec::with_capacity(photographs.len() + targets.len());
    for view in photographs.into_iter().chain(targets) {
        if view.name.is_empty() || view.name.contains(std::path::is_separator) {
            return Err(SceneError::Name { path: found.to_path_buf(), name: view.name });
        }
        let pinhole = match (&view.intrinsics, views.first()) {
            (Some(intrinsics), _) => pinhole_of(intrinsics, view.image.as_ref())?,
            (None, Some(first)) => first.camera.pinhole,
            (None, None) => return Err(SceneError::NoViews { path: found.to_path_buf(), looked_for: form }),
        };
        let camera = Camera { pose: pose(&view.pose)?, pinhole };
        views.push(View { name: view.name, camera, image: view.image.map(|image| image.path().to_path_buf()) });
    }
    match views.first().is_some_and(|view| view.image.is_some()) {
        true => Ok(views),
        false => Err(SceneError::NoViews { path: found.to_path_buf(), looked_for: form }),
    }
}

/// A pose from the 16 numbers of a row-major matrix.
fn pose(raw: &RawPose) -> Result<Pose, SceneError> {
    let RawPose { matrix, form, path, place } = raw;
    let checked = match form {
        PoseForm::WorldFromOpenCv => Pose::from_opencv(&rows(matrix)),
        PoseForm::WorldFromOpenGl => Pose::from_opengl(&rows(matrix)),
        PoseForm::OpenCvFromWorld => pose_from_inverse(matrix),
    };
    checked.map_err(|reason| SceneError::Pose { path: path.clone(), place: place.clone(), reason })
}

fn rows(matrix: &[f64; 16]) -> [[f32; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[4 * row + column] as f32))
}

/// A pose from a world-to-camera matrix in OpenCV axes: `[R^T | -R^T t]`.
fn pose_from_inverse(camera_from_world: &[f64; 16]) -> Result<Pose, PoseError> {
    // Transposing inverts a rigid matrix only, so the matrix as given must pass too.
    Pose::from_opencv(&rows(camera_from_world))?;
    let m = camera_from_world;
    let mut inverse = [0.0; 16];
    for row in 0..3 {
        for column in 0..3 {
            inverse[4 * row + column] = m[4 * column + row];
        }
        inverse[4 * row + 3] = -(m[row] * m[3] + m[4 + row] * m[7] + m[8 + row] * m[11]);
    }
    inverse[15] = 1.0;
    Pose::from_opencv(&rows(&inverse))
}

/// The pinhole of a view: of the intrinsics' own size, or of a photograph that may be a resampled copy of such an image.
///
/// # Errors
/// [`SceneError::SizeMismatch`] if the photograph cannot be the whole image at another scale.
fn pinhole_of(raw: &RawIntrinsics, image: Option<&ImageFile>) -> Result<Pinhole, SceneError> {
    let RawIntrinsics { focal, principal, size, path, place, size_place } = raw;
    let own = pinhole(path, place, *focal, *principal, *size)?;
    let Some(image) = image else { return Ok(own) };
    let image_size = image.size();
    if !same_shape(*size, image_size) {
        return Err(SceneError::SizeMismatch {
            path: image.path().to_path_buf(),
            width: image_size[0],
            height: image_size[1],
            declared_in: format!("{}{size_place}", path.display()),
            declared_width: size[0],
            declared_height: size[1],
        });
    }
    let scale = [0, 1].map(|axis| f64::from(image_size[axis]) / f64::from(size[axis]));
    let scaled = |pair: &[f64; 2]| [pair[0] * scale[0], pair[1] * scale[1]];
    pinhole(path, size_place, scaled(focal), scaled(principal), image_size)
}

/// The pinhole of images of this size, if the numbers are a pinhole camera.
fn pinhole(
    path: &Path,
    place: &Place,
    focal: [f64; 2],
    principal: [f64; 2],
    size: [u32; 2],
) -> Result<Pinhole, SceneError> {
    let single = |pair: [f64; 2]| pair.map(|value| value as f32);
    Pinhole::new(single(focal), single(principal), size[0], size[1]).map_err(|error| {
        let fault = IntrinsicsFault::from_pinhole(error, focal, principal, size);
        SceneError::Intrinsics { path: path.to_path_buf(), place: place.clone(), fault }
    })
}

/// A width and a height from numbers of a file.
pub(super) fn size(path: &Path, place: Place, width: f64, height: f64) -> Result<[u32; 2], SceneError> {
    let whole = |side: f64| (1.0..=f64::from(1u32 << 20)).contains(&side) && side.fract() == 0.0;
    if whole(width) && whole(height) {
        return Ok([width as u32, height as u32]);
    }
    let fault = IntrinsicsFault::Size { width, height };
    Err(SceneError::Intrinsics { path: path.to_path_buf(), place, fault })
}

/// Whether one size is the other at another scale, each side rounded to a whole pixel up or down.
///
/// An image that keeps one side and changes the other is a crop, however small the change.
fn same_shape(a: [u32; 2], b: [u32; 2]) -> bool {
    if a[0] == b[0] || a[1] == b[1] {
        return a == b;
    }
    let (wide, tall) = (u64::from(a[0]) * u64::from(b[1]), u64::from(a[1]) * u64::from(b[0]));
    wide.abs_diff(tall) < u64::from(a[0].max(a[1]))
}
