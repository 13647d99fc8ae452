//! [`Kernel::FuseViews`]: sums over 1 to 32 views, also where the next view's latents lie further on than there are
//! elements, with the same weights everywhere or each point's own.

use super::*;
use crate::compositing_oracle::fuse_element;

impl Case for FuseViews {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition a view, two roundings each";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("weights", |case| case.weights[0] *= 1.01), ("latents", |case| case.latents[0] *= 1.01)];

    fn inputs(seed: u64, size: u32) -> Vec<FuseViews> {
        let random = &mut random(3, seed, size);
        // Views, channels of a point, whether points have their own weights and how far these are apart beyond need.
        let dispatch = |(view_count, channel_count, exact): (usize, u32, Option<usize>)| {
            let stride = size + random.below(3) as u32;
            let point_count = size.div_ceil(channel_count.max(1)) as usize;
            let weight_stride = exact.map_or(0, |beyond| view_count + beyond);
            let mut weights = numbers(view_count.max(point_count * weight_stride), || random.unit());
            for weights in weights.chunks_mut(weight_stride.max(view_count)) {
                let sum: f32 = weights[..view_count].iter().sum();
                weights.iter_mut().for_each(|weight| *weight /= sum);
            }
            FuseViews {
                block: FuseBlock {
                    view_count: view_count as u32,
                    stride,
                    channel_count,
                    weight_stride: weight_stride as u32,
                },
                element_count: size,
                weights,
                latents: numbers(stride as usize * view_count, || random.normal()),
                fused: Output::Zeros(size as usize),
            }
        };
        let shared = [1, 2, 3, 8, 15, 32].map(|view_count| (view_count, 0, None));
        let more = [(1, 1, Some(0)), (3, 64, Some(0)), (2, 7, Some(3)), (32, 5, Some(0)), (4, 512, None)];
        shared.into_iter().chain(more).map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let element = |element| fuse_element(&self.weights, &self.latents, &self.block, element);
        decided((0..self.element_count()).map(element), 0)
    }
}
