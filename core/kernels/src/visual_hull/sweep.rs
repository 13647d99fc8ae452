//! Depth of a source's pixels: planes swept through the hull, colours compared with the other views.
//!
//! Costs are laid out `[row][column][plane]`, planes from near to far, for the band of rows being worked on. A cost is
//! a mean absolute difference of colour in `[0, MAX_DIFFERENCE]`; a negative one says that the place is outside the
//! hull.

use super::hull::{SWEPT_ALPHA, look_up};
use super::{NO_SURFACE, ObjectBlock, fade};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{abs, clamp, max, min};

/// Largest difference: larger ones are clamped to it.
pub const MAX_DIFFERENCE: f32 = 0.2;
/// Weight of an imaginary view that mismatches, so that a point that no other view confirms is not a match.
pub const NO_WITNESS: f32 = 0.02;
/// Spacing of the planes, in footprints of the source.
pub const PLANE_STEP: f32 = 2.0;
/// Most planes of a sweep.
pub const MAX_PLANES: u32 = 128;
/// Reach of the window over which costs are averaged, in pixels to each side.
pub const WINDOW_REACH: u32 = 2;
/// How far behind the entry into the hull planes are swept, in radii of the object: concavities are no deeper.
pub const SWEPT_BEHIND_ENTRY: f32 = 0.4;
/// Cost of lying behind the entry into the hull, per radius of the object: among equal matches the nearest.
pub const DEPTH_COST: f32 = 0.02;
/// Cost of differing from the neighbours' depths by one footprint...
pub const ROUGHNESS_COST: f32 = 0.01;
/// ... and the difference, in footprints, beyond which it grows no more: edges of the object are allowed.
pub const MAX_ROUGHNESS: f32 = 4.0;
/// How far behind another view's entry into the hull a point may be seen by it, in radii of the object.
pub const SEEN_BEHIND_ENTRY: f32 = 0.3;
/// The cost of a place outside the hull.
pub const OUTSIDE: f32 = -1.0;

/// One source's sweep, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SweepBlock {
    /// The source view.
    pub view: u32,
    /// Number of planes.
    pub plane_count: u32,
    /// First row of the band.
    pub first_row: u32,
    /// Rows in the band.
    pub row_count: u32,
    /// Depth of the front of the first plane's cell.
    pub near: f32,
    /// Distance of neighbouring planes in depth.
    pub plane_step: f32,
    /// A footprint of the source, world units.
    pub footprint: f32,
    /// Columns of the source.
    pub width: u32,
}

const _: () = assert!(size_of::<SweepBlock>() == 32);

impl SweepBlock {
    /// The sweep of `view` through the object's box, over all rows. A footprint is that at the middle of the box.
    pub fn new(object: &ObjectBlock, camera: &CameraBlock, view: u32) -> SweepBlock {
        let corners = object.corners();
        let (mut near, mut far) = (NO_SURFACE, 0.0);
        let mut corner = 0;
        while corner < 8 {
            let depth = camera.project(corners[corner]).depth;
            near = min(depth, near);
            far = max(depth, far);
            corner += 1;
        }
        // For a camera inside the box, planes start a hundredth of the object in front of it.
        near = max(near, 0.01 * object.radius);
        far = max(far, near + 0.01 * object.radius);
        let footprint = 0.5 * (near + far) / camera.intrinsics[0];
        let wanted = (far - near) / (PLANE_STEP * footprint);
        let plane_count = (clamp(wanted, 8.0, (MAX_PLANES - 1) as f32) as u32) + 1;
        SweepBlock {
            view,
            plane_count,
            first_row: 0,
            row_count: camera.height,
            near,
            plane_step: (far - near) / plane_count as f32,
            footprint,
            width: camera.width,
        }
    }

    /// Depth of a plane.
    #[inline]
    pub fn depth(&self, plane: u32) -> f32 {
        self.near + (plane as f32 + 0.5) * self.plane_step
    }
}

/// How badly the other views' colours match a source pixel's at the depth of a plane; see [`SweptPixel::match_cost`].
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn match_cost(
    object: &ObjectBlock,
    sweep: &SweepBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    entries: &(impl Fetch<f32> + ?Sized),
    pair_weights: &[f32],
    pixel: u32,
    plane: u32,
) -> f32 {
    let swept = SweptPixel::new(sweep, views, texels, entries, pixel);
    swept.match_cost(object, sweep, views, texels, entries, pair_weights, plane)
}

/// A source pixel that planes are swept through.
#[derive(Clone, Copy, Debug)]
pub struct SweptPixel {
    /// Its colour.
    colour: [f32; 3],
    /// The source's centre.
    origin: Vec3,
    /// Along its ray, 1 along the principal axis.
    direction: Vec3,
    /// Depth of entry into the hull.
    entry: f32,
}

