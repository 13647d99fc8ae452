//! The arc around the subject on which there are photographs.

use crate::coverage::REACH_DEGREES;
use crate::rig::Rig;
use std::f32::consts::{PI, TAU};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;

/// The largest gap between neighbours that still belongs to the arc: its middle is in reach of both.
const MAX_GAP: f32 = 2.0 * REACH_DEGREES * PI / 180.0;
/// The least width, degrees: photographs from one side alone leave room to move.
const MIN_WIDTH_DEGREES: f32 = 20.0;
/// Of an offset from the focus: less of it across the up direction has no azimuth.
const MIN_ACROSS: f32 = 1.0e-3;

/// A part of the circle around what some cameras look at, about their up direction. Angles in radians.
#[derive(Clone, Debug, PartialEq)]
pub struct Arc {
    /// The angle of its first end, from the side of the first camera.
    pub start: f32,
    /// Its width; a full turn for the whole circle.
    pub width: f32,
    /// The cameras that stand on it, as indices.
    pub cameras: Vec<usize>,
    /// The directions from which angles count: unit, across the up direction, a right angle between them.
    pub across: [Vec3; 2],
}

impl Arc {
    /// The whole circle around the focus of some cameras (at least one).
    pub fn full(cameras: &[Camera]) -> Arc {
        let Rig { focus, up, .. } = Rig::of(cameras);
        let first = cameras.first().map_or(Vec3::X, |camera| camera.pose.centre_world() - focus);
        let ahead = (first - up * first.dot(up)).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        Arc { start: 0.0, width: TAU, cameras: (0..cameras.len()).collect(), across: [ahead, up.cross(ahead)] }
    }

    /// The arc from photograph to photograph, no two neighbours more than 60 degrees apart, on which most of the
    /// cameras (at least one) stand; of several, the widest. It has at least 20 degrees. The whole circle if no gap is
    /// larger, or if all cameras are straight above the focus.
    pub fn covered(cameras: &[Camera]) -> Arc {
        let Rig { focus, up, .. } = Rig::of(cameras);
        let full = Arc::full(cameras);
        let azimuth = |camera: &Camera| {
            let offset = camera.pose.centre_world() - focus;
            let across = offset - up * offset.dot(up);
            let is_aside = across.length() > MIN_ACROSS * offset.length();
            is_aside.then(|| across.dot(full.across[1]).atan2(across.dot(full.across[0])))
        };
        let mut stands: Vec<(f32, usize)> =
            cameras.iter().enumerate().filter_map(|(index, camera)| Some((azimuth(camera)?, index))).collect();
        stands.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = stands.len();
        // The angle from a camera to the next one, around the circle.
        let gap = |stand: usize| {
            let turn = if stand + 1 == count { TAU } else { 0.0 };
            stands[(stand + 1) % count].0 + turn - stands[stand].0
        };
        let ends: Vec<usize> = (0..count).filter(|&stand| gap(stand) > MAX_GAP).collect();
        let runs = ends.iter().enumerate().map(|(index, &end)| {
            let before = ends[(index + ends.len() - 1) % ends.len()];
            let first = (before + 1) % count;
            let length = 1 + (end + count - first) % count;
            let turn = if end < first { TAU } else { 0.0 };
            let members: Vec<usize> = (0..length).map(|step| stands[(first + step) % count].1).collect();
            Arc {
                start: stands[first].0,
                width: stands[end].0 + turn - stands[first].0,
                cameras: members,
                ..full.clone()
            }
        });
        let order = |a: &Arc, b: &Arc| a.cameras.len().cmp(&b.cameras.len()).then(a.width.total_cmp(&b.width));
        match runs.max_by(order) {
            Some(arc) => {
                let more = (MIN_WIDTH_DEGREES.to_radians() - arc.width).max(0.0);
                Arc { start: arc.start - 0.5 * more, width: arc.width + more, ..arc }
            }
            None => full,
        }
    }

    /// Whether it is the whole circle.
    pub fn is_full(&self) -> bool {
        self.width >= TAU
    }

    /// The unit directions of `count` places, evenly apart: of the whole circle, from the side of the first camera on;
    /// of a part, from end to end, and of one place, its middle.
    pub fn directions(&self, count: usize) -> impl Iterator<Item = Vec3> {
        let (start, [ahead, aside]) = (self.start, self.across);
        let (first, step) = match count {
            _ if self.is_full() => (0.0, self.width / count.max(1) as f32),
            1 => (0.5 * self.width, 0.0),
            _ => (0.0, self.width / (count.max(2) - 1) as f32),
        };
        (0..count).map(move |index| {
            let angle = start + first + step * index as f32;
            ahead * angle.cos() + aside * angle.sin()
        })
    }
}
