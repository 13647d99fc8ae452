//! [`Kernel::CoarseDepths`] and [`Kernel::RandomDraws`]: functions of seeds, pixels and rays only.

use super::*;
use crate::ray_inputs::{pixels, ray};
use crate::ray_oracle;

fn change_pixels(pixels: &mut [u32]) {
    pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 101 / 100);
}

impl Case for CoarseDepths {
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a share of the interval: five roundings and a division, then its product and sum";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("rays", |case| case.rays.iter_mut().for_each(|ray| ray.far *= 1.01)),
        ("pixels", |case| change_pixels(&mut case.pixels)),
        ("parameters", |case| case.block.jitter *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CoarseDepths> {
        let random = &mut random(7, seed, size);
        let dispatch = |(sample_count, jitter): (u32, f32)| {
            let ray_count = size.div_ceil(sample_count);
            let seed = [random.below(1 << 32) as u32, random.below(1 << 32) as u32];
            let pixels = pixels(random, ray_count);
            CoarseDepths {
                block: CoarseBlock { seed, sample_count, jitter },
                ray_count,
                rays: (0..ray_count).map(|_| ray(random)).collect(),
                pixels,
                depths: Output::Zeros((ray_count * sample_count) as usize),
            }
        };
        [(1, 1.0), (7, 0.5), (64, 1.0), (64, 0.0)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let depths = |(ray, pixel): (&TargetRay, &u32)| {
            (0..self.block.sample_count)
                .map(|sample| ray_oracle::coarse_depth(ray, *pixel, sample, &self.block))
                .collect()
        };
        decided(self.rays.iter().zip(&self.pixels).flat_map::<Vec<_>, _>(depths), 0)
    }
}

impl Case for RandomDraws {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "an addition and a division; for normal numbers 2 ULP of the logarithm, 4.5 ULP of \
        the root, 9e-8 of the cosine, two roundings of its argument of up to a turn";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("pixels", |case| change_pixels(&mut case.pixels))];

    fn inputs(seed: u64, size: u32) -> Vec<RandomDraws> {
        let random = &mut random(8, seed, size);
        let dispatch = |(coarse_count, importance_count, depth_count): (u32, u32, u32)| {
            let ray_count = size.div_ceil(importance_count + depth_count);
            let seed = [random.below(1 << 32) as u32, random.below(1 << 32) as u32];
            let block = FineBlock { seed, coarse_count, importance_count, depth_count, ..FineBlock::default() };
            let draws = Output::Zeros((ray_count * block.fine_count()) as usize);
            RandomDraws { block, ray_count, pixels: pixels(random, ray_count), draws }
        };
        [(64, 16, 16), (64, 0, 3), (1, 1, 0), (17, 128, 5)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let draws = |pixel: &u32| -> Vec<_> {
            (0..self.block.fine_count()).flat_map(|index| ray_oracle::random_draw(*pixel, index, &self.block)).collect()
        };
        decided(self.pixels.iter().flat_map(draws), 0)
    }
}
