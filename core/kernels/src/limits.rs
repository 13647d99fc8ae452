//! What a device can do at most: kernels that only copy, and that only multiply and add. Rates of other kernels are compared
//! with theirs.
//!
//! A chain is a number that is multiplied and added to again and again, `x = x * factor + summand`: each step needs the one
//! before, and nothing is read or written in between. An element has [`CHAINS`] of them, so that a device always has one
//! to go on with.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use viewfuse_core::fetch::Fetch;

/// Chains of an element.
pub const CHAINS: u32 = 12;
/// Steps of each chain in a round: the loop around them then takes no time.
pub const ROUND_STEPS: u32 = 8;

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

/// Four numbers of an array, unchanged.
#[inline]
pub fn copied(numbers: &(impl Fetch<[f32; 4]> + ?Sized), element: usize) -> [f32; 4] {
    numbers.fetch(element)
}
