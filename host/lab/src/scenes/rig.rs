//! How a person goes around something with a camera: on an arc in front of it, looking at it, with an unsteady hand.
//!
//! The subject lies around the world's origin, with world z up. Every number is drawn for a seed, so that two seeds are
//! two walks with the same habits.

use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::math::{max, min, sin_cos};
use viewfuse_core::pose::{Pose, PoseError};
use viewfuse_core::random::uniform_from;

/// Where the cameras may stand: lengths are in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// The point that the cameras look at, more or less.
    pub subject: Vec3,
    /// Distance from the subject along the ground.
    pub distance: f32,
    /// Lowest and highest camera above the world's origin.
    pub heights: [f32; 2],
}

/// Angle from one view to the next, in radians: about 6 degrees.
const STEP: f32 = 0.11;

/// Largest angle of the arc, in radians.
const MAX_ARC: f32 = 2.1;

/// How far the camera is off what it looks at, as a part of the distance.
const UNSTEADY: f32 = 0.03;

/// Random numbers of a walk: those of a view do not depend on how many views there are.
struct Hand {
    key: [u32; 2],
    view: u32,
    count: u32,
}

impl Hand {
    /// Between -1 and 1.
    fn shake(&mut self) -> f32 {
        self.count += 1;
        2.0 * uniform_from(self.key, self.view, self.count) - 1.0
    }
}

/// `count` cameras on the arc.
pub fn cameras(walk: &Walk, pinhole: Pinhole, count: u32, seed: u64) -> Result<Vec<Camera>, PoseError> {
    let key = [seed as u32, (seed >> 32) as u32 ^ 0x5249_4753];
    let steps = max(count as f32 - 1.0, 1.0);
    let ([low, high], d) = (walk.heights, walk.distance);
    let camera = |view: u32| {
        let hand = &mut Hand { key, view, count: 0 };
        // As seen from the subject; -y is in front.
        let azimuth = min(STEP * steps, MAX_ARC) * (view as f32 / steps - 0.5) + 0.008 * hand.shake();
        let distance = d * (1.0 + 0.04 * hand.shake());
        let up = low + (high - low) * (0.5 + 0.5 * hand.shake());
        let (sine, cosine) = sin_cos(azimuth - FRAC_PI_2);
        let centre = Vec3::new(walk.subject.x + distance * cosine, walk.subject.y + distance * sine, up);
        let aim = walk.subject + Vec3::new(hand.shake(), hand.shake(), 0.7 * hand.shake()) * (UNSTEADY * d);
        let roll = Vec3::new(0.5 * UNSTEADY * hand.shake(), 0.5 * UNSTEADY * hand.shake(), 1.0);
        Ok(Camera { pose: Pose::look_at(centre, aim, roll)?, pinhole })
    };
    (0..count).map(camera).collect()
}
