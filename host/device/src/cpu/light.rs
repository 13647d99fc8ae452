//! The views become one, samples become a pixel.

use super::Cpu;
use crate::kernels::light::{LightKernels, Pixels};
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::composite::{CompositeBlock, composite_samples};
use viewfuse_core::fuse::FuseBlock;

impl LightKernels for Cpu {
    fn fuse_views(
        &self,
        block: &FuseBlock,
        element_count: u32,
        weights: &Vec<f32>,
        latents: &Vec<f32>,
        fused: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        // A point's channels together: they have the same weights. Sums in the order of `fuse_element`.
        let channels = block.channel_count.max(1) as usize;
        fused[..element_count as usize].par_chunks_mut(channels).enumerate().for_each(|(point, fused)| {
            let weights = &weights[block.first_weight(point * channels)..][..block.view_count as usize];
            fused.fill(0.0);
            for (view, weight) in weights.iter().enumerate() {
                let latents = &latents[view * block.stride as usize + point * channels..];
                for (fused, latent) in fused.iter_mut().zip(latents) {
                    *fused += weight * latent;
                }
            }
        });
        Ok(())
    }

    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Vec<[f32; 4]>,
        sample_depths: &Vec<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Infallible> {
        let count = block.sample_count as usize;
        let rays = samples.par_chunks(count).zip(sample_depths.par_chunks(count));
        let pixels = pixels.colours.par_iter_mut().zip(&mut pixels.depths);
        pixels.zip(rays).for_each(|((colour, depth), (samples, depths))| {
            let seen = composite_samples(samples, depths, block);
            *colour = [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity];
            *depth = seen.depth;
        });
        Ok(())
    }
}
