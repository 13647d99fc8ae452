//! [`Kernel::ConfirmDisparities`]: one of a few views by two others, and by none.

use super::*;
use crate::sweep_oracle;
use crate::swept::Swept;
use viewfuse_kernels::plane_sweep::consistency::ConfirmBlock;

/// Others that are asked.
const OTHERS: u32 = 2;

impl Case for ConfirmDisparities {
    const LIMITS: Limits = Limits { tolerance: 2.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to a difference of disparities in \
        steps of two planes, under a bell; undecided where a coordinate rounds to either of two pixels";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("others", |case| case.others[1..].iter_mut().for_each(|other| other.camera.intrinsics[0] *= 1.05)),
        ("disparities", |case| increase(case.disparities.iter_mut().map(|[disparity, _]| disparity))),
        ("parameters", |case| case.block.share *= 1.05),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ConfirmDisparities> {
        let Swept { views, disparities, .. } = Swept::new(seed, size);
        let block = ConfirmBlock {
            camera: views[1].camera,
            share: 0.5,
            first_other: 1,
            other_count: OTHERS,
            ..ConfirmBlock::default()
        };
        let others = [0, 2, 3].map(|view| views[view]).to_vec();
        let confirmed = Output::Zeros(disparities.len());
        let dispatch = |other_count: u32| ConfirmDisparities {
            block: ConfirmBlock { other_count, ..block },
            others: others.clone(),
            disparities: disparities.clone(),
            confirmed: confirmed.clone(),
        };
        [OTHERS, 0].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ConfirmDisparities { block, others, disparities, .. } = self;
        let confirmed = |pixel: usize| sweep_oracle::confirmed(block, others, disparities, pixel as u32);
        let (first, count) = (block.camera.first_texel as usize, self.element_count());
        let nothing = |count: usize| vec![[Some(Bounded::ZERO); 2]; count];
        let behind = nothing(disparities.len() - first - count);
        nothing(first).into_iter().chain(map(count, 16, confirmed)).chain(behind).flatten().collect()
    }
}
