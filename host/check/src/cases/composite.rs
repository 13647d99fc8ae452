//! [`Kernel::Composite`]: rays from 1 to 128 samples with low, medium and high optical depths; some samples are empty.

use super::*;
use crate::compositing_oracle::composite;

/// Samples on a ray, and the least and greatest optical depth of one.
pub(super) const KINDS: [(u32, f64, f64); 5] =
    [(1, 0.1, 2.0), (2, 1.0e-3, 1.0), (17, 1.0, 1.0e3), (64, 1.0e-3, 0.3), (128, 1.0e-5, 1.0e-2)];

/// An optical depth: a tenth is empty space, some of it with what rounding leaves below 0.
pub(super) fn optical_depth(random: &mut Random, low: f64, high: f64) -> f64 {
    match random.below(20) {
        0 => 0.0,
        1 => -random.unit(),
        _ => random.log_range(low, high),
    }
}

impl Case for Composite {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of the exponential, \
        each as far as what is seen changes there; depths as 1 / opacity";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("samples", |case| increase(&mut case.samples[0])),
        ("sample_depths", |case| case.sample_depths[0] *= 1.01),
        ("parameters", |case| case.block.background[1] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<Composite> {
        let random = &mut random(4, seed, size);
        let dispatch = |(sample_count, low, high): (u32, f64, f64)| {
            let count = size * sample_count;
            let first = numbers(size as usize, || random.range(1.0, 2.0));
            let depth = |index: u32| {
                first[(index / sample_count) as usize] + (index % sample_count) as f32 / sample_count as f32
            };
            let mut sample = |_| {
                let optical_depth = optical_depth(random, low, high);
                [random.unit(), random.unit(), random.unit(), optical_depth].map(|value| value as f32)
            };
            Composite {
                block: CompositeBlock { background: [1.0, 0.5, 0.25], empty_depth: 7.0, sample_count },
                ray_count: size,
                samples: (0..count).map(&mut sample).collect(),
                sample_depths: (0..count).map(depth).collect(),
                colours: Output::Zeros(size as usize),
                depths: Output::Zeros(size as usize),
            }
        };
        KINDS.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let count = self.block.sample_count as usize;
        let pixels = map(self.ray_count as usize, 16, |ray| {
            let samples = ray * count..(ray + 1) * count;
            composite(&self.samples[samples.clone()], &self.sample_depths[samples], &self.block)
        });
        let colours = pixels.iter().flat_map(|[red, green, blue, opacity, _]| [*red, *green, *blue, *opacity]);
        colours.chain(pixels.iter().map(|pixel| pixel[4])).collect()
    }
}
