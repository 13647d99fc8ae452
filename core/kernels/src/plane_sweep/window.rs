//! Costs averaged over square windows of three sizes, each mean over the points that are seen.

use super::frustum::FrustumBlock;
use super::{PLANES, Planes};
use bytemuck::{Pod, Zeroable};

/// The three windows, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WindowBlock {
    /// Columns of the frustum's image.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Groups of planes.
    pub group_count: u32,
    /// Reaches of the windows, in pixels to each side, from the smallest to the largest.
    pub reach: [u32; 3],
    /// Cost of the nearest plane relative to the farthest one.
    pub near_cost: f32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<WindowBlock>() == 32);

/// Reaches of the windows in an image 250 pixels wide.
pub const REACH: [f32; 3] = [1.0, 5.0, 12.0];
/// Shares of the windows.
pub const SHARE: [f32; 3] = [0.4, 0.3, 0.3];
/// The cost of a point that no two views see...
pub const PRIOR_COST: f32 = 0.15;
/// ... and its weight, where that of all pairs together is 1.
pub const PRIOR_WEIGHT: f32 = 0.02;

impl WindowBlock {
    /// Windows for a frustum.
    pub fn new(frustum: &FrustumBlock, near_cost: f32) -> WindowBlock {
        let (width, height) = (frustum.camera.width, frustum.camera.height);
        let longest = if width > height { width } else { height };
        let mut reach = [1; 3];
        let mut window = 0;
        while window < 3 {
            reach[window] = viewfuse_core::math::max(REACH[window] * longest as f32 / 250.0 + 0.5, 1.0) as u32;
            window += 1;
        }
        WindowBlock { width, height, group_count: frustum.group_count, reach, near_cost, padding: 0 }
    }
}

/// Sums over a row's parts of the three windows: `[window][cost times weight, weight]`, from
/// `costs[row][column][group][cost times weight, weight]`. `pixel` is counted in the image. From the middle outwards,
/// the smaller window first.
#[inline(always)]
pub fn row_sums(block: &WindowBlock, costs: &[Planes], pixel: u32, group: u32) -> [[Planes; 2]; 3] {
    let column = (pixel % block.width) as i32;
    let first = (pixel - pixel % block.width) as usize;
    let groups = block.group_count as usize;
    let at = |x: i32| 2 * ((first + x as usize) * groups + group as usize);
    let mut sums = [[costs[at(column)], costs[at(column) + 1]]; 3];
    let mut running = sums[0];
    let mut window = 0;
    let mut reach = 0;
    while window < 3 {
        while reach < block.reach[window] as i32 {
            reach += 1;
            if column - reach >= 0 {
                add(&mut running[0], &costs[at(column - reach)]);
                add(&mut running[1], &costs[at(column - reach) + 1]);
            }
            if column + reach < block.width as i32 {
                add(&mut running[0], &costs[at(column + reach)]);
                add(&mut running[1], &costs[at(column + reach) + 1]);
            }
        }
        sums[window] = running;
        window += 1;
    }
    sums
}

/// The rows of a window around a row, in two parts: `first..split` and `split..end`. Rows are counted in runs that are
/// as long as the window; `split` is where the run begins in which the window ends, so that each part reaches to an end
/// of its run, and neighbouring windows share the sums of it. At the image's lower border, where a window lies inside a
/// run, the second part is empty.
#[inline(always)]
pub fn rows_of_window(row: u32, height: u32, reach: u32) -> [u32; 3] {
    let first = less(row, reach);
    let end = if row + reach < height { row + reach + 1 } else { height };
    let split = (end - 1) - (end - 1) % (2 * reach + 1);
    [first, if first > split { end } else { split }, end]
}

/// A coordinate less a reach, or 0.
#[inline(always)]
#[expect(clippy::implicit_saturating_sub, reason = "rust-gpu does not compile saturating subtraction")]
fn less(at: u32, reach: u32) -> u32 {
    if at > reach { at - reach } else { 0 }
}

/// The cost of a group of planes at a pixel: the three windows' means, from `sums[row][column][group][window][2]`. Of
/// the rows of a window ([`rows_of_window`]) those of the first part are summed from the last to the first, those of
/// the second from the first to the last, then both parts.
#[inline(always)]
pub fn window_cost(block: &WindowBlock, sums: &[Planes], pixel: u32, group: u32) -> Planes {
    let (column, row) = (pixel % block.width, pixel / block.width);
    let mut total = [0.0; PLANES];
    let mut window = 0;
    while window < 3 {
        let rows = rows_of_window(row, block.height, block.reach[window]);
        let cost = sum_of_rows(block, sums, [column, group], 2 * window, rows);
        let weight = sum_of_rows(block, sums, [column, group], 2 * window + 1, rows);
        let prior = prior_weight(block, window, column, rows);
        let mut plane = 0;
        while plane < PLANES {
            total[plane] += SHARE[window] * ((cost[plane] + prior * PRIOR_COST) / (weight[plane] + prior));
            plane += 1;
        }
        window += 1;
    }
    add_near_cost(&mut total, block, group);
    total
}

/// The sum of number `part` of the sums over rows, at a column and group.
#[inline(always)]
fn sum_of_rows(
    block: &WindowBlock,
    sums: &[Planes],
    [column, group]: [u32; 2],
    part: usize,
    [first, split, end]: [u32; 3],
) -> Planes {
    let at = |row: u32| 6 * ((row * block.width + column) * block.group_count + group) as usize + part;
    let (mut before, mut after) = ([0.0; PLANES], [0.0; PLANES]);
    let mut row = split;
    while row > first {
        row -= 1;
        add(&mut before, &sums[at(row)]);
    }
    row = split;
    while row < end {
        add(&mut after, &sums[at(row)]);
        row += 1;
    }
    add(&mut before, &after);
    before
}

/// The weight of the prior in the window of a column and these rows: [`PRIOR_WEIGHT`] for each of its pixels.
#[inline(always)]
pub fn prior_weight(block: &WindowBlock, window: usize, column: u32, [first, _, end]: [u32; 3]) -> f32 {
    let reach = block.reach[window];
    let left = less(column, reach);
    let right = if column + reach < block.width { column + reach + 1 } else { block.width };
    PRIOR_WEIGHT * ((end - first) * (right - left)) as f32
}

/// Adds the cost of being near.
#[inline(always)]
pub fn add_near_cost(total: &mut Planes, block: &WindowBlock, group: u32) {
    let count = block.group_count as f32 * PLANES as f32;
    let mut plane = 0;
    while plane < PLANES {
        total[plane] += block.near_cost * ((group as f32 * PLANES as f32 + plane as f32) / count);
        plane += 1;
    }
}

/// Adds to each plane.
#[inline(always)]
pub fn add(sum: &mut Planes, more: &Planes) {
    let mut plane = 0;
    while plane < PLANES {
        sum[plane] += more[plane];
        plane += 1;
    }
}
