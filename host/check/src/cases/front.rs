//! [`Kernel::PlaneOpacity`] and [`Kernel::FrontCost`]: surfaces that views have or see through, and random opacities.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, costs, opacities};
use crate::world::Numbers;

impl Case for PlaneOpacity {
    const LIMITS: Limits = Limits { tolerance: 2.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to a difference of disparities in \
        steps of a plane, under an exponential; undecided where a coordinate rounds to either of two pixels";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views[1].camera.intrinsics[0] *= 1.01),
        ("disparities", |case| increase(case.disparities.iter_mut().map(|[disparity, _]| disparity))),
        ("parameters", |case| case.block.disparity_step *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<PlaneOpacity> {
        let swept = Swept::new(seed, size);
        let volume = swept.volume();
        let Swept { frustum: block, views, disparities, .. } = swept;
        let opacities = Output::Zeros((volume.width * volume.height * volume.group_count) as usize);
        vec![PlaneOpacity { block, views, disparities, opacities }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let PlaneOpacity { block, views, disparities, .. } = self;
        let opacity = |element: usize| {
            let (pixel, group) = (element as u32 / block.group_count, element as u32 % block.group_count);
            sweep_oracle::plane_opacity(block, views, disparities, pixel, group)
        };
        map(self.element_count(), 4, opacity).into_iter().flatten().collect()
    }
}

impl Case for FrontCost {
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str =
        "a mean of at most nine opacities, a slope of 2.5 on it, a product, and a sum of costs below 1";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("opacities", |case| increase(case.opacities.iter_mut().step_by(2).flatten())),
        ("means", |case| increase(case.means.iter_mut().step_by(2).flatten())),
        ("parameters", |case| case.block.front_share *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<FrontCost> {
        let volume = Swept::new(seed, size).volume();
        let numbers = &mut Numbers::new(seed);
        let block = FrontBlock {
            width: volume.width,
            height: volume.height,
            group_count: volume.group_count,
            front_share: numbers.between(0.1, 0.2),
        };
        let means = costs(numbers, &volume);
        let opacities = opacities(numbers, &volume);
        vec![FrontCost { block, costs: Output::Zeros(means.len()), opacities, means }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let FrontCost { block, opacities, means, .. } = self;
        let cost = |pixel: usize| sweep_oracle::front_cost(block, opacities, means, pixel as u32);
        decided(map(self.element_count(), 16, cost).into_iter().flatten(), 0)
    }
}
