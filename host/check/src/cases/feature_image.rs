//! [`Kernel::WeighFeatures`], [`Kernel::SumFeatures`] and [`Kernel::DenoiserInput`]: rays from 1 to 128 samples with
//! low, medium and high optical depths, inclusive and exclusive weights; their features; pictures with conditions.

use super::*;
use crate::volume_oracle;

type Kind = (u32, u32, f32, f64, f64);

/// Samples on a ray, features, length of the last sample, and the least and greatest optical depth of the others.
const KINDS: [Kind; 5] = [
    (1, 3, 0.5, 0.1, 2.0),
    (2, 1, 1.0e10, 1.0e-3, 1.0),
    (17, 16, 1.0e10, 1.0, 1.0e3),
    (64, 2, 0.01, 1.0e-3, 0.3),
    (128, 5, 1.0e10, 1.0e-5, 1.0e-2),
];

fn block(random: &mut Random, (sample_count, feature_count, last_length, ..): Kind) -> FeatureBlock {
    FeatureBlock {
        first_ray: 0,
        sample_count,
        feature_count,
        length_scale: random.range(0.3, 1.0) as f32,
        last_length,
        inclusive: random.below(2) as u32,
    }
}

impl Case for WeighFeatures {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of two exponentials, a \
        difference";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("raw", |case| increase(&mut case.raw)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.length *= 1.01)),
        ("parameters", |case| case.block.length_scale *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<WeighFeatures> {
        let random = &mut random(34, seed, size);
        let dispatch = |kind: Kind| {
            let block = block(random, kind);
            let (.., low, high) = kind;
            let (mut raw, mut points) = (Vec::new(), Vec::new());
            for _ in 0..size * block.sample_count {
                let length = random.log_range(1.0e-3, 0.1);
                // A tenth is empty, most of it with a density below 0.
                let density = match random.below(20) {
                    0 => 0.0,
                    1 => -random.unit(),
                    _ => random.log_range(low, high) / length,
                };
                raw.push(density as f32);
                raw.extend(numbers(block.feature_count as usize, || random.normal()));
                points.push(RayPoint { length: length as f32, ..RayPoint::default() });
            }
            let weights = Output::Zeros(points.len() + 1);
            WeighFeatures { block, ray_count: size, raw, points, weights }
        };
        KINDS.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let samples = self.block.sample_count as usize;
        let row_len = samples * (self.block.feature_count as usize + 1);
        let weights = map(self.ray_count as usize, 1, |ray| {
            let (raw, points) = (&self.raw[ray * row_len..][..row_len], &self.points[ray * samples..][..samples]);
            volume_oracle::weigh_features(raw, points, &self.block)
        });
        decided(weights.into_iter().flatten(), 1)
    }
}

impl Case for SumFeatures {
    const SEED_COUNT: u64 = 8;
    // Lengths are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str =
        "n + 2 units (2^-24) of the sum of magnitudes of n summands, each a product with a sum of two";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("weights", |case| increase(&mut case.weights)),
        ("fused", |case| increase(&mut case.fused)),
        ("raw", |case| increase(&mut case.raw)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<SumFeatures> {
        let random = &mut random(31, seed, size);
        let dispatch = |kind| {
            let block = FeatureBlock { first_ray: 3, ..block(random, kind) };
            let [samples, features] = [block.sample_count, block.feature_count].map(|count| count as usize);
            let ray_count = size.div_ceil(block.feature_count);
            let count = ray_count as usize * samples;
            SumFeatures {
                block,
                ray_count,
                // They sum to less than 1.
                weights: numbers(count, || random.unit() / samples as f64),
                fused: numbers(count * features, || random.normal()),
                raw: numbers(count * (features + 1), || random.normal()),
                summed: Output::Zeros((block.first_ray + ray_count) as usize * features + 1),
            }
        };
        KINDS.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let SumFeatures { block, weights, fused, raw, .. } = self;
        let [samples, features] = [block.sample_count, block.feature_count].map(|count| count as usize);
        let bounded = |index: usize| {
            let (ray, feature) = (index / features, index % features);
            // The ray's rows of so many numbers a sample.
            let part = |row: usize| ray * samples * row..(ray + 1) * samples * row;
            let (weights, fused) = (&weights[part(1)], &fused[part(features)]);
            volume_oracle::summed_feature(weights, fused, &raw[part(features + 1)], block, feature)
        };
        let before = vec![Bounded::ZERO; block.first_ray as usize * features];
        decided(before.into_iter().chain(map(self.element_count(), 16, bounded)), 1)
    }
}

impl Case for DenoiserInput {
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "one product";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("noisy", |case| increase(&mut case.noisy)),
        ("condition", |case| increase(&mut case.condition)),
        ("parameters", |case| case.block.scale *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<DenoiserInput> {
        let random = &mut random(32, seed, size);
        let dispatch = |[picture_channels, condition_channels]: [u32; 2]| {
            let pixel_count = size.div_ceil(picture_channels + condition_channels);
            let scale = random.log_range(1.0e-2, 2.0) as f32;
            DenoiserInput {
                block: DenoiserInputBlock { picture_channels, condition_channels, scale },
                pixel_count,
                // As noisy as pictures are at first.
                noisy: numbers((pixel_count * picture_channels) as usize, || 80.0 * random.normal()),
                condition: numbers((pixel_count * condition_channels) as usize, || random.normal()),
                inputs: Output::Zeros((pixel_count * (picture_channels + condition_channels)) as usize + 1),
            }
        };
        [[3, 16], [1, 1], [4, 1], [3, 33]].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let input = |element| volume_oracle::denoiser_input(&self.noisy, &self.condition, &self.block, element);
        decided((0..self.element_count()).map(input), 1)
    }
}
