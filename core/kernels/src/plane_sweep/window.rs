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
/// `costs[row][column][group][cost times weight, weight]`. `pixel` is counted in the image. From the middle outwards, the
/// smaller window first.
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

/// The cost of a group of planes at a pixel: the three windows' means, from `sums[row][column][group][window][2]`.
#[inline(always)]
pub fn window_cost(block: &WindowBlock, sums: &[Planes], pixel: u32, group: u32) -> Planes {
    let (column, row) = ((pixel % block.width) as i32, (pixel / block.width) as i32);
    let (width, height) = (block.width as i32, block.height as i32);
    let groups = block.group_count as usize;
    let at = |y: i32| 6 * ((y * width + column) as usize * groups + group as usize);
    let mut total = [0.0; PLANES];
    let mut window = 0;
    while window < 3 {
        let reach = block.reach[window] as i32;
        let (first, last) =
            (if row > reach { row - reach } else { 0 }, if row + reach < height { row + reach } else { height - 1 });
        let (left, right) = (
            if column > reach { column - reach } else { 0 },
            if column + reach < width { column + reach } else { width - 1 },
        );
        let area = ((last - first + 1) * (right - left + 1)) as f32;
        let mut cost = [0.0; PLANES];
        let mut weight = [0.0; PLANES];
        let mut y = first;
        while y <= last {
            add(&mut cost, &sums[at(y) + 2 * window]);
            add(&mut weight, &sums[at(y) + 2 * window + 1]);
            y += 1;
        }
        let prior = PRIOR_WEIGHT * area;
        let mut plane = 0;
        while plane < PLANES {
            total[plane] += SHARE[window] * ((cost[plane] + prior * PRIOR_COST) / (weight[plane] + prior));
            plane += 1;
        }
        window += 1;
    }
    let count = block.group_count as f32 * PLANES as f32;
    let mut plane = 0;
    while plane < PLANES {
        total[plane] += block.near_cost * ((group as f32 * PLANES as f32 + plane as f32) / count);
        plane += 1;
    }
    total
}

#[inline(always)]
fn add(sum: &mut Planes, more: &Planes) {
    let mut plane = 0;
    while plane < PLANES {
        sum[plane] += more[plane];
        plane += 1;
    }
}
