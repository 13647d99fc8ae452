//! Estimate of a run's memory, before anything is allocated.

use super::architecture::Architecture;
use super::grid::grid_bytes;
use super::network::workspace_bytes;
use super::options::{PixelNerfOptions, Sampling};
use super::pass::{ray_bytes, rays_at_once};
use viewfuse_device::Device;

/// Bytes that a run takes beside the photographs and the pictures: parameters (on the host, on the device, and packed
/// there), the encoding of every view (`source_sizes[view]` is width and height), activations, the rays of a tile.
/// Probes take 8 bytes more a first-pass sample of one ray in every square: half a byte a pixel and sample for squares
/// of 4, two where these meet nothing.
pub(super) fn estimate<D: Device>(
    device: &D,
    architecture: &Architecture,
    options: &PixelNerfOptions,
    source_sizes: &[[u32; 2]],
) -> u64 {
    let float = size_of::<f32>();
    let (maps, half) = (options.omissions.latent_layers, options.omissions.half_latents);
    let parameters = 3 * architecture.parameter_count() * float;
    let latents = architecture.latent_channels();
    let known =
        if maps { architecture.passes().len() * architecture.injected_count * architecture.width } else { latents };
    let nodes = |[width, height]: &[u32; 2]| width.div_ceil(2) as usize * height.div_ceil(2) as usize;
    let grids = |nodes: usize| grid_bytes((nodes * known) as u32, half) as usize;
    let views: usize = source_sizes.iter().map(|size| grids(nodes(size)) + nodes(size) * 12 * float).sum();
    // The trunk's own images, of one view at a time: the first one's size, the latents beside them, and a grid in full
    // while it is packed.
    let largest = source_sizes.iter().map(nodes).max().unwrap_or(0);
    let whole = if half && maps { architecture.width } else { 0 };
    let trunk = largest * (latents + 4 * architecture.stem_channels + whole) * float;
    let Sampling { coarse_count, importance_count, depth_count, .. } = options.sampling;
    let rays = rays_at_once(device, &options.sampling) * ray_bytes(coarse_count, importance_count + depth_count);
    let activations = workspace_bytes(device, architecture, source_sizes.len(), maps);
    (parameters + views + trunk + rays + activations) as u64
}
