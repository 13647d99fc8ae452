//! From volumes to a feature image, and the denoiser's inputs.

use super::Cpu;
use crate::kernels::volumes::VolumeKernels;
use pulp::Arch;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::genvs::{
    DenoiserInputBlock, FeatureBlock, VolumeBlock, VolumePlace, denoiser_input, weigh_features,
};
use viewfuse_core::half::{fetch_half, packed_halves, word_count};
use viewfuse_core::rays::RayPoint;

/// Adds up what the eight nodes around each point have: `add(first, weight, gathered)` adds the features of the node whose
/// first one is number `first` of the volume.
fn gather_nodes(
    block: &VolumeBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    gathered: &mut [f32],
    add: impl Fn(usize, f32, &mut [f32]) + Sync,
) {
    let features = block.feature_count as usize;
    let gathered = &mut gathered[block.first()..][..block.point_count as usize * features];
    let camera = &views[block.view as usize];
    gathered.par_chunks_mut(features).zip(points).with_min_len(256).for_each(|(gathered, point)| {
        let place = VolumePlace::of(camera, point, block);
        gathered.fill(0.0);
        if place.is_outside() {
            return;
        }
        for corner in 0..8 {
            let (node, weight) = place.corner(block, corner);
            if node != u32::MAX {
                add(node as usize * features, weight, gathered);
            }
        }
    });
}

impl VolumeKernels for Cpu {
    fn gather_volume(
        &self,
        block: &VolumeBlock,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        volume: &Vec<f32>,
        gathered: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        gather_nodes(block, views, points, gathered, |first, weight, gathered| {
            let values = &volume[first..][..gathered.len()];
            gathered.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * weight);
        });
        Ok(())
    }

    fn pack_halves(&self, number_count: u32, numbers: &Vec<f32>, words: &mut Vec<u32>) -> Result<(), Infallible> {
        let words = words[..word_count(number_count) as usize].par_iter_mut().enumerate();
        words.with_min_len(4096).for_each(|(element, word)| *word = packed_halves(&numbers[..], number_count, element));
        Ok(())
    }

    fn gather_halves(
        &self,
        block: &VolumeBlock,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        volume: &Vec<u32>,
        gathered: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        gather_nodes(block, views, points, gathered, |first, weight, gathered| {
            let words = &volume[first / 2..(first + gathered.len()).div_ceil(2)];
            for (index, sum) in gathered.iter_mut().enumerate() {
                *sum += fetch_half(words, first % 2 + index) * weight;
            }
        });
        Ok(())
    }

    fn weigh_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        raw: &Vec<f32>,
        points: &Vec<RayPoint>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let samples = block.sample_count as usize;
        let rays = weights[..ray_count as usize * samples].par_chunks_mut(samples).enumerate();
        rays.for_each(|(ray, weights)| {
            let first = ray * samples;
            weigh_features(&raw[..], &points[..], block, ray, |sample, weight| weights[sample - first] = weight);
        });
        Ok(())
    }

    fn sum_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        weights: &Vec<f32>,
        fused: &Vec<f32>,
        raw: &Vec<f32>,
        summed: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (features, samples) = (block.feature_count as usize, block.sample_count as usize);
        let rays = summed[..ray_count as usize * features].par_chunks_mut(features).enumerate();
        rays.for_each(|(ray, summed)| {
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    summed.fill(0.0);
                    for sample in ray * samples..(ray + 1) * samples {
                        let weight = weights[sample];
                        let fused = &fused[sample * features..][..features];
                        let raw = &raw[sample * (features + 1) + 1..][..features];
                        for (sum, (fused, raw)) in summed.iter_mut().zip(fused.iter().zip(raw)) {
                            *sum += weight * (fused + raw);
                        }
                    }
                },
            );
        });
        Ok(())
    }

    fn denoiser_input(
        &self,
        block: &DenoiserInputBlock,
        pixel_count: u32,
        noisy: &Vec<f32>,
        condition: &Vec<f32>,
        inputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let count = (pixel_count * (block.picture_channels + block.condition_channels)) as usize;
        for (element, input) in inputs[..count].iter_mut().enumerate() {
            *input = denoiser_input(&noisy[..], &condition[..], block, element);
        }
        Ok(())
    }
}
