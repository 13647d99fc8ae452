//! Fusion of the views' latents: a weighted sum.

use crate::lent::{Input, Output};
use crate::status::Status;
use viewfuse_core::fetch::{Fetch, StartingAt};
use viewfuse_core::fuse::{FuseBlock, fuse_element};

/// The weighted sum of the views' latents, in view order.
///
/// `weights` is `[view_count]`, each finite and at least 0; `latents` is `[view_count][channel_count]`, `fused` is
/// `[channel_count]`. Latents that are not finite give channels that are not. `fused` may be the same memory as the
/// first view's latents, but may not overlap the weights or the latents otherwise.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_fuse_views(
    weights: *const f32,
    latents: *const f32,
    view_count: u32,
    channel_count: u32,
    fused: *mut f32,
) -> Status {
    let fuse = || {
        let (views, channels) = (view_count as usize, channel_count as usize);
        let latent_count = views.saturating_mul(channels);
        if latent_count == 0 {
            return Err(Status::Count);
        }
        // SAFETY: the caller's promise, for each of the three.
        let (weights, latents, mut fused) =
            unsafe { (Input::new(weights, views)?, Input::new(latents, latent_count)?, Output::new(fused, channels)?) };
        let mut view = 0;
        while view < views {
            if !(0.0..=f32::MAX).contains(&weights.fetch(view)) {
                return Err(Status::Weight);
            }
            view += 1;
        }
        let block = FuseBlock { view_count, stride: channel_count, ..FuseBlock::default() };
        let mut channel = 0;
        while channel < channels {
            fused.store(channel, fuse_element(&weights, &StartingAt { all: &latents, first: channel }, &block));
            channel += 1;
        }
        Ok(())
    };
    Status::of(fuse())
}
