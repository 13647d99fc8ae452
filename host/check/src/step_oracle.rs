//! Steps of an optimisation in `f64`, with bounds on the error of `f32`.

use super::bounded::{Bounded, roundings};
use super::camera_oracle::{axes, centre, dot};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::GaussianBlock;
use viewfuse_kernels::gaussians::adam::{FIRST_DECAY, SECOND_DECAY};

/// Absolute error of a spherical harmonic: a direction that is off by 4e-7, slopes of at most 10, and some ten
/// roundings of numbers up to 4.
const HARMONIC_ERROR: f64 = 1.0e-5;

/// 1 less a decay to the power of the steps.
fn correction(decay: f32, step_count: u32) -> Bounded {
    let value = f64::from(decay).powi(step_count as i32);
    Bounded::ONE - Bounded { value, error: value * roundings(2 * step_count as usize) }
}

/// A value and its two moments after a step of Adam, the `step_count`-th.
pub fn adam(value: f32, moments: [f32; 2], gradient: Bounded, rate: Bounded, step_count: u32) -> [Bounded; 3] {
    let [first, second] = [FIRST_DECAY, SECOND_DECAY].map(Bounded::from);
    let [mean, square] = moments.map(Bounded::from);
    let mean = first * mean + (Bounded::ONE - first) * gradient;
    let square = second * square + (Bounded::ONE - second) * gradient * gradient;
    let root = (square / correction(SECOND_DECAY, step_count)).square_root() + Bounded::from(1.0e-15_f32);
    [Bounded::from(value) - rate * (mean / correction(FIRST_DECAY, step_count)) / root, mean, square]
}

/// The spherical harmonics of degrees 1 to 3 along the direction from a camera to a Gaussian, which is not at it.
pub fn harmonics(gaussian: &GaussianBlock, camera: &CameraBlock) -> [Bounded; 15] {
    let origin = centre(camera);
    let offset = [0, 1, 2].map(|axis| f64::from(gaussian.position[axis]) - origin[axis].value);
    let length = offset.iter().map(|part| part * part).sum::<f64>().sqrt();
    let [x, y, z] = offset.map(|part| part / length);
    let pi = std::f64::consts::PI;
    let (one, two) = ((3.0 / (4.0 * pi)).sqrt(), 0.5 * (15.0 / pi).sqrt());
    let (outer, middle) = ((35.0 / (32.0 * pi)).sqrt(), (21.0 / (32.0 * pi)).sqrt());
    let values = [
        -one * y,
        one * z,
        -one * x,
        two * x * y,
        -two * y * z,
        0.25 * (5.0 / pi).sqrt() * (2.0 * z * z - x * x - y * y),
        -two * x * z,
        0.5 * two * (x * x - y * y),
        -outer * y * (3.0 * x * x - y * y),
        0.5 * (105.0 / pi).sqrt() * x * y * z,
        -middle * y * (4.0 * z * z - x * x - y * y),
        0.25 * (7.0 / pi).sqrt() * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
        -middle * x * (4.0 * z * z - x * x - y * y),
        0.25 * (105.0 / pi).sqrt() * z * (x * x - y * y),
        -outer * x * (x * x - 3.0 * y * y),
    ];
    values.map(|value| Bounded { value, error: HARMONIC_ERROR })
}

/// Depth of a place along a camera's principal axis.
pub fn depth(position: [Bounded; 3], camera: &CameraBlock) -> Bounded {
    let origin = centre(camera);
    dot(axes(camera)[2], [0, 1, 2].map(|axis| position[axis] - origin[axis]))
}
