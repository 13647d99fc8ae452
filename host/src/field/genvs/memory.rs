//! What a run takes of memory, before anything is allocated.

use super::architecture::Architecture;
use super::options::GenvsOptions;
use crate::device::Device;

/// Bytes that a run takes beside photographs and pictures: parameters in the order in which products need them, each view's
/// volume and what its last layer makes it of, and the images of the largest level of one network at a time.
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
    let views: usize = source_sizes.iter().map(|size| pixels(size) * (nodes + encoder.decoder_channels) * float).sum();
    let largest = source_sizes.iter().map(pixels).max().unwrap_or(0);
    // Side by side: what comes up, what skips to it, what becomes of both, and the patches of Winograd's way.
    let images = largest * 4 * encoder.decoder_channels * float;
    let _ = options;
    (2 * parameters + views + images) as u64
}
