//! Pictures as PNG files.

use image::{DynamicImage, ImageFormat};
use std::io::Cursor;
use std::path::Path;
use viewfuse_job::files::{WriteError, write_whole};

/// Writes a picture as PNG, completely or not at all.
///
/// # Errors
/// [`WriteError`].
pub fn write_png(path: &Path, picture: &DynamicImage) -> Result<(), WriteError> {
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })?;
    write_whole(path, bytes.get_ref())
}
