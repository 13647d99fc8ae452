//! [`Kernel::CopyNumbers`], [`Kernel::MultiplyAdd`], [`Kernel::RepeatProduct`] and [`Kernel::LookUpTexels`]: numbers of
//! all sizes; chains that tend to one number and chains that tend to 0, also without a round; products within a tile,
//! of one and beyond it, once, often and not at all; images of one row, of one column and larger ones.

use super::*;
use crate::camera_oracle::{bilinear, tents};
use viewfuse_kernels::limits::{CHAINS, LOOK_UP_STEP, LOOK_UPS, REPEATED, ROUND_STEPS};

impl Case for CopyNumbers {
    const SEED_COUNT: u64 = 2;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-30, least: 1.0e-30 };
    const REASON: &'static str = "a copy is exact";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("numbers", |case| increase(case.numbers.as_flattened_mut()))];

    fn inputs(seed: u64, size: u32) -> Vec<CopyNumbers> {
        let random = &mut random(60, seed, size);
        let all = numbers(4 * size as usize, || random.normal() * random.log_range(1.0e-30, 1.0e30));
        let copies = Output::Zeros(size as usize + 1);
        vec![CopyNumbers { element_count: size, numbers: all.as_chunks().0.to_vec(), copies }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        decided(self.numbers.as_flattened().iter().map(|number| Bounded::from(*number)), 4)
    }
}

impl Case for MultiplyAdd {
    const SEED_COUNT: u64 = 2;
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-3 };
    const REASON: &'static str = "running errors of products and sums, which a device may fuse, along the chains";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("starts", |case| increase(&mut case.starts)), ("parameters", |case| case.block.factor *= 1.01)];

    fn inputs(seed: u64, size: u32) -> Vec<MultiplyAdd> {
        let random = &mut random(61, seed, size);
        let dispatch = |(factor, summand, round_count)| MultiplyAdd {
            block: ChainBlock { factor, summand, round_count },
            element_count: size,
            starts: numbers(size as usize, || 10.0 * random.normal()),
            ends: Output::Zeros(size as usize + 1),
        };
        [(0.9, 0.1, 3), (0.98, 0.0, 2), (0.5, 1.0, 1), (0.7, 0.2, 0)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let (factor, summand) = (Bounded::from(self.block.factor), Bounded::from(self.block.summand));
        let sum = |start: &f32| {
            let chain = |number: u32| {
                let first = Bounded::from(*start) + Bounded::from(number as f32);
                (0..self.block.round_count * ROUND_STEPS).fold(first, |x, _| x * factor + summand)
            };
            (0..CHAINS).map(chain).fold(Bounded::ZERO, |sum, chain| sum + chain)
        };
        decided(self.starts.iter().map(sum), 1)
    }
}

impl Case for RepeatProduct {
    const SEED_COUNT: u64 = 2;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of magnitudes of n products, in whatever order they are \
        summed";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("left", |case| increase(&mut case.left)), ("right", |case| increase(&mut case.right))];

    fn inputs(seed: u64, size: u32) -> Vec<RepeatProduct> {
        let random = &mut random(63, seed, size);
        let awkward = 1 + random.below(100) as u32;
        let dispatch = |[row_count, column_count, round_count]: [u32; 3]| {
            let mut matrix = |count: u32| numbers((count * REPEATED) as usize, || random.normal());
            let (left, right) = (matrix(row_count), matrix(column_count));
            let sums = Output::Zeros((row_count * column_count) as usize + 1);
            RepeatProduct { block: RepeatedBlock { row_count, column_count, round_count }, left, right, sums }
        };
        [[1, 1, 1], [65, 7, 3], [64, 64, 2], [size.div_ceil(5), awkward, 1], [3, 130, 9], [5, 4, 0]]
            .map(dispatch)
            .to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let RepeatProduct { block: RepeatedBlock { row_count, column_count, round_count }, left, right, .. } = self;
        let (columns, inner) = (*column_count as usize, REPEATED as usize);
        let sum = |element: usize| {
            let (row, column) = (&left[element / columns * inner..][..inner], element % columns);
            let round = || row.iter().zip(right.iter().skip(column).step_by(columns));
            Bounded::sum((0..*round_count).flat_map(|_| round()).map(|(a, b)| f64::from(*a) * f64::from(*b)))
        };
        decided(map(*row_count as usize * columns, 16, sum), 1)
    }
}

impl Case for LookUpTexels {
    const SEED_COUNT: u64 = 2;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-3 };
    const REASON: &'static str = "rounding of the places, times the image's changes, and of the sums";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("texels", |case| increase(case.texels.as_flattened_mut()))];

    fn inputs(seed: u64, size: u32) -> Vec<LookUpTexels> {
        let random = &mut random(62, seed, size);
        let dispatch = |(width, height): (u32, u32)| LookUpTexels {
            block: LookUpBlock { width, height },
            element_count: size,
            texels: numbers(4 * (width * height) as usize, || random.normal()).as_chunks().0.to_vec(),
            sums: Output::Zeros(size as usize + 1),
        };
        [(1, 1), (1, 7), (5, 1), (11, 6)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let LookUpBlock { width, height } = self.block;
        let sum = |element: u32| {
            let (column, row) = (element % width, element / width % height);
            let rows = tents(Bounded::from(row as f32) + Bounded::from(0.625), height);
            let looked = |index: u32| {
                let step = Bounded::from(LOOK_UP_STEP) * Bounded::from(index as f32);
                let columns = tents(Bounded::from(column as f32) + Bounded::from(0.625) + step, width);
                let node = |channel: usize| {
                    let texels = &self.texels;
                    move |row: usize, column: usize| texels[row * width as usize + column][channel]
                };
                let [red, green, blue, alpha] = [0, 1, 2, 3].map(|channel| bilinear(node(channel), &columns, &rows));
                (red + green) + (blue + alpha)
            };
            (0..LOOK_UPS).map(looked).fold(Bounded::ZERO, |sum, looked| sum + looked)
        };
        decided((0..self.element_count).map(sum), 1)
    }
}
