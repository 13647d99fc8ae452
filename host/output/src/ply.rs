//! Point clouds as PLY files: binary, little-endian, with normals and colours, in the coordinates of the scene's files.

use std::path::Path;
use viewfuse_field::point_cloud::CloudPoint;
use viewfuse_job::files::{WriteError, write_whole};
use viewfuse_scene::SceneFrame;
use viewfuse_scene::ply::header;

/// Writes a cloud, completely or not at all. Coordinates are `float`, or `double` where the scene was moved or scaled
/// when it was opened: `float` would not hold them.
///
/// # Errors
/// [`WriteError`].
pub fn write_ply(path: &Path, points: &[CloudPoint], frame: &SceneFrame) -> Result<(), WriteError> {
    let is_double = *frame != SceneFrame::FILE;
    let coordinate = if is_double { "double" } else { "float" };
    let properties = ["x", "y", "z"]
        .map(|name| (coordinate, name.to_owned()))
        .into_iter()
        .chain(["nx", "ny", "nz"].map(|name| ("float", name.to_owned())))
        .chain(["red", "green", "blue"].map(|name| ("uchar", name.to_owned())));
    let mut bytes = header("vertex", points.len(), properties, &["viewfuse".to_owned()]);
    for CloudPoint { position, normal, colour, .. } in points {
        for value in frame.file(position.as_dvec3()).to_array() {
            match is_double {
                true => bytes.extend(value.to_le_bytes()),
                false => bytes.extend((value as f32).to_le_bytes()),
            }
        }
        normal.to_array().into_iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend(colour);
    }
    write_whole(path, &bytes)
}
