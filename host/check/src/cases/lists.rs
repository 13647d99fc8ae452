//! [`Kernel::CountMarked`], [`Kernel::SumCounts`], [`Kernel::ListMarked`] and [`Kernel::FindNonFinite`]: masks of all
//! densities over whole runs and parts of one, and numbers with infinity and NaN in any place. Whole numbers: exact.
//! Inputs are one longer than their count says: what lies behind must not be taken along.

use super::*;

/// Whole numbers.
const EXACT: Limits = Limits { tolerance: 0.0, least: 0.5 };
const REASON: &str = "whole numbers: exact";

/// Masks of nothing, of everything, and of some; the last element is not the end of a run.
fn masks(random: &mut Random, size: u32) -> Vec<Vec<u32>> {
    let mut mask = |share: f64, count: u32| -> Vec<u32> {
        (0..count).map(|_| if random.unit() < share { 1 + random.below(200) as u32 } else { 0 }).collect()
    };
    [(0.0, size), (1.0, size * RUN), (0.5, size * RUN / 2 + 3), (0.02, size * RUN - 1)]
        .map(|(share, count)| mask(share, count))
        .to_vec()
}

/// Clears every second mark, as 1 % of a mark is a mark.
fn unmark(mask: &mut [u32]) {
    mask.iter_mut().filter(|mark| **mark > 0).step_by(2).for_each(|mark| *mark = 0);
}

/// With a number behind the last.
fn longer<T>(mut values: Vec<T>, behind: T) -> Vec<T> {
    values.push(behind);
    values
}

/// `[run]`.
fn counts(mask: &[u32]) -> Vec<u32> {
    mask.chunks(RUN as usize).map(|run| run.iter().filter(|mark| **mark != 0).count() as u32).collect()
}

/// `[run]`, and the sum of all.
fn offsets(counts: &[u32]) -> Vec<u32> {
    let mut offsets = vec![0];
    counts.iter().for_each(|count| offsets.push(offsets[offsets.len() - 1] + count));
    offsets
}

/// The results, and zeros behind them.
fn exact(values: impl IntoIterator<Item = u32>, count: usize) -> Vec<Option<Bounded>> {
    let values = values.into_iter().chain(std::iter::repeat(0));
    decided(values.take(count).map(Bounded::from), 0)
}

impl Case for CountMarked {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("mask", |case| unmark(&mut case.mask))];

    fn inputs(seed: u64, size: u32) -> Vec<CountMarked> {
        let dispatch = |mask: Vec<u32>| CountMarked {
            element_count: mask.len() as u32,
            counts: Output::Zeros(mask.len().div_ceil(RUN as usize) + 1),
            mask: longer(mask, 1),
        };
        masks(&mut random(61, seed, size), size.min(120)).into_iter().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        exact(counts(&self.mask[..self.element_count as usize]), self.element_count() + 1)
    }
}

impl Case for SumCounts {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("counts", |case| case.counts.iter_mut().for_each(|count| *count = *count * 101 / 100))];

    fn inputs(seed: u64, size: u32) -> Vec<SumCounts> {
        let random = &mut random(62, seed, size);
        let dispatch = |run_count: u32| SumCounts {
            run_count,
            // Sums stay below 2^24, as far as f32 counts.
            counts: longer((0..run_count).map(|_| random.below(RUN as usize + 1) as u32).collect(), 7),
            offsets: Output::Zeros(run_count as usize + 2),
            total: Output::Zeros(2),
        };
        [size, 2 * size + 1].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let offsets = offsets(&self.counts[..self.run_count as usize]);
        let total = offsets.last().copied();
        [exact(offsets, self.run_count as usize + 2), exact(total, 2)].concat()
    }
}

impl Case for ListMarked {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("mask", |case| unmark(&mut case.mask)),
        ("offsets", |case| case.offsets.iter_mut().for_each(|offset| *offset = *offset * 99 / 100)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ListMarked> {
        let dispatch = |mask: Vec<u32>| ListMarked {
            element_count: mask.len() as u32,
            offsets: offsets(&counts(&mask)),
            list: Output::Zeros(mask.len() + 1),
            mask: longer(mask, 1),
        };
        masks(&mut random(63, seed, size), size.min(120)).into_iter().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let marks = self.mask.iter().zip(0..self.element_count);
        exact(marks.filter(|(mark, _)| **mark != 0).map(|(_, element)| element), self.mask.len())
    }
}

impl Case for FindNonFinite {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    // The largest numbers become infinite.
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("values", |case| increase(&mut case.values))];

    fn inputs(seed: u64, size: u32) -> Vec<FindNonFinite> {
        let random = &mut random(64, seed, size);
        let dispatch = |(value_count, share): (u32, f64)| {
            let mut value = |_| match random.unit() < share {
                true => [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(4)],
                false => [f32::MAX, f32::MIN, 0.0, -0.0, 1.0e-45, random.normal() as f32][random.below(6)],
            };
            let values = longer((0..value_count).map(&mut value).collect(), f32::NAN);
            let firsts = Output::Zeros(value_count.div_ceil(FINITE_RUN) as usize + 1);
            FindNonFinite { value_count, values, firsts }
        };
        let count = size.min(120) * FINITE_RUN;
        [(count, 0.0), (count - 1, 1.0e-3), (count / 2 + 1, 0.1), (size, 1.0)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let values = &self.values[..self.value_count as usize];
        let firsts = values.chunks(FINITE_RUN as usize).zip(0..).map(|(run, number)| {
            let first = run.iter().position(|value| !value.is_finite());
            // As f32 rounds it.
            let value = first.map_or(u32::MAX as f32 as f64, |first| (number * FINITE_RUN + first as u32).into());
            Bounded { value, error: 0.0 }
        });
        decided(firsts, 1)
    }
}
