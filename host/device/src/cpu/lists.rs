//! Lists of samples, and whether numbers are finite.

use crate::parallel::for_each;
use viewfuse_kernels::compact::{RUN, list_run, marked_in_run, run_offsets};
use viewfuse_kernels::finite::{FINITE_RUN, first_non_finite};

/// The fewest runs for a thread.
const MIN_RUNS: usize = 64;

pub(super) fn count_marked(element_count: &u32, mask: &[u32], counts: &mut [u32]) {
    for_each(&mut counts[..element_count.div_ceil(RUN) as usize], MIN_RUNS, |run, count| {
        *count = marked_in_run(mask, *element_count, run as u32);
    });
}

pub(super) fn sum_counts(run_count: &u32, counts: &[u32], offsets: &mut [u32], total: &mut [u32]) {
    run_offsets(counts, *run_count, |run, offset| {
        offsets[run] = offset;
        total[0] = offset;
    });
}

/// Runs one after the other: the length of a run's part of the list follows from its mask, and the work is copying only.
pub(super) fn list_marked(element_count: &u32, mask: &[u32], offsets: &[u32], list: &mut [u32]) {
    for run in 0..element_count.div_ceil(RUN) {
        list_run(mask, offsets, *element_count, run, |place, element| list[place] = element);
    }
}

pub(super) fn find_non_finite(value_count: &u32, values: &[f32], firsts: &mut [u32]) {
    for_each(&mut firsts[..value_count.div_ceil(FINITE_RUN) as usize], MIN_RUNS, |run, first| {
        *first = first_non_finite(values, *value_count, run as u32);
    });
}
