//! Semi-global regularisation: a pixel's cost is aggregated with that of the previous pixels along a line, with a
//! penalty for changes of disparity.

use super::{MAX_GROUPS, PLANES, Planes, least_of, lessen};
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::min;

/// Cost of a step to a neighbouring plane.
pub const STEP_COST: f32 = 0.003;
/// Cost of a jump to any plane.
pub const JUMP_COST: f32 = 0.03;
/// Lines run right, left, down and up.
pub const DIRECTIONS: u32 = 4;
/// Lines that are followed together.
pub const LINES_TOGETHER: u32 = 8;

/// A volume of costs, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CostBlock {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Groups of planes.
    pub group_count: u32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<CostBlock>() == 16);

impl CostBlock {
    /// Number of lines in all directions.
    #[inline(always)]
    pub fn line_count(&self) -> u32 {
        2 * (self.width + self.height)
    }

    /// A line's direction, its number among those of the direction, and how many pixels it has. Directions are right,
    /// left, down, up.
    #[inline(always)]
    pub fn line(&self, line: u32) -> (u32, u32, u32) {
        if line < 2 * self.height {
            (line / self.height, line % self.height, self.width)
        } else {
            let vertical = line - 2 * self.height;
            (2 + vertical / self.width, vertical % self.width, self.height)
        }
    }

    /// Where a line begins in `paths[direction][line][step][group]`.
    #[inline(always)]
    pub fn first_of_line(&self, line: u32) -> usize {
        let (direction, number, step_count) = self.line(line);
        (direction * self.width * self.height + number * step_count) as usize * self.group_count as usize
    }

    /// The pixel of a line.
    #[inline(always)]
    pub fn pixel(&self, direction: u32, number: u32, step: u32) -> u32 {
        match direction {
            0 => number * self.width + step,
            1 => number * self.width + (self.width - 1 - step),
            2 => step * self.width + number,
            _ => (self.height - 1 - step) * self.width + number,
        }
    }

    /// Offset of a pixel's groups in `paths[direction][line][step][group]`.
    #[inline(always)]
    pub fn place(&self, direction: u32, column: u32, row: u32) -> usize {
        let (width, height) = (self.width, self.height);
        let at = match direction {
            0 => row * width + column,
            1 => row * width + (width - 1 - column),
            2 => column * height + row,
            _ => column * height + (height - 1 - row),
        };
        ((direction * width * height + at) * self.group_count) as usize
    }
}

/// The costs of a group of planes at a pixel, aggregated: `before` are the group's at the pixel before, `[left, right]`
/// those of the planes beside the group there (the greatest number where there is none), and `least` the least of all
/// planes.
#[inline(always)]
pub fn advanced(before: &Planes, cost: &Planes, [left, right]: [f32; 2], least: f32) -> Planes {
    let jump = least + JUMP_COST;
    let mut beside = [0.0; PLANES];
    beside[0] = min(left, before[1]);
    beside[PLANES - 1] = min(before[PLANES - 2], right);
    let mut plane = 1;
    while plane < PLANES - 1 {
        beside[plane] = min(before[plane - 1], before[plane + 1]);
        plane += 1;
    }
    let mut joined = [0.0; PLANES];
    plane = 0;
    while plane < PLANES {
        let reached = min(min(before[plane], beside[plane] + STEP_COST), jump);
        joined[plane] = cost[plane] + (reached - least);
        plane += 1;
    }
    joined
}

/// The state of a line: costs of the pixel before, and the least of them.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    costs: [Planes; MAX_GROUPS],
    least: f32,
}

impl Line {
    /// Before the first pixel.
    pub const START: Line = Line { costs: [[0.0; PLANES]; MAX_GROUPS], least: 0.0 };

    /// Advances to a pixel with these costs, `costs[first..][group]`; the aggregated ones are [`Line::costs`].
    #[inline(always)]
    pub fn advance(&mut self, costs: &(impl Fetch<Planes> + ?Sized), first: usize, group_count: usize) {
        let mut least = [f32::MAX; PLANES];
        // The last cost before this group's, of the pixel before.
        let mut left = f32::MAX;
        let mut group = 0;
        while group < group_count {
            let before = self.costs[group];
            let right = if group + 1 < group_count { self.costs[group + 1][0] } else { f32::MAX };
            self.costs[group] = advanced(&before, &costs.fetch(first + group), [left, right], self.least);
            lessen(&mut least, &self.costs[group]);
            left = before[PLANES - 1];
            group += 1;
        }
        self.least = least_of(&least);
    }

    /// The costs of a group of planes at the last pixel.
    #[inline(always)]
    pub fn costs(&self, group: usize) -> Planes {
        self.costs[group]
    }
}

/// The mean of the four directions' costs at a pixel: `paths[direction][line][step][group]`.
#[inline(always)]
pub fn joined_cost(block: &CostBlock, paths: &[Planes], pixel: u32, group: u32) -> Planes {
    let (column, row) = (pixel % block.width, pixel / block.width);
    let mut sum = [0.0; PLANES];
    let mut direction = 0;
    while direction < DIRECTIONS {
        let path = &paths[block.place(direction, column, row) + group as usize];
        let mut plane = 0;
        while plane < PLANES {
            sum[plane] += path[plane];
            plane += 1;
        }
        direction += 1;
    }
    let mut plane = 0;
    while plane < PLANES {
        sum[plane] *= 1.0 / DIRECTIONS as f32;
        plane += 1;
    }
    sum
}
