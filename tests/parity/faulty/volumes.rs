//! From volumes to a feature image and the denoiser's inputs, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::VolumeKernels;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
use viewfuse_core::half::{half_bits, half_value};
use viewfuse_core::rays::RayPoint;
use viewfuse_vulkan::kernel::Kernel;

impl VolumeKernels for Faulty {
    fn gather_volume(
        &self,
        block: &VolumeBlock,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        volume: &Vec<f32>,
        gathered: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.gather_volume(block, views, points, volume, gathered)?;
        let count = (block.point_count * block.feature_count) as usize;
        self.spoil(Kernel::GatherVolume, &mut gathered[block.first()..][..count]);
        Ok(())
    }

    fn pack_halves(&self, number_count: u32, numbers: &Vec<f32>, words: &mut Vec<u32>) -> Result<(), Infallible> {
        Cpu.pack_halves(number_count, numbers, words)?;
        for word in words {
            let mut halves = [half_value(*word), half_value(*word >> 16)];
            self.spoil(Kernel::PackHalves, &mut halves);
            *word = half_bits(halves[0]) | half_bits(halves[1]) << 16;
        }
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
        Cpu.gather_halves(block, views, points, volume, gathered)?;
        let count = (block.point_count * block.feature_count) as usize;
        self.spoil(Kernel::GatherHalves, &mut gathered[block.first()..][..count]);
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
        Cpu.weigh_features(block, ray_count, raw, points, weights)?;
        self.spoil(Kernel::WeighFeatures, weights);
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
        Cpu.sum_features(block, ray_count, weights, fused, raw, summed)?;
        self.spoil(Kernel::SumFeatures, summed);
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
        Cpu.denoiser_input(block, pixel_count, noisy, condition, inputs)?;
        self.spoil(Kernel::DenoiserInput, inputs);
        Ok(())
    }
}
