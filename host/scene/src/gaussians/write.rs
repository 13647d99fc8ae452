//! Writing a file of Gaussians.

use std::path::Path;

use viewfuse_core::Vec3;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_job::files::{WriteError, write_whole};

use super::{GaussianScene, MAX_DEGREE};
use crate::SceneFrame;
use crate::ply::header;

pub(super) fn write(scene: &GaussianScene, path: &Path, frame: &SceneFrame) -> Result<(), WriteError> {
    let is_double = *frame != SceneFrame::FILE;
    let rest_count = 3 * REST_COUNTS[scene.degree.min(MAX_DEGREE) as usize] as usize;
    let mut bytes = header("vertex", scene.gaussians.len(), properties(is_double, rest_count));
    let log_scale = frame.scale.ln();
    for (index, gaussian) in scene.gaussians.iter().enumerate() {
        for coordinate in frame.file(Vec3::from(gaussian.position).as_dvec3()).to_array() {
            match is_double {
                true => bytes.extend(coordinate.to_le_bytes()),
                false => bytes.extend((coordinate as f32).to_le_bytes()),
            }
        }
        let rest = scene.f_rest.get(index * rest_count..(index + 1) * rest_count).unwrap_or_default();
        let log_scales = gaussian.log_scales.map(|value| (f64::from(value) + log_scale) as f32);
        let normal_and_colour = [0.0; 3].into_iter().chain(gaussian.f_dc).chain(rest.iter().copied());
        let values = normal_and_colour.chain([gaussian.opacity]).chain(log_scales).chain(gaussian.rotation);
        values.for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    write_whole(path, &bytes)
}

/// Types and names, in the order of the published code.
fn properties(is_double: bool, rest_count: usize) -> impl Iterator<Item = (&'static str, String)> {
    let coordinate = if is_double { "double" } else { "float" };
    let numbered = |name: &'static str, count: usize| (0..count).map(move |index| ("float", format!("{name}_{index}")));
    ["x", "y", "z"]
        .into_iter()
        .map(move |name| (coordinate, name.to_owned()))
        .chain(["nx", "ny", "nz"].into_iter().map(|name| ("float", name.to_owned())))
        .chain(numbered("f_dc", 3))
        .chain(numbered("f_rest", rest_count))
        .chain([("float", "opacity".to_owned())])
        .chain(numbered("scale", 3))
        .chain(numbered("rot", 4))
}
