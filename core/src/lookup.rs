//! Interpolation in grids of `C` channels.
//!
//! Grids are `[row][column]`, flat, row-major, one `[f32; C]` a node. Coordinates are continuous with node centres at
//! halves (the image convention of [`crate::camera`]). Outside the outermost centres the border node's value is used; a
//! NaN coordinate counts as 0. An axis has at most 2^24 nodes. Grids shorter than the stated size are not allowed.

use crate::fetch::Fetch;
use crate::math::clamp;

/// One axis of a look-up among `count` nodes: the two nodes around a coordinate and the share of the second.
#[inline(always)]
pub fn split(coordinate: f32, count: u32) -> (usize, usize, f32) {
    let last = count as i32 - 1;
    let position = clamp(coordinate - 0.5, 0.0, last as f32);
    // Not negative: truncation is the floor.
    let lower = position as i32;
    let upper = if lower < last { lower + 1 } else { last };
    (lower as usize, upper as usize, position - lower as f32)
}

#[inline(always)]
fn mix<const C: usize>(a: &[f32; C], b: &[f32; C], share: f32) -> [f32; C] {
    let mut mixed = [0.0; C];
    let mut channel = 0;
    while channel < C {
        mixed[channel] = a[channel] + (b[channel] - a[channel]) * share;
        channel += 1;
    }
    mixed
}

/// Bilinear look-up in `grid[row][column]` of `height` rows and `width` columns, both at least 1. Columns are mixed
/// first, then rows.
#[inline]
pub fn bilinear<const C: usize>(
    grid: &(impl Fetch<[f32; C]> + ?Sized),
    width: u32,
    height: u32,
    x: f32,
    y: f32,
) -> [f32; C] {
    bilinear_from(grid, 0, width, height, x, y)
}

/// As [`bilinear`], in a grid whose first node is `grid[first]`: one of several in a buffer.
#[inline(always)]
pub fn bilinear_from<const C: usize>(
    grid: &(impl Fetch<[f32; C]> + ?Sized),
    first: usize,
    width: u32,
    height: u32,
    x: f32,
    y: f32,
) -> [f32; C] {
    let (left, right, share_x) = split(x, width);
    let (top, bottom, share_y) = split(y, height);
    let (top, bottom) = (first + top * width as usize, first + bottom * width as usize);
    mix(
        &mix(&grid.fetch(top + left), &grid.fetch(top + right), share_x),
        &mix(&grid.fetch(bottom + left), &grid.fetch(bottom + right), share_x),
        share_y,
    )
}

/// One channel of [`bilinear_from`], for half the work.
#[inline(always)]
pub fn bilinear_channel_from<const C: usize>(
    grid: &(impl Fetch<[f32; C]> + ?Sized),
    first: usize,
    width: u32,
    height: u32,
    x: f32,
    y: f32,
    channel: usize,
) -> f32 {
    let (left, right, share_x) = split(x, width);
    let (top, bottom, share_y) = split(y, height);
    let (top, bottom) = (first + top * width as usize, first + bottom * width as usize);
    let upper = grid.fetch(top + left)[channel]
        + (grid.fetch(top + right)[channel] - grid.fetch(top + left)[channel]) * share_x;
    let lower = grid.fetch(bottom + left)[channel]
        + (grid.fetch(bottom + right)[channel] - grid.fetch(bottom + left)[channel]) * share_x;
    upper + (lower - upper) * share_y
}
