//! [`Kernel::CompareViews`]: a band of a target's frustum, with silhouettes and with photographs.

use super::*;
use crate::sweep_oracle;
use crate::swept::Swept;
use crate::world::change_texels;

impl Case for CompareViews {
    const LIMITS: Limits = Limits { tolerance: 4.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "colours as a look-up (fifteen roundings of an image coordinate, times the image's \
        slope) over an alpha of at least 0.3; a disparity's error over two steps, times the bell's slope";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views[1].camera.intrinsics[0] *= 1.01),
        ("pairs", |case| case.pairs[0].weight *= 1.01),
        ("texels", |case| change_texels(&mut case.texels[case.views[1].camera.first_texel as usize..])),
        ("disparities", |case| increase(case.disparities.iter_mut().map(|[disparity, _]| disparity))),
        ("parameters", |case| case.block.disparity_step *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CompareViews> {
        let swept = Swept::new(seed, size);
        let band_len = swept.band_len();
        let Swept { frustum: block, views, pairs, texels, disparities } = swept;
        let grey = Output::Zeros(views.len() * band_len);
        vec![CompareViews { block, views, pairs, texels, disparities, grey, evidence: Output::Zeros(4 * band_len) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let CompareViews { block, views, pairs, texels, disparities, .. } = self;
        let first = block.first_row * block.camera.width;
        let found = map(self.element_count(), 1, |element| {
            let (pixel, group) = (element as u32 / block.group_count, element as u32 % block.group_count);
            sweep_oracle::evidence(block, views, pairs, texels, disparities, first + pixel, group)
        });
        let grey = (0..views.len()).flat_map(|view| found.iter().flat_map(move |found| found.grey[view]));
        let evidence = found.iter().flat_map(|found| found.evidence.as_flattened().iter().copied());
        grey.chain(evidence).collect()
    }
}
