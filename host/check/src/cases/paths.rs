//! [`Kernel::FollowPaths`] and [`Kernel::JoinPaths`]: costs with a bent valley.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::Numbers;

/// Volumes of a seed behind one another, each of about `size` groups of planes.
fn volumes(seed: u64, size: u32, volume_count: usize) -> (CostBlock, Vec<Planes>) {
    let block = Swept::new(seed, size).volume();
    let numbers = &mut Numbers::new(seed);
    (block, (0..volume_count).flat_map(|_| costs(numbers, &block)).collect())
}

/// Increases the costs of every other group by 1 %.
fn increase_some(costs: &mut [Planes]) {
    increase(costs.iter_mut().step_by(2).flatten());
}

impl Case for FollowPaths {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 4.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "three roundings of costs below 0.5 a step; their differences among planes add up \
        along a line";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("means", |case| increase_some(&mut case.means))];

    fn inputs(seed: u64, size: u32) -> Vec<FollowPaths> {
        let (block, means) = volumes(seed, size, 1);
        vec![FollowPaths { block, paths: Output::Zeros(4 * means.len()), means }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let FollowPaths { block, means, .. } = self;
        let counts = [block.height, block.height, block.width, block.width].into_iter().zip(0..);
        let lines: Vec<(u32, u32)> =
            counts.flat_map(|(count, direction)| (0..count).map(move |number| (direction, number))).collect();
        let follow = |line: usize| sweep_oracle::follow_path(block, means, lines[line].0, lines[line].1);
        decided(map(lines.len(), 1, follow).into_iter().flatten(), 0)
    }
}

impl Case for JoinPaths {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "three additions of costs below 0.5, a quarter of their sum";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("paths", |case| increase_some(&mut case.paths))];

    fn inputs(seed: u64, size: u32) -> Vec<JoinPaths> {
        let (block, paths) = volumes(seed, size, 4);
        vec![JoinPaths { block, costs: Output::Zeros(paths.len() / 4), paths }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let groups = self.block.group_count;
        let joined = map(self.element_count(), 64, |element| {
            let (pixel, group) = (element as u32 / groups, element as u32 % groups);
            sweep_oracle::joined_cost(&self.block, &self.paths, pixel, group)
        });
        decided(joined.into_iter().flatten(), 0)
    }
}
