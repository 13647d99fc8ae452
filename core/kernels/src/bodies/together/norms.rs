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
/// Where their shares begin, two numbers a part.
const SHARES: usize = 2 * GROUPS as usize;
/// Where they begin, `[part][group]`, mean and squared deviations.
const PARTIALS: usize = SHARES + 2 * STAGED as usize;
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
    let count = if thread < pixels { channels } else { 0 };
    let pixel = first + thread * block.in_pitch;
    // Nearer to the mean than 0 is, wherever the group lies.
    let value = inputs.fetch(first as usize);
    let mut sum = 0.0;
    let mut channel = 0;
    while channel < count {
        sum += inputs.fetch((pixel + channel) as usize) - value;
        channel += 1;
    }
    let mean = value + sum_of_all(&mut group, 0, thread, sum) / (pixels * channels) as f32;
    let mut squares = 0.0;
    let mut channel = 0;
    while channel < count {
        let difference = inputs.fetch((pixel + channel) as usize) - mean;
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
    let start = run * RUN;
    let end = (start + RUN).min(block.output_count());
    // Nearly always all groups at once. All invocations see the same here, so all come to the barriers.
    let mut first = 0;
    while first < block.group_count {
        let count = GROUPS.min(block.group_count - first);
        merge_parts(block, partials, &mut group, thread, [first, count]);
        group.wait();
        let mut element = start + thread;
        while element < end {
            let value = |more: u32| {
                let element = (element + more * WORKGROUP).min(end - 1);
                let place = block.group_of(element).wrapping_sub(first);
                let statistics = get_pair(&group, 2 * (if place < count { place } else { 0 }) as usize);
                group_norm_element(inputs, statistics, weights, bias, block, element as usize)
            };
            // Four at a time, so that none is waited for alone, and only then stored.
            let [a, b, c, d] = [value(0), value(1), value(2), value(3)];
            let mut store = |more: u32, value: f32| {
                let element = element + more * WORKGROUP;
                if element < end && block.group_of(element).wrapping_sub(first) < count {
                    outputs.store(element as usize, value);
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

/// Merges the parts of `count` groups from `first` on, and leaves mean and factor of each in the workgroup's memory.
/// What a part weighs is computed for all groups at once: a division for each part would be most of the time.
#[inline(always)]
fn merge_parts(
    block: &GroupNormBlock,
    partials: &impl Fetch<[f32; 2]>,
    group: &mut impl Workgroup,
    thread: u32,
    [first, count]: [u32; 2],
) {
    // An invocation without a group goes along with the last one.
    let member = thread.min(count - 1);
    let mut merged = MergedParts::before(partials.fetch((first + member) as usize));
    let mut part = 0;
    while part < block.part_count() {
        let parts = STAGED.min(block.part_count() - part);
        if thread < parts {
            put_pair(group, SHARES + 2 * thread as usize, block.share_of(part + thread));
        }
        let total = parts * count;
        let mut index = thread;
        while index < total {
            let fetch = |more: u32| {
                let index = (index + more * WORKGROUP).min(total - 1);
                partials.fetch(((part + index / count) * block.group_count + first + index % count) as usize)
            };
            // Eight at a time: none is waited for alone.
            let [a, b, c, d] = [fetch(0), fetch(1), fetch(2), fetch(3)];
            let [e, f, g, h] = [fetch(4), fetch(5), fetch(6), fetch(7)];
            let mut put = |more: u32, statistics: [f32; 2]| {
                let index = index + more * WORKGROUP;
                if index < total {
                    put_pair(group, PARTIALS + 2 * index as usize, statistics);
                }
            };
            put(0, a);
            put(1, b);
            put(2, c);
            put(3, d);
            put(4, e);
            put(5, f);
            put(6, g);
            put(7, h);
            index += 8 * WORKGROUP;
        }
        group.wait();
        let mut staged = 0;
        while staged < parts {
            let share = get_pair(group, SHARES + 2 * staged as usize);
            merged.add(share, get_pair(group, PARTIALS + 2 * (staged * count + member) as usize));
            staged += 1;
        }
        group.wait();
        part += parts;
    }
    if thread < count {
        put_pair(group, 2 * thread as usize, merged.statistics(block));
    }
}

/// Puts two numbers into the workgroup's memory.
#[inline(always)]
fn put_pair(group: &mut impl Workgroup, place: usize, [first, second]: [f32; 2]) {
    group.put(place, first);
    group.put(place + 1, second);
}

/// Two numbers of the workgroup's memory.
#[inline(always)]
fn get_pair(group: &impl Workgroup, place: usize) -> [f32; 2] {
    [group.get(place), group.get(place + 1)]
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
