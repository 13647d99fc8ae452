//! Fusion of views.

use crate::parallel::for_each_row;
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
