//! `.splat`, the format of antimatter15's viewer: 32 bytes a Gaussian and no header. Position and standard deviations
//! are three `float` each; red, green, blue and opacity a byte each; the quaternion `w, x, y, z` a byte each, 128 for
//! 0.

use std::path::Path;

use glam::DVec3;
use viewfuse_core::gaussian::{SH_0, opacity};

use super::place::{GaussianPlace, RawGaussian};
use super::{Gaussian, GaussianScene, refused};
use crate::SceneFrame;
use crate::scene::SceneError;

/// Bytes of a Gaussian.
const SIZE: usize = 32;

/// Whether bytes can be such a file: whole Gaussians with positions and standard deviations that are numbers.
pub(super) fn is_plausible(bytes: &[u8]) -> bool {
    let rows = bytes.chunks_exact(SIZE);
    rows.remainder().is_empty()
        && rows.take(1024).all(|row| {
            let values = floats(row);
            values.iter().all(|value| value.is_finite()) && values[3..].iter().all(|scale| *scale >= 0.0)
        })
}

/// Whether bytes are such a file, whatever it is called: its quaternions have length 1, which other numbers have not.
pub(super) fn is_likely(bytes: &[u8]) -> bool {
    let is_unit = |row: &[u8]| {
        let square: f32 = rotation(row).iter().map(|value| value * value).sum();
        (0.8..1.2).contains(&square)
    };
    !bytes.is_empty() && is_plausible(bytes) && bytes.chunks_exact(SIZE).take(1024).all(is_unit)
}

pub(super) fn read(path: &Path, bytes: &[u8], place: &GaussianPlace<'_>) -> Result<GaussianScene, SceneError> {
    if !is_plausible(bytes) {
        return Err(refused(path, "not a .splat: it is no sequence of 32 bytes with finite numbers a Gaussian"));
    }
    let gaussian = |(index, row): (usize, &[u8])| {
        let values = floats(row).map(f64::from);
        let byte = |at: usize| f64::from(row[at]) / 255.0;
        let raw = RawGaussian {
            position: DVec3::new(values[0], values[1], values[2]),
            log_scales: [values[3], values[4], values[5]].map(f64::ln),
            rotation: rotation(row),
            opacity: logit(byte(27)),
            f_dc: [24, 25, 26].map(|at| (byte(at) as f32 - 0.5) / SH_0),
        };
        place.gaussian(index, &raw)
    };
    let gaussians: Result<Vec<Gaussian>, SceneError> = bytes.chunks_exact(SIZE).enumerate().map(gaussian).collect();
    Ok(GaussianScene { gaussians: gaussians?, ..GaussianScene::default() })
}

/// The file's bytes; colours are those of degree 0.
pub(super) fn bytes(scene: &GaussianScene, frame: &SceneFrame) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(scene.gaussians.len() * SIZE);
    for gaussian in &scene.gaussians {
        let position = frame.file(glam::Vec3::from(gaussian.position).as_dvec3()).as_vec3().to_array();
        let scales = gaussian.log_scales.map(|value| (f64::from(value).exp() * frame.scale) as f32);
        position.iter().chain(&scales).for_each(|value| bytes.extend(value.to_le_bytes()));
        // A float beyond a byte's range becomes the nearest byte.
        bytes.extend(gaussian.f_dc.map(|value| ((0.5 + SH_0 * value) * 255.0).round() as u8));
        bytes.push((opacity(gaussian.opacity) * 255.0).round() as u8);
        bytes.extend(unit(gaussian.rotation).map(|value| (value * 128.0 + 128.0).round() as u8));
    }
    bytes
}

/// The quaternion of a row.
fn rotation(row: &[u8]) -> [f32; 4] {
    [28, 29, 30, 31].map(|at| (f32::from(row[at]) - 128.0) / 128.0)
}

/// The first six numbers of a row.
fn floats(row: &[u8]) -> [f32; 6] {
    std::array::from_fn(|at| f32::from_le_bytes([row[4 * at], row[4 * at + 1], row[4 * at + 2], row[4 * at + 3]]))
}

/// The logit of an opacity; infinite at 0 and 1.
pub(super) fn logit(opacity: f64) -> f64 {
    (opacity / (1.0 - opacity)).ln()
}

/// A quaternion of length 1; that of no rotation for one of no length.
pub(super) fn unit(rotation: [f32; 4]) -> [f32; 4] {
    let length = rotation.iter().map(|value| value * value).sum::<f32>().sqrt();
    if length > 0.0 { rotation.map(|value| value / length) } else { [1.0, 0.0, 0.0, 0.0] }
}
