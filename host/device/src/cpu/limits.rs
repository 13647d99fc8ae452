//! What the CPU can do at most: copies, and chains in the widest vectors of the machine with fused steps, as its matrix
//! products compute. Its repeated products measure nothing: it has no matrix units.

use crate::parallel::{for_each_part, for_each_rows};
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, REPEATED, ROUND_STEPS, RepeatedBlock};

/// Fours of a part, 1 MiB.
const PART: usize = 1 << 16;
/// Elements of a part: a multiple of all vectors' lanes, and tens of microseconds, beside which handing it out takes no
/// time.
const ELEMENTS: usize = 1024;

pub(super) fn copy_numbers(element_count: u32, numbers: &[[f32; 4]], copies: &mut [[f32; 4]]) {
    for_each_rows(&mut copies[..element_count as usize], 1, PART, &|first, copies| {
        copies.copy_from_slice(&numbers[first..first + copies.len()]);
    });
}

pub(super) fn multiply_add(block: &ChainBlock, element_count: u32, starts: &[f32], ends: &mut [f32]) {
    for_each_part(&mut ends[..element_count as usize], ELEMENTS, &|part, ends| {
        let starts = &starts[part * ELEMENTS..][..ends.len()];
        Arch::new().dispatch(Chains { block, starts, ends });
    });
}

pub(super) fn repeat_product(block: &RepeatedBlock, left: &[f32], right: &[f32], sums: &mut [f32]) {
    let (columns, inner) = (block.column_count as usize, REPEATED as usize);
    let sums = &mut sums[..block.row_count as usize * columns];
    for_each_part(sums, columns.max(1), &|row, sums| {
        sums.fill(0.0);
        for _ in 0..block.round_count {
            for (factor, right) in left[row * inner..][..inner].iter().zip(right.chunks_exact(columns)) {
                sums.iter_mut().zip(right).for_each(|(sum, number)| *sum += factor * number);
            }
        }
    });
}

/// The chains of some elements, one in each lane.
struct Chains<'a> {
    block: &'a ChainBlock,
    starts: &'a [f32],
    ends: &'a mut [f32],
}

impl WithSimd for Chains<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Chains { block, starts, ends } = self;
        let (factor, summand) = (simd.splat_f32s(block.factor), simd.splat_f32s(block.summand));
        for (starts, ends) in starts.chunks(S::F32_LANES).zip(ends.chunks_mut(S::F32_LANES)) {
            let start = super::linear::load(simd, starts);
            let first = |chain: usize| simd.add_f32s(start, simd.splat_f32s(chain as f32));
            let mut chains: [S::f32s; CHAINS as usize] = std::array::from_fn(first);
            for _ in 0..block.round_count * ROUND_STEPS {
                for chain in &mut chains {
                    *chain = simd.mul_add_f32s(*chain, factor, summand);
                }
            }
            let sum = chains.into_iter().fold(simd.splat_f32s(0.0), |sum, chain| simd.add_f32s(sum, chain));
            super::linear::store(simd, ends, sum);
        }
    }
}
