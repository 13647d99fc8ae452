//! Depth maps as OpenEXR files.

use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage};
use std::io::Cursor;
use std::path::Path;
use viewfuse_job::files::{WriteError, write_whole};

/// Writes depths of a picture of this size as one channel `Z` of `f32`, completely or not at all.
///
/// # Errors
/// [`WriteError`].
pub fn write_exr(path: &Path, depths: &[f32], [width, height]: [u32; 2]) -> Result<(), WriteError> {
    let width = width as usize;
    let depth = |at: Vec2<usize>| (depths[at.y() * width + at.x()],);
    let channels = SpecificChannels::build().with_channel("Z").with_pixel_fn(depth);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_channels((width, height as usize), channels)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })?;
    write_whole(path, bytes.get_ref())
}
