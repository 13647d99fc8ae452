//! Occupancy and colour at a point.

use super::hull::look_up;
use super::{NO_SURFACE, ObjectBlock, fade};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::fuse::VisibleFusion;
use viewfuse_core::lookup::split;
use viewfuse_core::math::{abs, exp, max, min};

/// Below this hull alpha a point is empty and no more views are evaluated.
pub const EMPTY_ALPHA: f32 = 0.02;
/// Signed distances are truncated at this many footprints to either side of a surface.
pub const TRUNCATION: f32 = 5.0;
/// The surface is put this many footprints in front of the depths: hulls are slightly too small, and for the sweep a
/// missing depth is better than a wrong one.
pub const SURFACE_OFFSET: f32 = 0.5;
/// Width of the logistic step from empty to full, in footprints.
pub const SURFACE_WIDTH: f32 = 0.5;
/// A point that lies further than this behind the surface of *every* view, in radii of the object, is empty: only the
/// silhouettes' lack of views fills it.
pub const DEEPEST: f32 = 0.15;
/// Hull alpha from which on a point counts as wholly inside the silhouettes.
pub const FULL_ALPHA: f32 = 0.85;
/// How far behind a view's surface a point still counts as seen by it, in footprints.
pub const SEEN_BEHIND: f32 = 3.0;
/// Neighbouring depths that differ by more than this many footprints belong to different surfaces and are not mixed.
pub const JUMP: f32 = 4.0;
/// Share of a view that does not see a point, so that a point seen by none still gets a colour close to the truth.
pub const HIDDEN_SHARE: f32 = 1.0e-4;

/// The field's value at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The occupancy, in `[0, 1]`.
    pub occupancy: f32,
    /// Its colour, red green blue in `[0, 1]`.
    pub colour: [f32; 3],
}

/// A point outside the object.
pub const EMPTY: Sample = Sample { occupancy: 0.0, colour: [0.0; 3] };

/// Depth that a view's map has at an image coordinate: bilinear over those of the four depths around it that belong to
/// the same surface as the one with the greatest share, or as the nearest where that one sees nothing. [`NO_SURFACE`]
/// where all four see nothing.
#[inline]
pub fn depth_at(view: &CameraBlock, depths: &(impl Fetch<f32> + ?Sized), x: f32, y: f32, jump: f32) -> f32 {
    let (left, right, share_x) = split(x, view.width);
    let (top, bottom, share_y) = split(y, view.height);
    let first = view.first_texel as usize;
    let (top, bottom) = (first + top * view.width as usize, first + bottom * view.width as usize);
    let around = [
        depths.fetch(top + left),
        depths.fetch(top + right),
        depths.fetch(bottom + left),
        depths.fetch(bottom + right),
    ];
    let shares =
        [(1.0 - share_x) * (1.0 - share_y), share_x * (1.0 - share_y), (1.0 - share_x) * share_y, share_x * share_y];
    let (mut surface, mut greatest) = (NO_SURFACE, -1.0);
    let mut nearest = NO_SURFACE;
    let mut at = 0;
    while at < 4 {
        // Beyond the first and last centres a node is asked along whose share is 0: it is not around the coordinate.
        if shares[at] > 0.0 {
            nearest = min(around[at], nearest);
        }
        if shares[at] > greatest {
            greatest = shares[at];
            surface = around[at];
        }
        at += 1;
    }
    if surface >= NO_SURFACE {
        surface = nearest;
        if surface >= NO_SURFACE {
            return NO_SURFACE;
        }
    }
    let (mut sum, mut share_sum) = (0.0, 0.0);
    at = 0;
    while at < 4 {
        if abs(around[at] - surface) <= jump {
            sum += shares[at] * around[at];
            share_sum += shares[at];
        }
        at += 1;
    }
    if share_sum > 0.0 { sum / share_sum } else { surface }
}

/// The field at a point, for a target whose relevance weights are `weights[view]`. `depths` are the maps of all views.
///
/// Occupancy is the hull's alpha times a logistic step of the weighted mean of truncated signed distances to the views'
/// surfaces (a view is ignored if the point lies far behind its surface). Colour is the weighted mean over the
/// views that see the point, with soft visibility by the distance behind their surfaces.
#[inline]
pub fn sample(
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    footprints: &[f32],
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    depths: &(impl Fetch<f32> + ?Sized),
    weights: &[f32],
    point_world: Vec3,
) -> Sample {
    let mut hull = 1.0;
    let mut containing = 0;
    let (mut distance_sum, mut distance_share) = (0.0, 0.0);
    let mut fusion = VisibleFusion::<3>::EMPTY;
    let mut least_behind = NO_SURFACE;
    let mut view = 0;
    while view < object.view_count as usize {
        let camera = views.fetch(view);
        let seen = camera.project(point_world);
        if seen.in_front {
            containing += u32::from(seen.in_image);
            let colour = look_up(&camera, texels, seen.x, seen.y);
            let alpha = colour[3];
            hull = min(alpha, hull);
            if hull < EMPTY_ALPHA {
                return EMPTY;
            }
            let weight = weights[view];
            if seen.in_image && weight > 0.0 {
                let footprint = footprints[view];
                let depth = depth_at(&camera, depths, seen.x, seen.y, JUMP * footprint);
                let distance = if depth < NO_SURFACE { (depth - seen.depth) / footprint } else { TRUNCATION };
                let behind = max(-distance, 0.0);
                least_behind = min(behind * footprint, least_behind);
                if behind < TRUNCATION {
                    let share = weight * (1.0 - behind / TRUNCATION);
                    distance_sum += share * min(distance, TRUNCATION);
                    distance_share += share;
                }
                let visibility = fade(behind / SEEN_BEHIND);
                let hidden = HIDDEN_SHARE / (1.0 + behind * behind);
                // Near a silhouette's edge a view's colour is mixed with the background.
                let share = weight * alpha * alpha * (visibility + hidden);
                fusion.add(&[colour[0] / alpha, colour[1] / alpha, colour[2] / alpha], share);
            }
        }
        view += 1;
    }
    if containing < object.least_containing || least_behind > DEEPEST * object.radius {
        return EMPTY;
    }
    let distance = if distance_share > 1.0e-4 { distance_sum / distance_share } else { -TRUNCATION };
    let inside = min(hull / FULL_ALPHA, 1.0);
    let occupancy = inside / (1.0 + exp((distance - SURFACE_OFFSET) / SURFACE_WIDTH));
    Sample { occupancy, colour: fusion.mean_or([0.0; 3]) }
}
