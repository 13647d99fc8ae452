//! [`Kernel::CastRays`] and [`Kernel::PlacePoints`]: rays of any camera with depths along them or along its axis,
//! points of some samples on some rays.

use super::*;
use crate::ray_inputs::{camera, ray};
use crate::ray_oracle;

impl Case for CastRays {
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "quotients of image coordinates by the focal length, three products with the axes, a \
        norm (1 where depths are along the axis) and a division by it";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("pixels", |case| case.pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 101 / 100)),
        ("parameters", |case| case.block.camera.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CastRays> {
        let random = &mut random(5, seed, size);
        let dispatch = |(pixel_centre, along_axis)| {
            let camera = camera(random);
            let (near, far) = (random.range(0.1, 1.0) as f32, random.range(1.0, 9.0) as f32);
            let pixel_count = (camera.width * camera.height) as usize;
            // One more than requested.
            let pixels = (0..size).map(|_| random.below(pixel_count) as u32).chain([0]).collect();
            CastRays {
                block: CastBlock { camera, near, far, pixel_centre, along_axis },
                ray_count: size,
                pixels,
                rays: Output::Zeros(size as usize + 1),
            }
        };
        [(0.5, 0), (0.0, 0), (0.5, 1), (0.25, 1)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let pixels = &self.pixels[..self.ray_count as usize];
        decided(pixels.iter().flat_map(|pixel| ray_oracle::cast_ray(&self.block, *pixel)), 8)
    }
}

impl Case for PlacePoints {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition a coordinate, a difference of depths";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("samples", |case| case.samples.iter_mut().flatten().for_each(|sample| *sample = *sample * 99 / 100)),
        ("rays", |case| case.rays.iter_mut().for_each(|ray| ray.direction[0] *= 1.01)),
        ("depths", |case| increase(case.depths.iter_mut().step_by(2))),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<PlacePoints> {
        let random = &mut random(6, seed, size);
        let dispatch = |(sample_count, has_samples): (u32, u32)| {
            let ray_count = size.div_ceil(sample_count) + 1;
            let rays: Vec<TargetRay> = (0..ray_count).map(|_| ray(random)).collect();
            let mut depths = Vec::new();
            for ray in &rays {
                let (near, far) = (f64::from(ray.near), f64::from(ray.far));
                // Two passes may have the same depth.
                let mut sorted: Vec<f32> = (0..sample_count)
                    .map(|_| if random.below(8) == 0 { ray.far } else { random.range(near, far) as f32 })
                    .collect();
                sorted.sort_by(f32::total_cmp);
                depths.extend(sorted);
            }
            let samples: Vec<u32> = (0..size).map(|_| random.below(depths.len()) as u32).collect();
            let first = (size / 3).min(size - 1);
            PlacePoints {
                block: PlaceBlock { sample_count, first, has_samples },
                point_count: size - first,
                samples: (has_samples != 0).then_some(samples),
                rays,
                depths,
                points: Output::Zeros((size - first) as usize + 1),
            }
        };
        // The last ones without a list.
        [(1, 1), (5, 1), (96, 1), (1, 0), (96, 0)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let PlaceBlock { sample_count, first, .. } = self.block;
        let sample = |index: u32| self.samples.as_ref().map_or(index, |samples| samples[index as usize]);
        let place = |index| ray_oracle::place_point(&self.rays, &self.depths, sample_count, sample(index));
        decided((first..first + self.point_count).flat_map(place), 8)
    }
}
