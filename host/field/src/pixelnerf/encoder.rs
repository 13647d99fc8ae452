//! The latents of a source image: the trunk's levels, upsampled to the stem's size and concatenated, and optionally the
//! outputs of the layers `lin_z` for them.

use super::architecture::Architecture;
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
    pub(super) grids: Vec<Vec<D::Buffer<f32>>>,
    /// Rows and columns of a grid.
    pub(super) grid_size: [u32; 2],
}

/// Encodes an image (red, green, blue in `[-1, 1]`). With `maps`, the grids are the outputs of each network's `lin_z`;
/// without, the only grid holds the latents.
pub(super) fn encode<D: Device>(
    device: &D,
    architecture: &Architecture,
    parameters: &DeviceParameters<D>,
    image: &Image<D>,
    maps: bool,
) -> Result<ViewLatents<D>, DeviceError> {
    let latents = run_trunk(device, architecture, &parameters.trunk, image)?;
    let grid_size = [latents.size.height, latents.size.width];
    let grids = match maps {
        false => vec![vec![latents.values]],
        true => {
            let grids = parameters.networks.iter().map(|network| map_latents(device, network, &latents));
            grids.collect::<Result<_, _>>()?
        }
    };
    Ok(ViewLatents { grids, grid_size })
}

/// Every `lin_z` of a network at every node, `[block]`: `[row][column][width]`.
fn map_latents<D: Device>(
    device: &D,
    network: &PointNetwork<Linear<D>>,
    latents: &Image<D>,
) -> Result<Vec<D::Buffer<f32>>, DeviceError> {
    let row_count = latents.size.pixel_count();
    let map = |layer: &Linear<D>| {
        let mut grid = device.zeros(row_count as usize * layer.out_count as usize)?;
        layer.run(device, row_count, LinearOptions::PLAIN, &latents.values, None, &mut grid)?;
        Ok(grid)
    };
    network.lin_z.iter().map(map).collect()
}

/// The latents `[row][column][channel]`: the stem's channels, then each level's.
fn run_trunk<D: Device>(
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
