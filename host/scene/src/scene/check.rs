//! The checks that every reader shares: numbers become poses and pinholes here, and nowhere else.
//!
//! All arithmetic is in f64; what is handed to core is rounded once.

use std::path::Path;

use viewfuse_core::camera::Pinhole;
use viewfuse_core::pose::{Pose, PoseError};

use super::error::SceneError;
use super::fault::{IntrinsicsFault, Place};

/// What a file's camera axes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axes {
    /// x right, y down, z forward.
    OpenCv,
    /// x right, y up, z backward.
    OpenGl,
}

/// A pose from the 16 numbers of a row-major camera-to-world matrix.
pub(super) fn pose(path: &Path, place: Place, world_from_camera: &[f64; 16], axes: Axes) -> Result<Pose, SceneError> {
    let rows: [[f32; 4]; 4] =
        std::array::from_fn(|row| std::array::from_fn(|column| world_from_camera[4 * row + column] as f32));
    let checked: Result<Pose, PoseError> = match axes {
        Axes::OpenCv => Pose::from_opencv(&rows),
        Axes::OpenGl => Pose::from_opengl(&rows),
    };
    checked.map_err(|reason| SceneError::Pose { path: path.to_path_buf(), place, reason })
}

/// A pose from the 16 numbers of a row-major world-to-camera matrix in OpenCV axes: `[R^T | -R^T t]`.
pub(super) fn pose_from_inverse(path: &Path, place: Place, camera_from_world: &[f64; 16]) -> Result<Pose, SceneError> {
    // Transposing inverts a rigid matrix only, so the matrix as given must pass too.
    pose(path, place.clone(), camera_from_world, Axes::OpenCv)?;
    let m = camera_from_world;
    let mut inverse = [0.0; 16];
    for row in 0..3 {
        for column in 0..3 {
            inverse[4 * row + column] = m[4 * column + row];
        }
        inverse[4 * row + 3] = -(m[row] * m[3] + m[4 + row] * m[7] + m[8 + row] * m[11]);
    }
    inverse[15] = 1.0;
    pose(path, place, &inverse, Axes::OpenCv)
}

/// Intrinsics as a file states them, for images of one size, in our image coordinates (pixel centres at halves).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Intrinsics {
    /// Focal lengths along x and y in pixels.
    pub(super) focal: [f64; 2],
    /// Principal point, x and y, in pixels.
    pub(super) principal: [f64; 2],
    /// Width and height of the images that they are for.
    pub(super) size: [u32; 2],
}

impl Intrinsics {
    /// The pinhole of images of this size, if the numbers are a pinhole camera.
    pub(super) fn pinhole(&self, path: &Path, place: Place) -> Result<Pinhole, SceneError> {
        let single = |pair: [f64; 2]| pair.map(|value| value as f32);
        let [width, height] = self.size;
        Pinhole::new(single(self.focal), single(self.principal), width, height).map_err(|error| {
            let fault = IntrinsicsFault::from_pinhole(error, self.focal, self.principal, self.size);
            SceneError::Intrinsics { path: path.to_path_buf(), place, fault }
        })
    }

    /// The pinhole of a photograph that may be a resampled copy: focal lengths and principal point scale with their
    /// axis.
    ///
    /// # Errors
    /// [`SceneError::SizeMismatch`] if the photograph cannot be the whole image at another scale.
    pub(super) fn pinhole_of(
        &self,
        path: &Path,
        place: Place,
        image: &Path,
        image_size: [u32; 2],
    ) -> Result<Pinhole, SceneError> {
        self.pinhole(path, place.clone())?;
        if !same_shape(self.size, image_size) {
            return Err(SceneError::SizeMismatch {
                path: image.to_path_buf(),
                width: image_size[0],
                height: image_size[1],
                declared_in: format!("{}{place}", path.display()),
                declared_width: self.size[0],
                declared_height: self.size[1],
            });
        }
        let scale = [0, 1].map(|axis| f64::from(image_size[axis]) / f64::from(self.size[axis]));
        let scaled = |pair: [f64; 2]| [pair[0] * scale[0], pair[1] * scale[1]];
        let resampled = Intrinsics { focal: scaled(self.focal), principal: scaled(self.principal), size: image_size };
        resampled.pinhole(path, place)
    }
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
