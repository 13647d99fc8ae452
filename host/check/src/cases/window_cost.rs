//! [`Kernel::RowSums`] and [`Kernel::WindowCost`]: costs of a whole frustum, some of which weigh nothing.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::Numbers;
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_kernels::plane_sweep::window::row_sums;

/// Costs times weights, and weights.
fn weighted(seed: u64, size: u32) -> (WindowBlock, Vec<Planes>) {
    let swept = Swept::new(seed, size);
    let numbers = &mut Numbers::new(seed);
    // Windows that the image's border cuts off on one side, on both, or not at all.
    let block = WindowBlock { reach: [1, 3, 6], ..WindowBlock::new(&swept.frustum, 0.02) };
    let mut weighted = Vec::new();
    for mut cost in costs(numbers, &swept.volume()) {
        let mut weights = [0.0; PLANES];
        for (cost, weight) in cost.iter_mut().zip(&mut weights) {
            *weight = if numbers.between(0.0, 1.0) < 0.2 { 0.0 } else { numbers.between(0.1, 1.0) };
            *cost *= *weight;
        }
        weighted.extend([cost, weights]);
    }
    (block, weighted)
}

/// Pixel and group of planes of an element.
fn place(block: &WindowBlock, element: usize) -> (u32, u32) {
    (element as u32 / block.group_count, element as u32 % block.group_count)
}

impl Case for RowSums {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "at most thirteen additions of weights of at most 1";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("costs", |case| increase(case.costs.iter_mut().step_by(2).flatten()))];

    fn inputs(seed: u64, size: u32) -> Vec<RowSums> {
        let (block, costs) = weighted(seed, size);
        vec![RowSums { block, sums: Output::Zeros(3 * costs.len()), costs }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let sums = map(self.element_count(), 8, |element| {
            let (pixel, group) = place(&self.block, element);
            sweep_oracle::row_sums(&self.block, &self.costs, pixel, group)
        });
        decided(sums.into_iter().flatten().flatten(), 0)
    }
}

impl Case for WindowCost {
    const LIMITS: Limits = Limits { tolerance: 2.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "for each window at most thirteen additions of sums, and a quotient below 0.4";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("sums", |case| increase(case.sums.iter_mut().step_by(2).flatten())),
        ("parameters", |case| case.block.near_cost *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<WindowCost> {
        let (block, costs) = weighted(seed, size);
        let count = costs.len() / 2;
        let sum = |element| {
            let (pixel, group) = place(&block, element);
            row_sums(&block, &costs[..], pixel, group)
        };
        vec![WindowCost { block, sums: (0..count).flat_map(sum).flatten().collect(), means: Output::Zeros(count) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let means = map(self.element_count(), 8, |element| {
            let (pixel, group) = place(&self.block, element);
            sweep_oracle::window_cost(&self.block, &self.sums, pixel, group)
        });
        decided(means.into_iter().flatten(), 0)
    }
}
