//! [`Kernel::FineDepths`] and [`Kernel::MergeDepths`]: empty rays, low optical depths, an opaque surface, a few thin
//! surfaces.

use super::*;
use crate::ray_inputs::ray;
use crate::ray_oracle;

/// Weights and transmittances of a ray's parts.
pub(super) fn seen(random: &mut Random, part_count: u32) -> Vec<[f32; 2]> {
    let kind = random.below(5);
    let wall = random.below(part_count as usize);
    let mut transmittance = 1.0_f32;
    (0..part_count as usize)
        .map(|part| {
            let stopped = match kind {
                0 => 0.0,
                1 => f64::from(u8::from(part == wall)),
                2 => random.log_range(1.0e-6, 0.3),
                3 => random.unit() * f64::from(u8::from(random.below(8) == 0)),
                _ => random.unit() * f64::from(u8::from(part >= wall)),
            };
            let weight = transmittance * stopped as f32;
            let before = transmittance;
            transmittance -= weight;
            [weight, before]
        })
        .collect()
}

fn fine(random: &mut Random, size: u32, index: usize, counts: [u32; 3]) -> FineDepths {
    let [coarse_count, importance_count, depth_count] = counts;
    let block = FineBlock {
        coarse_count,
        importance_count,
        depth_count,
        depth_deviation: 0.05,
        depth_times_opacity: index as u32 % 2,
        ..FineBlock::default()
    };
    let fine_count = block.fine_count();
    let ray_count = size.div_ceil(fine_count);
    let rays: Vec<TargetRay> = (0..ray_count).map(|_| ray(random)).collect();
    // Opacity and depth of a ray's pixel. Some rays are empty, with any depth.
    let pixel = |random: &mut Random, ray: &TargetRay| {
        let depth = random.range(f64::from(ray.near), f64::from(ray.far)) as f32;
        if random.below(6) == 0 { [0.0, -7.0] } else { [random.unit() as f32, depth] }
    };
    let draw = |random: &mut Random, sample: u32| {
        if sample >= importance_count {
            return [random.normal() as f32, 0.0];
        }
        let first = [0.0, 1.0, random.unit(), random.unit(), random.unit()][random.below(5)];
        [first as f32, random.unit() as f32]
    };
    let seen = rays.iter().flat_map(|_| seen(random, coarse_count)).collect();
    let pixels: Vec<[f32; 2]> = rays.iter().map(|ray| pixel(random, ray)).collect();
    FineDepths {
        block,
        ray_count,
        seen,
        colours: pixels.iter().map(|[opacity, _]| [0.3, 0.6, 0.9, *opacity]).collect(),
        pixel_depths: pixels.iter().map(|[_, depth]| *depth).collect(),
        draws: rays.iter().flat_map(|_| 0..fine_count).map(|sample| draw(random, sample)).collect(),
        rays,
        depths: Output::Zeros((ray_count * fine_count) as usize),
    }
}

impl Case for FineDepths {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a place in a part: a division, a product, two sums; undecided where the random \
        number hits the border of a part to within the sums of weights";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("seen", |case| increase(case.seen.iter_mut().step_by(2).map(|[weight, _]| weight))),
        ("rays", |case| case.rays.iter_mut().for_each(|ray| ray.far *= 1.01)),
        ("colours", |case| increase(case.colours.iter_mut().map(|[.., opacity]| opacity))),
        ("pixel_depths", |case| increase(&mut case.pixel_depths)),
        ("draws", |case| increase(case.draws.iter_mut().map(|[first, _]| first))),
        ("parameters", |case| case.block.depth_deviation *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<FineDepths> {
        let random = &mut random(9, seed, size);
        let counts = [[64, 16, 16], [1, 2, 1], [17, 5, 0], [64, 0, 7]];
        counts.into_iter().enumerate().map(|(index, counts)| fine(random, size, index, counts)).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let FineDepths { block, seen, rays, colours, pixel_depths, draws, .. } = self;
        let (fine_count, coarse_count) = (block.fine_count() as usize, block.coarse_count as usize);
        map(draws.len(), 16, |index| {
            let (ray, sample) = (index / fine_count, index % fine_count);
            let seen = &seen[ray * coarse_count..][..coarse_count];
            let pixel = [pixel_depths[ray], colours[ray][3]];
            ray_oracle::fine_depth(seen, &rays[ray], pixel, draws[index], sample as u32, block)
        })
    }
}

impl Case for MergeDepths {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-2 };
    const REASON: &'static str = "the same numbers in order: exact";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("coarse", |case| case.coarse[0] *= 1.01), ("fine", |case| case.fine[0] *= 1.01)];

    fn inputs(seed: u64, size: u32) -> Vec<MergeDepths> {
        let random = &mut random(10, seed, size);
        let dispatch = |[coarse_count, importance_count, depth_count]: [u32; 3]| {
            let block = FineBlock { coarse_count, importance_count, depth_count, ..FineBlock::default() };
            let ray_count = size.div_ceil(coarse_count + block.fine_count());
            // Half of them on a lattice, so that many are equal, within a pass and between the two.
            let mut depth = || {
                let depth = random.range(1.0, 3.0);
                if random.below(2) == 0 { (depth * 16.0).round() / 16.0 } else { depth }
            };
            MergeDepths {
                block,
                ray_count,
                coarse: numbers((ray_count * coarse_count) as usize, &mut depth),
                fine: numbers((ray_count * block.fine_count()) as usize, &mut depth),
                merged: Output::Zeros((ray_count * (coarse_count + block.fine_count())) as usize),
            }
        };
        [[64, 16, 16], [1, 1, 0], [3, 0, 5], [128, 2, 0]].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let coarse = self.coarse.chunks_exact(self.block.coarse_count as usize);
        let fine = self.fine.chunks_exact(self.block.fine_count() as usize);
        decided(coarse.zip(fine).flat_map(|(coarse, fine)| ray_oracle::merge_depths(coarse, fine)), 0)
    }
}
