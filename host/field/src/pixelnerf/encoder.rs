//! The latents of a source image: the trunk's levels, upsampled to the stem's size and concatenated, and optionally the
//! outputs of the layers `lin_z` for them.

use super::architecture::Architecture;
use super::grid::Grid;
use super::options::Omissions;
use super::parameters::{DeviceParameters, PointNetwork};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_nn::convolution::Convolution;
use viewfuse_nn::image::Image;
use viewfuse_nn::linear::{Linear, LinearOptions};
use viewfuse_nn::resample::upsample;
use viewfuse_nn::resnet::ResNet;
use viewfuse_nn::scratch::Scratch;

/// A view's encoding.
pub(super) struct ViewLatents<D: Device> {
    /// Grids for look-ups at points: the latents themselves, or their `lin_z` outputs, `[network][block]`.
    pub(super) grids: Vec<Vec<Grid<D>>>,
    /// Rows and columns of a grid.
    pub(super) grid_size: [u32; 2],
}

/// Encodes an image (red, green, blue in `[-1, 1]`). With `latent_layers` left out at points, the grids are the outputs
/// of each network's `lin_z`; otherwise the only grid holds the latents. Each grid is packed before the next one is
/// computed.
pub(super) fn encode<D: Device>(
    device: &D,
    architecture: &Architecture,
    parameters: &DeviceParameters<D>,
    image: &Image<D>,
    omissions: &Omissions,
) -> Result<ViewLatents<D>, DeviceError> {
    let latents = run_trunk(device, architecture, &parameters.trunk, image)?;
    let grid_size = [latents.size.height, latents.size.width];
    let nodes = latents.size.pixel_count();
    let grid = |values, channels: u32| Grid::new(device, values, nodes * channels, omissions.half_latents);
    let grids = if omissions.latent_layers {
        let mut all = Vec::new();
        for PointNetwork { lin_z, .. } in &parameters.networks {
            let maps = lin_z.iter().map(|layer| grid(map_latents(device, layer, &latents)?, layer.out_count));
            all.push(maps.collect::<Result<_, _>>()?);
        }
        all
    } else {
        vec![vec![grid(latents.values, latents.size.channels)?]]
    };
    Ok(ViewLatents { grids, grid_size })
}

/// A `lin_z` at every node: `[row][column][width]`.
fn map_latents<D: Device>(device: &D, layer: &Linear<D>, latents: &Image<D>) -> Result<D::Buffer<f32>, DeviceError> {
    let row_count = latents.size.pixel_count();
    let mut values = device.zeros(row_count as usize * layer.out_count as usize)?;
    layer.run(device, row_count, LinearOptions::PLAIN, &latents.values, None, &mut values)?;
    Ok(values)
}

/// The latents `[row][column][channel]`: the stem's channels, then each level's.
pub(super) fn run_trunk<D: Device>(
    device: &D,
    architecture: &Architecture,
    trunk: &ResNet<Convolution<D>>,
    image: &Image<D>,
) -> Result<Image<D>, DeviceError> {
    // Its levels halve the image as often as there are levels.
    let levels = trunk.run(&mut Scratch::new(device), image, u32::MAX)?;
    let mut latents = Image::zeros(device, levels[0].size.with_channels(architecture.latent_channels() as u32))?;
    let mut first_channel = 0;
    for level in &levels {
        upsample(device, level, first_channel, &mut latents)?;
        first_channel += level.size.channels;
    }
    Ok(latents)
}
