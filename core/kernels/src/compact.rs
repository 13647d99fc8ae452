//! Stream compaction: from a mask over elements to the list of those that it marks, in order, so that the list never
//! leaves the device. Three kernels without atomics: count what each run of elements marks, sum the counts, write the
//! list.

use viewfuse_core::fetch::Fetch;

/// Elements of a run, which one invocation processes.
pub const RUN: u32 = 256;

/// The first element of a run, and the one behind its last.
#[inline]
fn ends(element_count: u32, run: u32) -> (u32, u32) {
    (run * RUN, (run * RUN + RUN).min(element_count))
}

/// How many elements of a run `mask[element]` marks: every value but 0 marks. The last run may be shorter than [`RUN`].
#[inline]
pub fn marked_in_run(mask: &(impl Fetch<u32> + ?Sized), element_count: u32, run: u32) -> u32 {
    let (mut element, end) = ends(element_count, run);
    let mut count = 0;
    while element < end {
        count += u32::from(mask.fetch(element as usize) != 0);
        element += 1;
    }
    count
}

/// Where each run's part of the list begins, `write(run, offset)` in order, and at last, as one run more, its length:
/// sums of `counts[run]`.
#[inline]
pub fn run_offsets(counts: &(impl Fetch<u32> + ?Sized), run_count: u32, mut write: impl FnMut(usize, u32)) {
    let (mut run, mut offset) = (0, 0);
    while run < run_count as usize {
        write(run, offset);
        offset += counts.fetch(run);
        run += 1;
    }
    write(run, offset);
}

/// A run's part of the list, `write(place, element)` in order, from `offsets[run]` on.
#[inline]
pub fn list_run(
    mask: &(impl Fetch<u32> + ?Sized),
    offsets: &(impl Fetch<u32> + ?Sized),
    element_count: u32,
    run: u32,
    mut write: impl FnMut(usize, u32),
) {
    let (mut element, end) = ends(element_count, run);
    let mut place = offsets.fetch(run as usize) as usize;
    while element < end {
        if mask.fetch(element as usize) != 0 {
            write(place, element);
            place += 1;
        }
        element += 1;
    }
}
