//! Fusion of views, compositing of samples.

use crate::parallel::{for_each_row, for_each_row_of_two};
use viewfuse_core::composite::{CompositeBlock, composite_samples};
use viewfuse_core::fuse::FuseBlock;

pub(super) fn fuse_views(block: &FuseBlock, element_count: u32, weights: &[f32], latents: &[f32], fused: &mut [f32]) {
    // A point's channels together: they have the same weights. Sums in the order of `fuse_element`.
    let channels = block.channel_count.max(1) as usize;
    for_each_row(&mut fused[..element_count as usize], channels, 16384, |point, fused| {
        let weights = &weights[block.first_weight(point * channels)..][..block.view_count as usize];
        fused.fill(0.0);
        for (view, weight) in weights.iter().enumerate() {
            let latents = &latents[view * block.stride as usize + point * channels..];
            for (fused, latent) in fused.iter_mut().zip(latents) {
                *fused += weight * latent;
            }
        }
    });
}

pub(super) fn composite(
    block: &CompositeBlock,
    ray_count: u32,
    samples: &[[f32; 4]],
    sample_depths: &[f32],
    colours: &mut [[f32; 4]],
    depths: &mut [f32],
) {
    let (rays, count) = (ray_count as usize, block.sample_count as usize);
    for_each_row_of_two(&mut colours[..rays], &mut depths[..rays], 1, 64, |ray, colour, depth| {
        let own = ray * count..(ray + 1) * count;
        let seen = composite_samples(&samples[own.clone()], &sample_depths[own], block);
        colour[0] = [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity];
        depth[0] = seen.depth;
    });
}
