//! Finds the first NaN or infinity among computed numbers on the device: it returns one index for a run of numbers.

use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::has_finite_bits;

/// Numbers of a run, which one invocation processes one after the other: so few that a GPU does not wait for it.
pub const FINITE_RUN: u32 = 256;

/// The result for a run without infinity and NaN, in place of an index.
pub const ALL_FINITE: u32 = u32::MAX;

/// The index of the first infinite or NaN number of run `run` of `values`, of which there are `value_count`;
/// [`ALL_FINITE`] if there is none.
#[inline]
pub fn first_non_finite(values: &(impl Fetch<f32> + ?Sized), value_count: u32, run: u32) -> u32 {
    let end = (run * FINITE_RUN + FINITE_RUN).min(value_count);
    let mut index = run * FINITE_RUN;
    while index < end {
        if !has_finite_bits(values.fetch(index as usize)) {
            return index;
        }
        index += 1;
    }
    ALL_FINITE
}