impl SweptPixel {
    /// Pixel number `pixel` of the source's image.
    #[inline]
    pub fn new(
        sweep: &SweepBlock,
        views: &(impl Fetch<CameraBlock> + ?Sized),
        texels: &(impl Fetch<[f32; 4]> + ?Sized),
        entries: &(impl Fetch<f32> + ?Sized),
        pixel: u32,
    ) -> SweptPixel {
        let camera = views.fetch(sweep.view as usize);
        let texel = (camera.first_texel + pixel) as usize;
        let (column, row) = (pixel % camera.width, pixel / camera.width);
        SweptPixel {
            colour: straight(&texels.fetch(texel)),
            origin: camera.centre_world(),
            direction: camera.towards(column as f32 + 0.5, row as f32 + 0.5),
            entry: entries.fetch(texel),
        }
    }

    /// The first plane that may lie inside the hull, and one behind the last: all others are [`OUTSIDE`]. There is a
    /// margin of half a plane at either end, plus the planes within the rounding error of a depth, so that none is
    /// missed.
    #[inline]
    pub fn planes(&self, object: &ObjectBlock, sweep: &SweepBlock) -> (u32, u32) {
        let most = sweep.plane_count as f32;
        let margin = 0.5 + 4.0e-7 * (sweep.near / sweep.plane_step + most);
        let first = (self.entry - sweep.near) / sweep.plane_step - 1.0 - margin;
        let end = (self.entry + SWEPT_BEHIND_ENTRY * object.radius - sweep.near) / sweep.plane_step + 0.5 + margin;
        // Planes without spacing give NaN: then all of them.
        let end = if end < most { max(end, 0.0) } else { most };
        (clamp(first, 0.0, most) as u32, end as u32)
    }

    /// How badly the other views' colours match the pixel's at the depth of a plane: a mean of absolute differences,
    /// weighted by `pair_weights[view][other]` (how relevant the other view is to this one; 0 on the diagonal) and by
    /// how likely the other view sees the place. `entries` are the depths of entry into the hull of all views.
    ///
    /// [`OUTSIDE`] where the pixel shows background, or the place is outside the hull, in front of its ray's entry or
    /// too far behind it.
    #[inline]
    #[allow(clippy::too_many_arguments)]
    pub fn match_cost(
        &self,
        object: &ObjectBlock,
        sweep: &SweepBlock,
        views: &(impl Fetch<CameraBlock> + ?Sized),
        texels: &(impl Fetch<[f32; 4]> + ?Sized),
        entries: &(impl Fetch<f32> + ?Sized),
        pair_weights: &[f32],
        plane: u32,
    ) -> f32 {
        let depth = sweep.depth(plane);
        // Half a plane in front of the entry still touches the hull.
        let behind_entry = depth - self.entry;
        if behind_entry < -0.5 * sweep.plane_step || behind_entry > SWEPT_BEHIND_ENTRY * object.radius {
            return OUTSIDE;
        }
        let point = self.origin + self.direction * depth;
        let reach = 1.0 / (SEEN_BEHIND_ENTRY * object.radius);
        let (mut sum, mut share_sum) = (NO_WITNESS * MAX_DIFFERENCE, NO_WITNESS);
        let mut containing = 1;
        let mut other = 0;
        while other < object.view_count {
            let camera = views.fetch(other as usize);
            let seen = camera.project(point);
            if other != sweep.view && seen.in_front {
                let colour = look_up(&camera, texels, seen.x, seen.y);
                if colour[3] < SWEPT_ALPHA {
                    return OUTSIDE;
                }
                if seen.in_image {
                    containing += 1;
                    let weight = pair_weights[(sweep.view * object.view_count + other) as usize];
                    let entry = entries.fetch(camera.texel_at(seen.x, seen.y));
                    let share = weight * fade(max(seen.depth - entry, 0.0) * reach);
                    // For a view that does not see the point only the silhouette counts.
                    if share > 0.0 {
                        sum += share * min(mean_difference(&straight(&colour), &self.colour), MAX_DIFFERENCE);
                        share_sum += share;
                    }
                }
            }
            other += 1;
        }
        if containing < object.least_containing { OUTSIDE } else { sum / share_sum }
    }
}

/// Colour of a premultiplied texel. The divisor is kept away from 0; such texels are masked elsewhere.
#[inline]
fn straight(texel: &[f32; 4]) -> [f32; 3] {
    let inverse = 1.0 / max(texel[3], 1.0e-3);
    [texel[0] * inverse, texel[1] * inverse, texel[2] * inverse]
}

#[inline]
fn mean_difference(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (abs(a[0] - b[0]) + abs(a[1] - b[1]) + abs(a[2] - b[2])) * (1.0 / 3.0)
}

