//! Estimate of a run's memory, before anything is allocated.

use super::architecture::Architecture;
use super::options::GenvsOptions;
use viewfuse_device::Device;

/// Bytes that a run takes beside photographs and pictures: packed parameters, each view's volume and its last layer's
/// input (or half of the volume), and the images of the largest level of one network at a time.
pub(super) fn estimate<D: Device>(
    _device: &D,
    architecture: &Architecture,
    options: &GenvsOptions,
    source_sizes: &[[u32; 2]],
) -> u64 {
    let float = size_of::<f32>();
    let encoder = &architecture.encoder;
    let parameters = architecture.parameter_count() * float;
    let pixels = |[width, height]: &[u32; 2]| *width as usize * *height as usize;
    let nodes = encoder.feature_count * encoder.volume_depth;
    let largest = source_sizes.iter().map(pixels).max().unwrap_or(0);
    let whole = |pixels: usize| pixels * (nodes + encoder.decoder_channels) * float;
    let views = match options.omissions.half_volumes {
        // Half of each, and one in full while it is packed.
        true => source_sizes.iter().map(|size| pixels(size) * nodes * float / 2).sum::<usize>() + whole(largest),
        false => source_sizes.iter().map(|size| whole(pixels(size))).sum(),
    };
    // Side by side: what comes up, what skips to it, what becomes of both, and the patches of Winograd's way.
    let images = largest * 4 * encoder.decoder_channels * float;
    (2 * parameters + views + images) as u64
}
