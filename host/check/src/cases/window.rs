//! [`Kernel::SumRow`] and [`Kernel::MeanColumn`]: costs of a plausible sweep, a quarter of them outside the visual
//! hull.

use super::*;
use crate::hull_oracle;
use crate::world::{self, Numbers, World};
use viewfuse_kernels::visual_hull::sweep::sum_row;

fn band(seed: u64, size: u32) -> (SweepBlock, Vec<f32>) {
    let sweep = World::of_size(seed, size).sweep(0);
    let costs = world::costs(&mut Numbers::new(seed), sweep.row_count * sweep.width, sweep.plane_count);
    (sweep, costs)
}

/// Pixel and plane of an element.
fn place(sweep: &SweepBlock, element: usize) -> (u32, u32) {
    (element as u32 / sweep.plane_count, element as u32 % sweep.plane_count)
}

impl Case for SumRow {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "at most five additions of costs of at most 0.2";
    // All but those outside.
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("costs", |case| increase(case.costs.iter_mut().filter(|cost| **cost > 0.0)))];

    fn inputs(seed: u64, size: u32) -> Vec<SumRow> {
        let (block, costs) = band(seed, size);
        vec![SumRow { block, row_sums: Output::Zeros(costs.len()), costs }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let SumRow { block, costs, .. } = self;
        let sum = |element| {
            let (pixel, plane) = place(block, element);
            hull_oracle::sum_row(block, block.width, costs, pixel, plane)
        };
        map(self.element_count(), 64, sum).into_iter().flatten().collect()
    }
}

impl Case for MeanColumn {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "at most 25 additions of costs of at most 0.2, a division of 2.5 ULP";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        // What is outside the hull and what is not: the values themselves come in through the sums.
        ("costs", |case| case.costs.iter_mut().step_by(100).for_each(|cost| *cost = -*cost)),
        ("row_sums", |case| increase(case.row_sums.iter_mut().map(|[sum, _]| sum))),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<MeanColumn> {
        let (block, costs) = band(seed, size);
        let sum = |element| {
            let (pixel, plane) = place(&block, element);
            sum_row(&block, &costs, pixel, plane)
        };
        let row_sums = (0..costs.len()).map(sum).collect();
        vec![MeanColumn { block, row_sums, means: Output::Zeros(costs.len()), costs }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let MeanColumn { block, costs, .. } = self;
        map(self.element_count(), 16, |element| {
            let (pixel, plane) = place(block, element);
            hull_oracle::mean_column(block, block.width, costs, pixel, plane)
        })
    }
}
