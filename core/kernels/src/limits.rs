//! What a device can do at most: kernels that only copy, that only multiply and add, numbers or matrices, and that only
//! look texels up. Rates of other kernels are compared with theirs.
//!
//! A chain is a number that is multiplied and added to again and again, `x = x * factor + summand`: each step needs the
//! one before, and nothing is read or written in between. An element has [`CHAINS`] of them, so that a device always
//! has one to go on with.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::bilinear_from;

/// Chains of an element.
pub const CHAINS: u32 = 12;
/// Steps of each chain in a round: the loop around them then takes no time.
pub const ROUND_STEPS: u32 = 8;

/// Inner indices of a product that is repeated: those of one matrix of a device's units.
pub const REPEATED: u32 = 16;

/// Look-ups of an element.
pub const LOOK_UPS: u32 = 16;
/// From one look-up of an element to the next, in pixels to the right: as planes of a sweep follow each other in a
/// view.
pub const LOOK_UP_STEP: f32 = 0.3;

/// A dispatch of [`looked_up`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct LookUpBlock {
    /// Columns of the image, at least 1.
    pub width: u32,
    /// Its rows, at least 1.
    pub height: u32,
}

/// A dispatch of [`chained`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ChainBlock {
    /// What a number is multiplied by, in `[0, 1)`: chains then stay finite and normal.
    pub factor: f32,
    /// What is added to the product.
    pub summand: f32,
    /// Rounds of [`ROUND_STEPS`] steps.
    pub round_count: u32,
}

/// The product of two matrices, added to the sums again and again, as plain data: `sums[row][column]` are
/// `left[row][inner]` times `right[inner][column]` of [`REPEATED`] inner indices, of all of them in their order and then
/// from the first one again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RepeatedBlock {
    /// Rows of the left matrix and of the sums.
    pub row_count: u32,
    /// Columns of the right matrix and of the sums.
    pub column_count: u32,
    /// How often the product is added.
    pub round_count: u32,
}

impl RepeatedBlock {
    /// Inner indices in all.
    pub const fn inner_count(&self) -> u32 {
        self.round_count * REPEATED
    }

    /// Whether the arrays lie in fours, as matrix units need them: all but the left matrix, which always does.
    pub const fn is_in_fours(&self) -> bool {
        self.column_count.is_multiple_of(4)
    }
}

/// The sum of an element's chains. Chain `i` starts at `start + i`; chains 0, 4, 8 are summed first, then those behind
/// them, then the four sums.
#[inline]
pub fn chained(block: &ChainBlock, start: f32) -> f32 {
    let (factor, summand) = (Vec4::splat(block.factor), Vec4::splat(block.summand));
    let mut a = Vec4::new(start, start + 1.0, start + 2.0, start + 3.0);
    let (mut b, mut c) = (a + Vec4::splat(4.0), a + Vec4::splat(8.0));
    let mut round = 0;
    while round < block.round_count {
        // One line a step.
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        (a, b, c) = (a * factor + summand, b * factor + summand, c * factor + summand);
        round += 1;
    }
    let all = a + b + c;
    all.x + all.y + all.z + all.w
}

/// The sum of all channels of [`LOOK_UPS`] bilinear look-ups in `texels[row][column]`, [`LOOK_UP_STEP`] apart, the
/// first one a little below and right of the corner of the pixel of the element's number, counted row by row and again
/// from the first one behind the last. Channels are summed first, in pairs.
#[inline(always)]
pub fn looked_up(block: &LookUpBlock, texels: &(impl Fetch<[f32; 4]> + ?Sized), element: u32) -> f32 {
    let (column, row) = (element % block.width, element / block.width % block.height);
    let y = row as f32 + 0.625;
    let mut sum = 0.0;
    let mut index = 0;
    while index < LOOK_UPS {
        let x = column as f32 + 0.625 + LOOK_UP_STEP * index as f32;
        let [red, green, blue, alpha] = bilinear_from(texels, 0, block.width, block.height, x, y);
        sum += (red + green) + (blue + alpha);
        index += 1;
    }
    sum
}

/// Four numbers of an array, unchanged.
#[inline]
pub fn copied(numbers: &(impl Fetch<[f32; 4]> + ?Sized), element: usize) -> [f32; 4] {
    numbers.fetch(element)
}
