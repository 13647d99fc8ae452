//! The nearer surface wins: how opaque planes are by the sources' own disparities, and a preference for the first
//! opaque plane of each ray.
//!
//! Most support alone would take a floor that five views see for the body before it that two see: both are surfaces. A
//! view whose surface lies before a point says nothing about it; one that sees through it contradicts it.

use super::evidence::planes_behind;
use super::frustum::{FrustumBlock, SweptView};
use super::{PLANES, Planes};
use crate::visual_hull::fade;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{clamp, max};

/// What a view that sees through a point counts, where one that has its surface there counts 1.
pub const SEEN_THROUGH: f32 = 0.3;
/// What counts for a transparent plane without any view, on the same scale.
pub const TRANSPARENT: f32 = 0.3;
/// From how many planes before a view's surface on the view sees through a point, in planes of the view's own sweep.
pub const FREE_PLANES: f32 = 1.5;
/// Opacity up to which a plane hides nothing...
pub const HIDES_NOTHING: f32 = 0.35;
/// ... and from which on it hides the most.
pub const HIDES_MOST: f32 = 0.75;
/// The most that a plane hides of those behind it.
pub const MAX_HIDDEN: f32 = 0.95;
/// A plane is hidden by those at least so many planes before it: nearer ones may be the same surface.
pub const GUARD: usize = 3;

/// A volume and the preference, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrontBlock {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Groups of planes, from 1 to [`MAX_GROUPS`](super::MAX_GROUPS).
    pub group_count: u32,
    /// Cost of a plane that is transparent or hidden.
    pub front_share: f32,
}

const _: () = assert!(size_of::<FrontBlock>() == 16);

/// Opacities in `[0, 1)` of a group of planes at a pixel: support over the sum of support, [`SEEN_THROUGH`] times
/// free-space violation, and [`TRANSPARENT`]. A view's support is its confidence times a bell of one plane around its
/// surface. All views count alike. `disparities[view's map][row][column]` are disparity and confidence.
#[inline(always)]
pub fn plane_opacity(
    frustum: &FrustumBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    pixel: u32,
    group: u32,
) -> Planes {
    let mut support = [0.0; PLANES];
    let mut violation = [0.0; PLANES];
    let mut slot = 0;
    while slot < frustum.view_count as usize {
        let view = &views.fetch(slot);
        if view.disparity_step > 0.0 {
            let track = frustum.track(&view.camera, pixel);
            let density = 1.0 / view.disparity_step;
            let mut plane = 0;
            while plane < PLANES {
                let disparity = frustum.disparity(group as usize * PLANES + plane);
                let seen = track.at(disparity);
                if seen.in_image {
                    let [surface, confidence] = disparities.fetch(view.map_texel(seen.x, seen.y));
                    let behind = planes_behind(surface, disparity * seen.disparity_ratio, density);
                    support[plane] += confidence * fade(0.707_106_77 * behind);
                    let free = max(-behind - FREE_PLANES, 0.0);
                    violation[plane] += confidence * (1.0 - fade(0.707_106_77 * free));
                }
                plane += 1;
            }
        }
        slot += 1;
    }
    opacity_of(&support, &violation)
}

/// Opacities of a group of planes from the views' support and free-space violation.
#[inline(always)]
pub fn opacity_of(support: &Planes, violation: &Planes) -> Planes {
    let mut opacity = [0.0; PLANES];
    let mut plane = 0;
    while plane < PLANES {
        opacity[plane] = support[plane] / (support[plane] + SEEN_THROUGH * violation[plane] + TRANSPARENT);
        plane += 1;
    }
    opacity
}

/// A ray that goes from the nearest group of planes to the farthest.
#[derive(Clone, Copy, Debug)]
pub struct Front {
    /// What each plane of the group before hides, or one before that.
    hides: Planes,
}

impl Front {
    /// Before the nearest group.
    pub const START: Front = Front { hides: [0.0; PLANES] };

    /// A pixel's costs of the next group of planes, `costs[pixel][group]`, with the preference added: `front_share`
    /// times 1 less the plane's opacity times the transmittance before it. The opacity is the mean over three by three
    /// pixels of `opacities[row][column][group]` (those in the image); the transmittance is 1 less what the most opaque
    /// plane hides of those at least [`GUARD`] planes before.
    #[inline(always)]
    pub fn advance(
        &mut self,
        block: &FrontBlock,
        opacities: &(impl Fetch<Planes> + ?Sized),
        costs: &(impl Fetch<Planes> + ?Sized),
        pixel: u32,
        group: u32,
    ) -> Planes {
        let here = mean_opacity(block, opacities, pixel, group);
        let before = self.hides;
        self.hides = most_hidden(&here, before[0]);
        let mut joined = costs.fetch((pixel * block.group_count + group) as usize);
        let mut plane = 0;
        while plane < PLANES {
            let at = plane + GUARD;
            let hidden = if at < PLANES { self.hides[at % PLANES] } else { before[at % PLANES] };
            joined[plane] += block.front_share * (1.0 - (1.0 - hidden) * here[plane]);
            plane += 1;
        }
        joined
    }
}

/// The most that a plane of a group hides or one before it, of these or, `before` the group, of others.
#[inline(always)]
fn most_hidden(opacities: &Planes, before: f32) -> Planes {
    let mut most = [0.0; PLANES];
    let mut plane = 0;
    while plane < PLANES {
        let hides = (opacities[plane] - HIDES_NOTHING) / (HIDES_MOST - HIDES_NOTHING);
        most[plane] = max(MAX_HIDDEN * clamp(hides, 0.0, 1.0), before);
        plane += 1;
    }
    // Of two planes, then of four, of eight, of all.
    let mut reach = 1;
    while reach < PLANES {
        let mut plane = 0;
        while plane + reach < PLANES {
            most[plane] = max(most[plane + reach], most[plane]);
            plane += 1;
        }
        reach *= 2;
    }
    most
}

/// Means of three by three pixels, row by row.
#[inline(always)]
fn mean_opacity(block: &FrontBlock, opacities: &(impl Fetch<Planes> + ?Sized), pixel: u32, group: u32) -> Planes {
    let (column, row) = (pixel % block.width, pixel / block.width);
    let first_row = if row > 0 { row - 1 } else { 0 };
    let last_row = if row + 1 < block.height { row + 1 } else { row };
    let first_column = if column > 0 { column - 1 } else { 0 };
    let last_column = if column + 1 < block.width { column + 1 } else { column };
    let mut sum = [0.0; PLANES];
    let mut y = first_row;
    while y <= last_row {
        let mut x = first_column;
        while x <= last_column {
            let there = opacities.fetch(((y * block.width + x) * block.group_count + group) as usize);
            let mut plane = 0;
            while plane < PLANES {
                sum[plane] += there[plane];
                plane += 1;
            }
            x += 1;
        }
        y += 1;
    }
    let inverse = 1.0 / ((last_row - first_row + 1) * (last_column - first_column + 1)) as f32;
    let mut plane = 0;
    while plane < PLANES {
        sum[plane] *= inverse;
        plane += 1;
    }
    sum
}
