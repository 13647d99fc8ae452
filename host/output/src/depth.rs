//! Depth maps as files: 16-bit PNG for viewers, OpenEXR and NumPy's arrays with the depths as they were computed.
//!
//! All hold depths along the principal axis, row-major, 0 where there is no surface: PNG in steps of
//! [`depth_step`], the others as `f32`. [`RunWriter`](crate::run::RunWriter) writes them in units of
//! the scene's files.

use crate::png::write_png;
use crate::record::depth_step;
use image::{DynamicImage, ImageBuffer, Luma};
use std::path::Path;
use viewfuse_job::files::{WriteError, write_whole};
use viewfuse_scene::numpy::npy;

/// A format of depth maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthFormat {
    /// 16-bit grey PNG, in steps of [`depth_step`].
    Png,
    /// OpenEXR with one channel `Z` of `f32`.
    #[cfg(feature = "exr")]
    Exr,
    /// NumPy's array of `f32`, `[height][width]`.
    Npy,
}

viewfuse_job::named! {
    // The extensions of their files.
    pub DepthFormat: "a format of depth maps" {
        Png => "png",
        #[cfg(feature = "exr")]
        Exr => "exr",
        Npy => "npy",
    }
}

/// Writes depths of a picture of this size, one a pixel, completely or not at all.
///
/// # Errors
/// [`WriteError`], also for another number of depths.
pub fn write_depth(path: &Path, format: DepthFormat, depths: &[f32], size: [u32; 2]) -> Result<(), WriteError> {
    if depths.len() as u64 != u64::from(size[0]) * u64::from(size[1]) {
        let cause = format!("{} depths for {}x{} pixels", depths.len(), size[0], size[1]).into();
        return Err(WriteError::Encode { path: path.to_path_buf(), cause });
    }
    match format {
        DepthFormat::Png => write_png(path, &DynamicImage::ImageLuma16(depth_map(depths, size))),
        #[cfg(feature = "exr")]
        DepthFormat::Exr => crate::exr::write_exr(path, depths, size),
        DepthFormat::Npy => write_whole(path, &npy(&[size[1] as usize, size[0] as usize], depths)),
    }
}

/// Depths in steps of [`depth_step`].
pub fn depth_map(depths: &[f32], [width, height]: [u32; 2]) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let step = depth_step(depths);
    let depth = |x: u32, y: u32| Luma([(depths[(y * width + x) as usize] / step).round() as u16]);
    ImageBuffer::from_fn(width, height, depth)
}
