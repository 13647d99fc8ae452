//! Where scenes to learn from are seen from: the sphere and the spiral of Scene Representation Networks' scenes.
//!
//! Cameras stand [`DISTANCE`] from the origin, look at it with world z up, and have the field of view of the ShapeNet
//! scenes: focal length 131.25 at 128 x 128 pixels.

use crate::scenes::orbit::Orbit;
use core::f32::consts::{FRAC_PI_2, TAU};
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::math::{clamp, max, min, sin_cos};
use viewfuse_core::pose::PoseError;
use viewfuse_core::random::{threefry_2x32, uniform_pair};

/// Of every camera from the origin, in world units.
pub const DISTANCE: f32 = 1.3;

/// How far the spiral turns from the horizon to the pole, in radians.
const SPIRAL_ANGLE: f32 = 20.0;

/// Of the random views, this share is from below.
const SHARE_FROM_BELOW: f32 = 0.1;

/// Sine of the largest elevation, a twelfth of a degree from the pole, where up is undefined.
const HIGHEST_SINE: f32 = 0.999_999;

/// The sphere of cameras with square pictures of `side` pixels.
pub fn sphere(side: u32) -> Result<Orbit, PinholeError> {
    let scale = side as f32 / 128.0;
    let pinhole = Pinhole::new([131.25 * scale; 2], [64.0 * scale; 2], side, side)?;
    Ok(Orbit { radius: DISTANCE, pinhole })
}

/// Random cameras for one object: nine of ten spread evenly over the upper half of the sphere, the others over the
/// lower one. Each depends on the seed, the object's index and its own index alone.
pub fn random_views(sphere: &Orbit, seed: u64, object: u32, count: u32) -> Result<Vec<Camera>, PoseError> {
    // The numbers that describe objects have a kind there, which is small.
    let key = threefry_2x32([seed as u32, (seed >> 32) as u32], [object, u32::MAX]);
    (0..count)
        .map(|view| {
            let [turns, height] = uniform_pair(key, view, 0);
            let sine = if height < SHARE_FROM_BELOW {
                -height / SHARE_FROM_BELOW
            } else {
                (height - SHARE_FROM_BELOW) / (1.0 - SHARE_FROM_BELOW)
            };
            sphere.camera(TAU * turns, clamp(sine, -HIGHEST_SINE, HIGHEST_SINE))
        })
        .collect()
}

/// The spiral on which SRN's test views stand: with `t` from 0 to 1, elevation `t pi / 2` and azimuth `20 (1 - t)`
/// radians. So say the poses of the published scenes, which have 251 views; the last one, at the pole, is here beside
/// it.
pub fn spiral_views(sphere: &Orbit, count: u32) -> Result<Vec<Camera>, PoseError> {
    (0..count)
        .map(|view| {
            let t = view as f32 / max(count as f32 - 1.0, 1.0);
            let (sine, _) = sin_cos(FRAC_PI_2 * t);
            sphere.camera(SPIRAL_ANGLE * (1.0 - t), min(sine, HIGHEST_SINE))
        })
        .collect()
}
