//! Cameras on a sphere around the origin that look at it, with world z up.

use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::math::{sin_cos, sqrt};
use viewfuse_core::pose::{Pose, PoseError};

/// The golden angle in radians: points that advance by it never come to lie above each other.
const GOLDEN_ANGLE: f32 = 2.399_963_2;

/// A sphere of cameras that share their intrinsics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Distance of the cameras' centres from the origin, in world units.
    pub radius: f32,
    /// How they map directions to pixels.
    pub pinhole: Pinhole,
}

impl Orbit {
    /// The camera at an azimuth (radians, from world x towards y) and an elevation above the plane `z = 0` given by its
    /// sine.
    pub fn camera(&self, azimuth: f32, sine_of_elevation: f32) -> Result<Camera, PoseError> {
        let (sine, cosine) = sin_cos(azimuth);
        let level = sqrt(1.0 - sine_of_elevation * sine_of_elevation);
        let centre = Vec3::new(level * cosine, level * sine, sine_of_elevation) * self.radius;
        Ok(Camera { pose: Pose::look_at(centre, Vec3::ZERO, Vec3::Z)?, pinhole: self.pinhole })
    }

    /// `count` cameras spread evenly over the zone between two elevations given by their sines: each stands in the
    /// middle of its own band of equal area, and turns on by the golden angle from one to the next.
    pub fn spiral(&self, count: u32, sines_of_elevation: [f32; 2]) -> Result<Vec<Camera>, PoseError> {
        let [low, high] = sines_of_elevation;
        (0..count)
            .map(|index| {
                let sine = low + (high - low) * (index as f32 + 0.5) / count as f32;
                self.camera(index as f32 * GOLDEN_ANGLE, sine)
            })
            .collect()
    }
}
