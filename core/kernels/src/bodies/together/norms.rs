//! Group norm by workgroups: a part of a group by one, a pixel an invocation; then runs of outputs, whose groups'
//! statistics lie in the workgroup's memory. And softmax, a row by a workgroup.

use crate::network::attend::{softmax_factor, softmax_summand, softmax_value};
use crate::network::group_norm::{GroupNormBlock, MergedParts, PART, RUN, group_norm_element};
use crate::rows::{SHARED_BYTES, WORKGROUP};
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::max;

/// Sums of a workgroup's numbers are those of so many parts, each in the order of its invocations.
const SUM_PARTS: u32 = 8;
/// Numbers of the workgroup's memory that a sum takes.
const SUM_SHARED: usize = (WORKGROUP + SUM_PARTS) as usize;
/// Numbers of the workgroup's memory that [`group_norm_partials`] takes: those of two sums.
pub const GROUP_NORM_PARTIALS_SHARED: usize = 2 * SUM_SHARED;
/// Numbers of the workgroup's memory that [`softmax_rows`] takes: those of a maximum and of a sum.
pub const SOFTMAX_ROWS_SHARED: usize = 2 * SUM_SHARED;
/// Groups whose statistics are in the workgroup's memory at a time, one an invocation.
const GROUPS: u32 = WORKGROUP;
/// Parts that are in the workgroup's memory at a time: merging is serial, and must not wait for each of them.
const STAGED: u32 = 16;
/// Where they begin, `[part][group]`, mean and squared deviations.
const PARTIALS: usize = 2 * GROUPS as usize;
/// Numbers of the workgroup's memory that [`group_norm`] takes.
pub const GROUP_NORM_SHARED: usize = PARTIALS + 2 * (STAGED * GROUPS) as usize;

const _: () = assert!(PART <= WORKGROUP && WORKGROUP.is_multiple_of(SUM_PARTS));
const _: () = assert!(4 * GROUP_NORM_PARTIALS_SHARED <= SHARED_BYTES && 4 * GROUP_NORM_SHARED <= SHARED_BYTES);