/// Sum and count of the costs inside the hull over the window's columns, at a pixel of the band (`pixel` counts from
/// the band's first) and a plane.
#[inline]
pub fn sum_row(sweep: &SweepBlock, costs: &[f32], pixel: u32, plane: u32) -> [f32; 2] {
    let width = sweep.width;
    let column = pixel % width;
    let first = pixel - min_u32(column, WINDOW_REACH);
    let last = pixel + min_u32(width - 1 - column, WINDOW_REACH);
    let (mut sum, mut count) = (0.0, 0.0);
    let mut at = first;
    while at <= last {
        let cost = costs[(at * sweep.plane_count + plane) as usize];
        if cost >= 0.0 {
            sum += cost;
            count += 1.0;
        }
        at += 1;
    }
    [sum, count]
}

/// Mean cost over the window from its rows' sums, at a pixel of the band and a plane; [`OUTSIDE`] where the pixel's own
/// cost is.
#[inline]
pub fn mean_column(sweep: &SweepBlock, costs: &[f32], row_sums: &[[f32; 2]], pixel: u32, plane: u32) -> f32 {
    if costs[(pixel * sweep.plane_count + plane) as usize] < 0.0 {
        return OUTSIDE;
    }
    let width = sweep.width;
    let row = pixel / width;
    let first = row - min_u32(row, WINDOW_REACH);
    let last = row + min_u32(sweep.row_count - 1 - row, WINDOW_REACH);
    let (mut sum, mut count) = (0.0, 0.0);
    let mut at = first;
    while at <= last {
        let [row_sum, row_count] = row_sums[((at * width + pixel % width) * sweep.plane_count + plane) as usize];
        sum += row_sum;
        count += row_count;
        at += 1;
    }
    // The pixel itself is in its window: the count is at least 1.
    sum / count
}

#[inline]
fn min_u32(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

/// Reach in pixels of the neighbours whose depths a pixel's should resemble.
pub const NEIGHBOUR_REACH: u32 = 2;
/// Where the neighbours are whose depths a pixel's should resemble: columns and rows.
const NEIGHBOURS: [[i32; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-2, -2], [2, -2], [-2, 2], [2, 2]];

/// Depth of a pixel of the band: of least cost, refined between planes by a parabola.
///
/// The window's mean cost gets a small penalty for lying behind the entry into the hull and, where `guess` holds depths
/// of the band from an earlier pass (an entry of [`NO_SURFACE`]: none), one for differing from the neighbours.
/// `entries` are those of the band. A pixel that no plane of the hull covers keeps its entry; one without an entry has
/// none.
#[inline]
pub fn pick_depth(
    object: &ObjectBlock,
    sweep: &SweepBlock,
    means: &[f32],
    entries: &(impl Fetch<f32> + ?Sized),
    guess: &(impl Fetch<f32> + ?Sized),
    pixel: u32,
) -> f32 {
    let entry = entries.fetch(pixel as usize);
    if entry >= NO_SURFACE {
        return NO_SURFACE;
    }
    let width = sweep.width;
    let (column, row) = ((pixel % width) as i32, (pixel / width) as i32);
    let mut around = [0.0; 8];
    let mut around_count = 0;
    let mut neighbour = 0;
    while neighbour < 8 {
        let (x, y) = (column + NEIGHBOURS[neighbour][0], row + NEIGHBOURS[neighbour][1]);
        if x >= 0 && y >= 0 && x < width as i32 && y < sweep.row_count as i32 {
            let depth = guess.fetch((y as u32 * width + x as u32) as usize);
            if depth < NO_SURFACE {
                around[around_count] = depth;
                around_count += 1;
            }
        }
        neighbour += 1;
    }
    let (mut best, mut best_plane) = (NO_SURFACE, 0);
    let (mut before_best, mut after_best) = (NO_SURFACE, NO_SURFACE);
    let mut previous = NO_SURFACE;
    let mut plane = 0;
    while plane < sweep.plane_count {
        let mean = means[(pixel * sweep.plane_count + plane) as usize];
        let mut cost = NO_SURFACE;
        if mean >= 0.0 {
            let depth = sweep.depth(plane);
            cost = mean + DEPTH_COST * max(depth - entry, 0.0) / object.radius;
            let mut roughness = 0.0;
            let mut at = 0;
            while at < around_count {
                roughness += min(abs(depth - around[at]) / sweep.footprint, MAX_ROUGHNESS);
                at += 1;
            }
            cost += ROUGHNESS_COST * roughness / max(around_count as f32, 1.0);
        }
        if plane == best_plane + 1 {
            after_best = cost;
        }
        if cost < best {
            best = cost;
            best_plane = plane;
            before_best = previous;
            after_best = NO_SURFACE;
        }
        previous = cost;
        plane += 1;
    }
    if best >= NO_SURFACE {
        return entry;
    }
    let mut offset = 0.0;
    if before_best < NO_SURFACE && after_best < NO_SURFACE {
        let curvature = before_best + after_best - 2.0 * best;
        if curvature > 1.0e-9 {
            offset = clamp(0.5 * (before_best - after_best) / curvature, -0.5, 0.5);
        }
    }
    sweep.depth(best_plane) + offset * sweep.plane_step
}
