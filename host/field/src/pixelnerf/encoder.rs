//! From a source image to its latents: the trunk, its levels enlarged to the first one's size and put side by side, and
//! on request the latents already multiplied with the layers that inject them.

use super::architecture::Architecture;
use super::parameters::{Block, Parameters, PointNetwork, Trunk};
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_device::{Device, Layer};

/// Height, width and channels of an image in a device's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) channels: u32,
}

impl Size {
    fn len(self) -> usize {
        self.height as usize * self.width as usize * self.channels as usize
    }
}

/// An image `[row][column][channel]` in a device's memory.
pub(super) struct Image<D: Device> {
    pub(super) size: Size,
    pub(super) values: D::Buffer<f32>,
}

/// What is known of a view.
pub(super) struct ViewLatents<D: Device> {
    /// Grids that points are looked up in: the latents themselves, or `[network][injection]` their products.
    pub(super) grids: Vec<Vec<D::Buffer<f32>>>,
    /// Rows and columns of a grid.
    pub(super) grid_size: [u32; 2],
}

/// Encodes an image (red, green, blue in `[-1, 1]`). With `maps`, the grids are the injections of each network; without,
/// the one grid of the one list holds the latents.
pub(super) fn encode<D: Device>(
    device: &D,
    architecture: &Architecture,
    parameters: &Parameters<Layer<D>>,
    image: &Image<D>,
    maps: bool,
) -> Result<ViewLatents<D>, D::Error> {
    let latents = run_trunk(device, architecture, &parameters.trunk, image)?;
    let grid_size = [latents.size.height, latents.size.width];
    let grids = match maps {
        false => vec![vec![latents.values]],
        true => parameters
            .networks
            .iter()
            .map(|network| inject(device, network, &latents, architecture.width))
            .collect::<Result<_, _>>()?,
    };
    Ok(ViewLatents { grids, grid_size })
}

/// Every injection of a network at every node.
fn inject<D: Device>(
    device: &D,
    network: &PointNetwork<Layer<D>>,
    latents: &Image<D>,
    width: usize,
) -> Result<Vec<D::Buffer<f32>>, D::Error> {
    let block = ProductBlock {
        row_count: latents.size.height * latents.size.width,
        inner_count: latents.size.channels,
        column_count: width as u32,
        ..ProductBlock::default()
    };
    let inject = |layer: &Layer<D>| {
        let mut grid = device.zeros(block.row_count as usize * width)?;
        device.product(&block, &latents.values, &layer.weights, &layer.bias, None, &mut grid)?;
        Ok(grid)
    };
    network.injections.iter().map(inject).collect()
}

fn run_trunk<D: Device>(
    device: &D,
    architecture: &Architecture,
    trunk: &Trunk<Layer<D>>,
    image: &Image<D>,
) -> Result<Image<D>, D::Error> {
    let stem = Convolution { channels: architecture.stem_channels, size: 7, stride: 2, padding: 3, relu: true };
    let first = stem.run(device, &trunk.stem, image, None)?;
    let grid = Size { channels: architecture.latent_channels() as u32, ..first.size };
    let mut latents = Image { size: grid, values: device.zeros(grid.len())? };
    enlarge(device, &first, &mut latents, 0)?;
    let mut first_channel = first.size.channels;
    let mut level_image = pool(device, &first)?;
    for (level, blocks) in trunk.levels.iter().enumerate() {
        let channels = architecture.levels[level].channels;
        for (index, block) in blocks.iter().enumerate() {
            let stride = if level > 0 && index == 0 { 2 } else { 1 };
            level_image = run_block(device, block, &level_image, channels, stride)?;
        }
        enlarge(device, &level_image, &mut latents, first_channel)?;
        first_channel += level_image.size.channels;
    }
    Ok(latents)
}

/// Two convolutions; what came in, or its own convolution, is added before the second one's rectification.
fn run_block<D: Device>(
    device: &D,
    block: &Block<Layer<D>>,
    image: &Image<D>,
    channels: usize,
    stride: u32,
) -> Result<Image<D>, D::Error> {
    let window = Convolution { channels, size: 3, stride: 1, padding: 1, relu: true };
    let inside = Convolution { stride, ..window }.run(device, &block.first, image, None)?;
    let beside = Convolution { channels, size: 1, stride, padding: 0, relu: false };
    let beside = block.beside.as_ref().map(|layer| beside.run(device, layer, image, None)).transpose()?;
    window.run(device, &block.second, &inside, Some(beside.as_ref().unwrap_or(image)))
}

/// What a convolution does to an image.
#[derive(Clone, Copy)]
struct Convolution {
    channels: usize,
    size: u32,
    stride: u32,
    padding: u32,
    relu: bool,
}

impl Convolution {
    fn run<D: Device>(
        &self,
        device: &D,
        layer: &Layer<D>,
        image: &Image<D>,
        addend: Option<&Image<D>>,
    ) -> Result<Image<D>, D::Error> {
        let Size { height, width, channels } = image.size;
        let out = |side: u32| windows(side, self.size, self.stride, self.padding);
        let size = Size { height: out(height), width: out(width), channels: self.channels as u32 };
        let block = ConvolveBlock {
            in_height: height,
            in_width: width,
            in_channels: channels,
            out_height: size.height,
            out_width: size.width,
            out_channels: size.channels,
            size: self.size,
            stride: self.stride,
            padding: self.padding,
            relu_outputs: u32::from(self.relu),
            ..ConvolveBlock::default()
        }
        .packed();
        let mut values = device.zeros(size.len())?;
        let addend = addend.map(|image| &image.values);
        device.convolve(&block, &image.values, &layer.weights, &layer.bias, addend, &mut values)?;
        Ok(Image { size, values })
    }
}

/// The largest of windows of 3x3, every second one.
fn pool<D: Device>(device: &D, image: &Image<D>) -> Result<Image<D>, D::Error> {
    let Size { height, width, channels } = image.size;
    let size = Size { height: windows(height, 3, 2, 1), width: windows(width, 3, 2, 1), channels };
    let block = PoolBlock {
        in_height: height,
        in_width: width,
        out_height: size.height,
        out_width: size.width,
        channels,
        size: 3,
        stride: 2,
        padding: 1,
    };
    let mut values = device.zeros(size.len())?;
    device.max_pool(&block, &image.values, &mut values)?;
    Ok(Image { size, values })
}

/// Writes an image, enlarged, into channels of the latents.
fn enlarge<D: Device>(
    device: &D,
    image: &Image<D>,
    latents: &mut Image<D>,
    first_channel: u32,
) -> Result<(), D::Error> {
    let block = UpsampleBlock {
        in_height: image.size.height,
        in_width: image.size.width,
        in_channels: image.size.channels,
        out_height: latents.size.height,
        out_width: latents.size.width,
        out_channels: latents.size.channels,
        first_channel,
    };
    device.upsample(&block, &image.values, &mut latents.values)
}

/// How many windows fit on a side.
fn windows(side: u32, size: u32, stride: u32, padding: u32) -> u32 {
    (side + 2 * padding).saturating_sub(size) / stride + 1
}
