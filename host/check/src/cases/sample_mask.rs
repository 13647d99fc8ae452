//! [`Kernel::WeighSamples`] and [`Kernel::SampleMask`]: empty rays, and rays with low, medium and high optical depths;
//! masks by the weights of the ray itself and of the rays around it.

use super::composite::{KINDS, optical_depth};
use super::fine_depths::seen;
use super::*;
use crate::ray_inputs::ray;
use crate::ray_oracle;

/// Rays in front of the results.
const FIRST_RAY: u32 = 2;

impl Case for WeighSamples {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of the exponential, on \
        both sides of a sample";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("samples", |case| increase(case.samples.iter_mut().map(|sample| &mut sample[3])))];

    fn inputs(seed: u64, size: u32) -> Vec<WeighSamples> {
        let random = &mut random(11, seed, size);
        let dispatch = |(sample_count, low, high): (u32, f64, f64)| {
            // Some rays meet nothing at all.
            let ray = |random: &mut Random| {
                let is_empty = random.below(8) == 0;
                let sample = |random: &mut Random| if is_empty { 0.0 } else { optical_depth(random, low, high) };
                (0..sample_count).map(|_| [0.1, 0.2, 0.3, sample(random) as f32]).collect::<Vec<_>>()
            };
            let ray_count = size.div_ceil(4);
            WeighSamples {
                block: RaysBlock { sample_count, first_ray: FIRST_RAY },
                ray_count,
                samples: (0..ray_count).flat_map(|_| ray(random)).collect(),
                seen: Output::Zeros(((FIRST_RAY + ray_count) * sample_count) as usize),
            }
        };
        KINDS.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let sample_count = self.block.sample_count as usize;
        let rays = self.samples.chunks_exact(sample_count).flat_map(ray_oracle::weigh_samples);
        let before = vec![Bounded::ZERO; 2 * FIRST_RAY as usize * sample_count];
        decided(before.into_iter().chain(rays.flatten()), 0)
    }
}

fn mask(random: &mut Random, size: u32, (step, sample_count, part_count): (u32, u32, u32)) -> SampleMask {
    let ray_count = size.div_ceil(sample_count);
    let (width, height) = (9 + random.below(20) as u32, 9 + random.below(20) as u32);
    let nodes = |side: u32| if step == 0 { 0 } else { side.div_ceil(step) };
    let block = SampleMaskBlock {
        sample_count,
        part_count,
        least_share: random.log_range(1.0e-3, 0.5) as f32,
        termination: [-1.0, 0.0, random.log_range(1.0e-3, 0.5)][random.below(3)] as f32,
        least_opacity: [0.0, random.range(0.0, 0.5)][random.below(2)] as f32,
        step,
        seen_columns: nodes(width),
        seen_rows: nodes(height),
        width,
    };
    let rays: Vec<TargetRay> =
        (0..ray_count).map(|_| ray(random)).map(|ray| TargetRay { far: ray.far + 0.1, ..ray }).collect();
    let seen_count = if step == 0 { ray_count } else { block.seen_columns * block.seen_rows };
    let depth = |random: &mut Random, ray: &TargetRay| match random.below(20) {
        0 => ray.near,
        1 => ray.far,
        _ => random.range(f64::from(ray.near), f64::from(ray.far)) as f32,
    };
    SampleMask {
        block,
        ray_count,
        pixels: rays.iter().map(|_| random.below((width * height) as usize) as u32).collect(),
        depths: rays.iter().flat_map(|ray| vec![*ray; sample_count as usize]).map(|ray| depth(random, &ray)).collect(),
        seen: (0..seen_count).flat_map(|_| seen(random, part_count)).collect(),
        rays,
        mask: Output::Zeros((ray_count * sample_count) as usize),
    }
}

impl Case for SampleMask {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 0.5 };
    const REASON: &'static str = "yes or no, undecided where a sample lies on the border of a part or a share on its \
        threshold to within rounding";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("seen", |case| increase(case.seen.iter_mut().map(|[weight, _]| weight))),
        ("rays", |case| case.rays.iter_mut().for_each(|ray| ray.far *= 1.01)),
        ("pixels", |case| case.pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 99 / 100)),
        ("depths", |case| increase(&mut case.depths)),
        ("parameters", |case| case.block.least_share *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<SampleMask> {
        let random = &mut random(12, seed, size);
        let kinds =
            [(0, 96, 64), (0, 1, 1), (2, 32, 64), (3, 5, 17), (4, 64, 2), (0, 96, 64), (2, 32, 64), (4, 96, 64)];
        kinds.map(|kind| mask(random, 4 * size, kind)).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let SampleMask { block, seen, rays, pixels, depths, .. } = self;
        let mask = |index: usize| {
            let ray = index / block.sample_count as usize;
            let mask = ray_oracle::is_sampled(seen, &rays[ray], depths[index], ray as u32, pixels[ray], block);
            mask.map(|mask| Bounded::from(u32::from(mask)))
        };
        map(depths.len(), 64, mask)
    }
}
