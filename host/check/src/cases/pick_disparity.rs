//! [`Kernel::PickDisparity`]: the second of a few views.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::Numbers;

impl Case for PickDisparity {
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a difference of costs in units of the temperature, under an exponential; the \
        quotient of two sums of these; the vertex of a parabola in steps of a plane; undecided where all three costs \
        are nearly equal";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("costs", |case| increase(case.costs.as_flattened_mut().iter_mut().step_by(2))),
        ("parameters", |case| case.block.disparity_step *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<PickDisparity> {
        let swept = Swept::new(seed, size);
        let mut block = FrustumBlock { camera: swept.views[1].camera, ..swept.frustum };
        // The map begins behind that of a smaller view.
        block.camera.first_texel = 5;
        let (width, height) = (block.camera.width, block.camera.height);
        let volume = CostBlock { width, height, ..swept.volume() };
        let disparities = Output::Zeros((block.camera.first_texel + width * height) as usize);
        vec![PickDisparity { block, costs: costs(&mut Numbers::new(seed), &volume), disparities }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let pick = |pixel: usize| sweep_oracle::pick_disparity(&self.block, &self.costs, pixel as u32);
        let before = vec![[Some(Bounded::ZERO); 2]; self.block.camera.first_texel as usize];
        before.into_iter().chain(map(self.element_count(), 16, pick)).flatten().collect()
    }
}
