//! Where along which rays to look, and what was seen there.

use super::Cpu;
use crate::kernels::light::Pixels;
use crate::kernels::rays::{RayKernels, Rays};
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::depths::{CoarseBlock, FineBlock, coarse_depth, draw_chance, fine_depth, merged_depth};
use viewfuse_core::rays::{CastBlock, RayPoint, cast_ray, place_point};
use viewfuse_core::wanted::{WantedBlock, is_wanted, weigh_sample};

/// Runs a kernel for every sample of every ray, rays in parallel; it gets ray, sample and where to write.
fn for_each_sample<T: Send>(
    ray_count: u32,
    sample_count: u32,
    values: &mut [T],
    kernel: impl Fn(u32, u32, &mut T) + Sync,
) {
    let sample_count = sample_count as usize;
    values[..ray_count as usize * sample_count].par_chunks_mut(sample_count.max(1)).enumerate().for_each(
        |(ray, values)| {
            for (value, sample) in values.iter_mut().zip(0..) {
                kernel(ray as u32, sample, value);
            }
        },
    );
}

impl RayKernels for Cpu {
    fn cast_rays(&self, block: &CastBlock, rays: &mut Rays<Self>) -> Result<(), Infallible> {
        let count = rays.count as usize;
        let pixels = rays.pixels[..count].par_iter();
        rays.rays[..count].par_iter_mut().zip(pixels).for_each(|(ray, pixel)| *ray = cast_ray(block, *pixel));
        Ok(())
    }

    fn coarse_depths(&self, block: &CoarseBlock, rays: &Rays<Self>, depths: &mut Vec<f32>) -> Result<(), Infallible> {
        for_each_sample(rays.count, block.sample_count, depths, |ray, sample, depth| {
            let ray = ray as usize;
            *depth = coarse_depth(&rays.rays[ray], rays.pixels[ray], sample, block);
        });
        Ok(())
    }

    fn draw_chances(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        chances: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        for_each_sample(rays.count, block.fine_count(), chances, |ray, sample, chance| {
            *chance = draw_chance(rays.pixels[ray as usize], sample, block);
        });
        Ok(())
    }

    fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        seen: &Vec<[f32; 2]>,
        pixels: &Pixels<Self>,
        chances: &Vec<[f32; 2]>,
        depths: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        for_each_sample(rays.count, block.fine_count(), depths, |ray, sample, depth| {
            let index = ray as usize;
            let chance = chances[index * block.fine_count() as usize + sample as usize];
            let seen = &seen[index * block.coarse_count as usize..];
            let (centre, opacity) = (pixels.depths[index], pixels.colours[index][3]);
            *depth = fine_depth(seen, &rays.rays[index], centre, opacity, chance, sample, block);
        });
        Ok(())
    }

    fn merge_depths(
        &self,
        block: &FineBlock,
        ray_count: u32,
        coarse: &Vec<f32>,
        fine: &Vec<f32>,
        merged: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (coarse_count, fine_count) = (block.coarse_count as usize, block.fine_count() as usize);
        let count = coarse_count + fine_count;
        merged[..ray_count as usize * count].par_chunks_mut(count).enumerate().for_each(|(ray, merged)| {
            let (coarse, fine) = (&coarse[ray * coarse_count..], &fine[ray * fine_count..]);
            for index in 0..count as u32 {
                let (depth, place) = merged_depth(coarse, fine, block.coarse_count, block.fine_count(), index);
                merged[place as usize] = depth;
            }
        });
        Ok(())
    }

    fn wanted_samples(
        &self,
        block: &WantedBlock,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        seen: &Vec<[f32; 2]>,
        wanted: &mut Vec<u32>,
    ) -> Result<(), Infallible> {
        for_each_sample(rays.count, block.sample_count, wanted, |ray, sample, wanted| {
            let index = ray as usize;
            let depth = depths[index * block.sample_count as usize + sample as usize];
            *wanted = u32::from(is_wanted(&seen[..], &rays.rays[index], depth, ray, rays.pixels[index], block));
        });
        Ok(())
    }

    fn place_points(
        &self,
        sample_count: u32,
        point_count: u32,
        samples: &Vec<u32>,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        points: &mut Vec<RayPoint>,
    ) -> Result<(), Infallible> {
        points[..point_count as usize].par_iter_mut().zip(samples).for_each(|(point, sample)| {
            *point = place_point(&rays.rays[..], &depths[..], sample_count, *sample);
        });
        Ok(())
    }

    fn weigh_samples(
        &self,
        sample_count: u32,
        ray_count: u32,
        samples: &Vec<[f32; 4]>,
        seen: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        let count = sample_count as usize;
        let rows = seen[..ray_count as usize * count].par_chunks_mut(count);
        rows.zip(samples.par_chunks(count)).for_each(|(seen, samples)| {
            let mut optical_depth = 0.0;
            for (seen, sample) in seen.iter_mut().zip(samples) {
                (*seen, optical_depth) = weigh_sample(optical_depth, sample[3]);
            }
        });
        Ok(())
    }
}
