//! Rigs: how a person goes around something with a camera.
//!
//! All rigs look at a subject around the world's origin, with world z up. Every number is drawn for a seed, so that two
//! seeds are two walks with the same habits.

use core::f32::consts::{FRAC_PI_2, TAU};
use std::fmt;
use std::str::FromStr;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::math::{floor_to_i32, max, min, sin_cos, sqrt};
use viewfuse_core::pose::{Pose, PoseError};
use viewfuse_core::random::uniform_from;

/// A way to take photographs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rig {
    /// On an arc in front of the subject, about 6 degrees from one view to the next, at most 120 degrees in all.
    Arc,
    /// Forward-facing: side by side in rows, with almost parallel principal axes.
    Forward,
    /// All around, at two heights.
    Turntable,
    /// A walk of small steps in front of the subject, with an unsteady hand.
    Handheld,
}

/// The name is none of a rig.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a rig: arc, forward, turntable or handheld")]
pub struct UnknownRig(String);

/// Where the cameras of a rig may stand: lengths are in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// The point that the cameras look at, more or less.
    pub subject: Vec3,
    /// Distance from the subject along the ground.
    pub distance: f32,
    /// Lowest and highest camera above the world's origin.
    pub heights: [f32; 2],
}

/// Angle from one view of an arc to the next, in radians.
const ARC_STEP: f32 = 0.11;

/// Largest angle of an arc, in radians.
const MAX_ARC: f32 = 2.1;

/// Random numbers of a rig: those of a view do not depend on how many views there are.
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

impl Rig {
    /// All rigs.
    pub const ALL: [Rig; 4] = [Rig::Arc, Rig::Forward, Rig::Turntable, Rig::Handheld];

    /// `count` cameras.
    ///
    /// # Errors
    /// [`PoseError`] if a camera would stand in the subject or straight above it; none for a sensible walk.
    pub fn cameras(self, walk: &Walk, pinhole: Pinhole, count: u32, seed: u64) -> Result<Vec<Camera>, PoseError> {
        let key = [seed as u32, (seed >> 32) as u32 ^ 0x5249_4753];
        (0..count).map(|view| self.camera(walk, pinhole, count, view, key)).collect()
    }

    fn camera(self, walk: &Walk, pinhole: Pinhole, count: u32, view: u32, key: [u32; 2]) -> Result<Camera, PoseError> {
        let mut hand = Hand { key, view, count: 0 };
        let steps = max(count as f32 - 1.0, 1.0);
        let along = view as f32 / steps;
        let [low, high] = walk.heights;
        let height = |part: f32| low + (high - low) * part;
        let d = walk.distance;
        // Azimuths are those of the camera as seen from the subject; -y is in front.
        let (azimuth, distance, up, unsteady) = match self {
            Rig::Arc => {
                let span = min(ARC_STEP * steps, MAX_ARC);
                let azimuth = span * (along - 0.5) + 0.008 * hand.shake();
                (azimuth, d * (1.0 + 0.04 * hand.shake()), height(0.5 + 0.5 * hand.shake()), 0.03)
            }
            Rig::Forward => {
                let column_count = max(sqrt(count as f32 * 1.7), 1.0);
                let per_row = floor_to_i32(column_count + 0.5).max(1) as u32;
                let row_count = count.div_ceil(per_row).max(1);
                let (row, column) = (view / per_row, view % per_row);
                let x = (column as f32 + 0.5) / per_row as f32 - 0.5 + 0.03 * hand.shake();
                let y = (row as f32 + 0.5) / row_count as f32 + 0.05 * hand.shake();
                return self.side_by_side(walk, pinhole, x, height(y), &mut hand);
            }
            Rig::Turntable => {
                let upper = (view & 1) as f32;
                (TAU * view as f32 / count as f32, d * (1.0 + 0.01 * hand.shake()), height(0.15 + 0.7 * upper), 0.01)
            }
            Rig::Handheld => {
                let (sine, _) = sin_cos(2.2 * TAU * along);
                let azimuth = 0.85 * (along - 0.5) + 0.05 * hand.shake();
                let up = height(0.5 + 0.35 * sine + 0.15 * hand.shake());
                (azimuth, d * (1.0 - 0.18 * along + 0.05 * hand.shake()), up, 0.1)
            }
        };
        let (sine, cosine) = sin_cos(azimuth - FRAC_PI_2);
        let centre = Vec3::new(walk.subject.x + distance * cosine, walk.subject.y + distance * sine, up);
        let aim = walk.subject + Vec3::new(hand.shake(), hand.shake(), 0.7 * hand.shake()) * (unsteady * d);
        let roll = Vec3::new(0.5 * unsteady * hand.shake(), 0.5 * unsteady * hand.shake(), 1.0);
        Ok(Camera { pose: Pose::look_at(centre, aim, roll)?, pinhole })
    }

    /// A camera of a forward-facing rig: `x` from -0.5 to 0.5 along its row.
    fn side_by_side(
        self,
        walk: &Walk,
        pinhole: Pinhole,
        x: f32,
        up: f32,
        hand: &mut Hand,
    ) -> Result<Camera, PoseError> {
        let d = walk.distance;
        let centre = walk.subject + Vec3::new(0.75 * d * x, -d * (1.0 + 0.03 * hand.shake()), 0.0);
        let centre = Vec3::new(centre.x, centre.y, up);
        // Principal axes that meet far behind the subject are almost parallel.
        let far = Vec3::new(walk.subject.x, walk.subject.y + 1.5 * d, walk.subject.z - 0.2 * up);
        let aim = far + Vec3::new(hand.shake(), 0.0, hand.shake()) * (0.03 * d);
        Ok(Camera { pose: Pose::look_at(centre, aim, Vec3::Z)?, pinhole })
    }
}

impl fmt::Display for Rig {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Rig::Arc => "arc",
            Rig::Forward => "forward",
            Rig::Turntable => "turntable",
            Rig::Handheld => "handheld",
        })
    }
}

impl FromStr for Rig {
    type Err = UnknownRig;

    fn from_str(name: &str) -> Result<Rig, UnknownRig> {
        Rig::ALL.into_iter().find(|rig| rig.to_string() == name).ok_or_else(|| UnknownRig(name.to_owned()))
    }
}
