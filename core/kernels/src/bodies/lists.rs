//! Lists of samples, and whether numbers are finite.

use crate::compact;
use crate::finite;
use crate::store::Store;

/// How many elements of a run are marked.
#[inline]
pub fn count_marked(element_count: &u32, mask: &[u32], counts: &mut (impl Store<u32> + ?Sized), run: u32) {
    counts.store(run as usize, compact::marked_in_run(mask, *element_count, run));
}

/// Where all runs' parts of the list begin: there is one element.
#[inline]
pub fn sum_counts(
    run_count: &u32,
    counts: &[u32],
    offsets: &mut (impl Store<u32> + ?Sized),
    total: &mut (impl Store<u32> + ?Sized),
    _all: u32,
) {
    compact::run_offsets(counts, *run_count, |run, offset| {
        offsets.store(run, offset);
        total.store(0, offset);
    });
}

/// The part of the list that a run's marked elements are.
#[inline]
pub fn list_marked(
    element_count: &u32,
    mask: &[u32],
    offsets: &[u32],
    list: &mut (impl Store<u32> + ?Sized),
    run: u32,
) {
    compact::list_run(mask, offsets, *element_count, run, |place, element| list.store(place, element));
}

/// The first number of a run that is not finite.
#[inline]
pub fn find_non_finite(value_count: &u32, values: &[f32], firsts: &mut (impl Store<u32> + ?Sized), run: u32) {
    firsts.store(run as usize, finite::first_non_finite(values, *value_count, run));
}