/// Mean and squared deviations of a group in a part of the image, invocation `invocation % 64` of the element
/// `invocation / 64`. An invocation sums the group's channels of a pixel, in their order.
#[inline(always)]
pub fn group_norm_partials(
    block: &GroupNormBlock,
    inputs: &impl Fetch<f32>,
    partials: &mut impl Store<[f32; 2]>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (element, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (pixels, channels) = (block.pixels_of(element / block.group_count), block.group_channels());
    let first = block.first_of(element);
    // An invocation without a pixel has no channels.
    let own_channels = if thread < pixels { channels } else { 0 };
    let own = first + thread * block.in_pitch;
    // Nearer to the mean than 0 is, wherever the group lies.
    let value = inputs.fetch(first as usize);
    let mut sum = 0.0;
    let mut channel = 0;
    while channel < own_channels {
        sum += inputs.fetch((own + channel) as usize) - value;
        channel += 1;
    }
    let mean = value + sum_of_all(&mut group, 0, thread, sum) / (pixels * channels) as f32;
    let mut squares = 0.0;
    let mut channel = 0;
    while channel < own_channels {
        let difference = inputs.fetch((own + channel) as usize) - mean;
        squares += difference * difference;
        channel += 1;
    }
    let deviations = sum_of_all(&mut group, SUM_SHARED, thread, squares);
    if thread == 0 {
        partials.store(element as usize, [mean, deviations]);
    }
}

/// The sum of all invocations' numbers, the same for each of them. It takes the workgroup's memory from `place` on,
/// which nothing else uses.
#[inline(always)]
fn sum_of_all(group: &mut impl Workgroup, place: usize, thread: u32, number: f32) -> f32 {
    joined(group, place, thread, number, |sum, next| sum + next)
}

/// All invocations' numbers, joined by an operation, as [`sum_of_all`].
#[inline(always)]
fn joined(
    group: &mut impl Workgroup,
    place: usize,
    thread: u32,
    number: f32,
    join: impl Fn(f32, f32) -> f32 + Copy,
) -> f32 {
    const OF_PART: usize = (WORKGROUP / SUM_PARTS) as usize;
    group.put(place + thread as usize, number);
    group.wait();
    let parts = place + WORKGROUP as usize;
    if thread < SUM_PARTS {
        let first = place + thread as usize * OF_PART;
        let mut of_part = group.get(first);
        let mut index = 1;
        while index < OF_PART {
            of_part = join(of_part, group.get(first + index));
            index += 1;
        }
        group.put(parts + thread as usize, of_part);
    }
    group.wait();
    let mut all = group.get(parts);
    let mut part = 1;
    while part < SUM_PARTS as usize {
        all = join(all, group.get(parts + part));
        part += 1;
    }
    all
}

/// A run of outputs, invocation `invocation % 64` of the run `invocation / 64`. The statistics are the body's, bit for
/// bit: an invocation merges the parts of a group in their order, from the workgroup's memory.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn group_norm(
    block: &GroupNormBlock,
    inputs: &impl Fetch<f32>,
    partials: &impl Fetch<[f32; 2]>,
    weights: &impl Fetch<f32>,
    bias: &impl Fetch<f32>,
    outputs: &mut impl Store<f32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (run, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (start, all) = (run * RUN, block.output_count());
    let end = if all - start < RUN { all } else { start + RUN };
    // Nearly always all groups at once. All invocations see the same here, so all come to the barriers.
    let mut first = 0;
    while first < block.group_count {
        let count = if block.group_count - first < GROUPS { block.group_count - first } else { GROUPS };
        // An invocation without a group goes along with the last one.
        let own = if thread < count { thread } else { count - 1 };
        let mut merged = MergedParts::before(partials.fetch((first + own) as usize));
        let mut part = 0;
        while part < block.part_count() {
            let parts = if block.part_count() - part < STAGED { block.part_count() - part } else { STAGED };
            let total = parts * count;
            let mut index = thread;
            while index < total {
                let own = |more: u32| if index + more < total { index + more } else { total - 1 };
                let fetch = |more: u32| {
                    let index = own(more * WORKGROUP);
                    partials.fetch(((part + index / count) * block.group_count + first + index % count) as usize)
                };
                // Four at a time: none is waited for alone. The last one may be put several times.
                let [a, b, c, d] = [fetch(0), fetch(1), fetch(2), fetch(3)];
                put(&mut group, own(0), a);
                put(&mut group, own(WORKGROUP), b);
                put(&mut group, own(2 * WORKGROUP), c);
                put(&mut group, own(3 * WORKGROUP), d);
                index += 4 * WORKGROUP;
            }
            group.wait();
            let mut staged = 0;
            while staged < parts {
                let place = PARTIALS + 2 * (staged * count + own) as usize;
                merged.add(block, part + staged, [group.get(place), group.get(place + 1)]);
                staged += 1;
            }
            group.wait();
            part += parts;
        }
        if thread < count {
            let [mean, factor] = merged.statistics(block);
            group.put(2 * thread as usize, mean);
            group.put(2 * thread as usize + 1, factor);
        }
        group.wait();
        let mut element = start + thread;
        while element < end {
            let own = |more: u32| element + more * WORKGROUP;
            let value = |more: u32| {
                let element = if own(more) < end { own(more) } else { end - 1 };
                let place = block.group_of(element).wrapping_sub(first);
                let place = 2 * (if place < count { place } else { 0 }) as usize;
                let statistics = [group.get(place), group.get(place + 1)];
                group_norm_element(inputs, statistics, weights, bias, block, element as usize)
            };
            // Four at a time, too, and only then stored.
            let [a, b, c, d] = [value(0), value(1), value(2), value(3)];
            let mut store = |more: u32, value: f32| {
                if own(more) < end && block.group_of(own(more)).wrapping_sub(first) < count {
                    outputs.store(own(more) as usize, value);
                }
            };
            store(0, a);
            store(1, b);
            store(2, c);
            store(3, d);
            element += 4 * WORKGROUP;
        }
        group.wait();
        first += GROUPS;
    }
}

/// Puts a part's statistics into the workgroup's memory.
#[inline(always)]
fn put(group: &mut impl Workgroup, index: u32, [mean, deviations]: [f32; 2]) {
    let place = PARTIALS + 2 * index as usize;
    group.put(place, mean);
    group.put(place + 1, deviations);
}

/// A row of softmax, invocation `invocation % 64` of the row `invocation / 64`, which takes every 64th column.
#[inline(always)]
pub fn softmax_rows(
    column_count: &u32,
    scores: &impl Fetch<f32>,
    weights: &mut impl Store<f32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (row, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (first, end) = (row * column_count + thread, row * column_count + column_count);
    let mut largest = -f32::MAX;
    let mut at = first;
    while at < end {
        largest = max(scores.fetch(at as usize), largest);
        at += WORKGROUP;
    }
    let largest = joined(&mut group, 0, thread, largest, |largest, next| max(next, largest));
    let mut sum = 0.0;
    let mut at = first;
    while at < end {
        sum += softmax_summand(scores.fetch(at as usize), largest);
        at += WORKGROUP;
    }
    let scale = [largest, softmax_factor(sum_of_all(&mut group, SUM_SHARED, thread, sum))];
    let mut at = first;
    while at < end {
        weights.store(at as usize, softmax_value(scores.fetch(at as usize), scale));
        at += WORKGROUP;
    }
}
