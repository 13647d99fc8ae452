//! The trunk of both published networks: torchvision's ResNet of basic blocks, with its sizes, tensors and evaluation.
//!
//! Source: He, Zhang, Ren, Sun: "Deep residual learning for image recognition", CVPR 2016; torchvision's `resnet.py`.

use super::checkpoint::TensorShape;
use super::convolution::{Convolution, ConvolutionOptions, Residual};
use super::image::Image;
use super::pool::MaxPool;
use super::scratch::Scratch;
use viewfuse_device::{Device, DeviceError};

/// Added to variances by its batch norms (epsilon).
pub const BATCH_NORM_EPSILON: f64 = 1.0e-5;

/// The first convolution.
const STEM: ConvolutionOptions = ConvolutionOptions { stride: 2, ..ConvolutionOptions::RELU };
/// Behind it.
const POOL: MaxPool = MaxPool { size: 3, stride: 2, padding: 1, ceil_mode: false };

/// A level of the trunk: basic blocks of two 3x3 convolutions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    /// Its channels.
    pub channels: usize,
    /// Its blocks.
    pub block_count: usize,
}

/// A convolution of the trunk, as a `state_dict` has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResNetLayer {
    /// Its name.
    pub name: String,
    /// The name of the batch norm behind it.
    pub norm: String,
    /// The level that it belongs to, from 1; 0 for the stem.
    pub level: usize,
    /// Shape of its weights: `[output channel][input channel][row][column]`.
    pub shape: [usize; 4],
}

/// A basic block: two convolutions; the input is added before the last rectification (the shortcut).
#[derive(Clone, Debug, PartialEq)]
pub struct BasicBlock<L> {
    /// The first convolution, which may have a stride.
    pub conv1: L,
    /// The second convolution.
    pub conv2: L,
    /// The shortcut's convolution, where sizes or channels change (torchvision's `downsample`).
    pub shortcut: Option<L>,
}

/// The trunk. `L` is a convolution: its name and shape ([`ResNetLayer`]), its parameters on the host, or on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct ResNet<L> {
    /// The first convolution, 7x7 with stride 2.
    pub stem: L,
    /// Whether a 3x3 max pool with stride 2 is behind it, as published. PixelNeRF's networks for 64 pixels have none.
    pub has_pool: bool,
    /// `[level][block]`.
    pub levels: Vec<Vec<BasicBlock<L>>>,
}

/// Whether the first block of level `level` (counted from 1) has a shortcut convolution: where the level halves the
/// image (or would halve it, in a trunk that stops halving), and where it changes the channels.
pub fn has_shortcut(level: usize, in_channels: usize, out_channels: usize) -> bool {
    level > 1 || in_channels != out_channels
}

impl ResNet<ResNetLayer> {
    /// The trunk of these sizes.
    pub fn new(stem_channels: usize, levels: &[Level]) -> ResNet<ResNetLayer> {
        let stem =
            ResNetLayer { name: "conv1".to_owned(), norm: "bn1".to_owned(), level: 0, shape: [stem_channels, 3, 7, 7] };
        let mut channels = stem_channels;
        let mut block = |level: usize, block: usize, outputs: usize| {
            let layer = |name: &str, norm: &str, shape: [usize; 4]| ResNetLayer {
                name: format!("layer{level}.{block}.{name}"),
                norm: format!("layer{level}.{block}.{norm}"),
                level,
                shape,
            };
            let own_block = BasicBlock {
                conv1: layer("conv1", "bn1", [outputs, channels, 3, 3]),
                conv2: layer("conv2", "bn2", [outputs, outputs, 3, 3]),
                shortcut: (block == 0 && has_shortcut(level, channels, outputs))
                    .then(|| layer("downsample.0", "downsample.1", [outputs, channels, 1, 1])),
            };
            channels = outputs;
            own_block
        };
        let levels = (1..).zip(levels);
        let levels =
            levels.map(|(level, sizes)| (0..sizes.block_count).map(|at| block(level, at, sizes.channels)).collect());
        ResNet { stem, has_pool: true, levels: levels.collect() }
    }
}

impl<L> ResNet<L> {
    /// The same trunk of other layers, in the order of the data.
    ///
    /// # Errors
    /// The first error of `layer`.
    pub fn try_map<M, E>(&self, mut layer: impl FnMut(&L) -> Result<M, E>) -> Result<ResNet<M>, E> {
        let stem = layer(&self.stem)?;
        let mut block = |block: &BasicBlock<L>| {
            Ok(BasicBlock {
                conv1: layer(&block.conv1)?,
                conv2: layer(&block.conv2)?,
                shortcut: block.shortcut.as_ref().map(&mut layer).transpose()?,
            })
        };
        let mut level = |blocks: &Vec<BasicBlock<L>>| blocks.iter().map(&mut block).collect();
        Ok(ResNet {
            stem,
            has_pool: self.has_pool,
            levels: self.levels.iter().map(&mut level).collect::<Result<_, _>>()?,
        })
    }
}

/// Every tensor of a trunk, in the order of the data; the names begin with `prefix` and a dot.
pub fn tensors(prefix: &str, stem_channels: usize, levels: &[Level]) -> Vec<TensorShape> {
    let mut tensors = Vec::new();
    let network = ResNet::new(stem_channels, levels);
    let blocks = network.levels.iter().flatten();
    let layers = blocks.flat_map(|block| [Some(&block.conv1), Some(&block.conv2), block.shortcut.as_ref()]).flatten();
    for ResNetLayer { name, norm, shape, .. } in std::iter::once(&network.stem).chain(layers) {
        tensors.push(TensorShape { name: format!("{prefix}.{name}.weight"), shape: shape.to_vec() });
        batch_norm_tensors(&mut tensors, &format!("{prefix}.{norm}"), shape[0]);
    }
    tensors
}

/// Adds the tensors of a batch norm.
pub fn batch_norm_tensors(tensors: &mut Vec<TensorShape>, name: &str, channels: usize) {
    for leaf in ["weight", "bias", "running_mean", "running_var"] {
        tensors.push(TensorShape { name: format!("{name}.{leaf}"), shape: vec![channels] });
    }
}

impl<D: Device> ResNet<Convolution<D>> {
    /// The stem's output for an image of three channels, then each level's output. Each level halves rows and columns
    /// until the output stride is `output_stride`; further levels have dilated windows instead.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        image: &Image<D>,
        output_stride: u32,
    ) -> Result<Vec<Image<D>>, DeviceError> {
        let stem = self.stem.run(scratch, STEM, image, Residual::None)?;
        let mut x = self.has_pool.then(|| POOL.run(scratch, &stem)).transpose()?;
        let mut images = vec![stem];
        // Pixels of the input from one pixel of the level to the next.
        let mut level_stride: u32 = if self.has_pool { 4 } else { 2 };
        for (level, blocks) in self.levels.iter().enumerate() {
            let dilation = (level_stride / output_stride).max(1);
            let first_stride = if level > 0 && dilation == 1 { 2 } else { 1 };
            for (index, block) in blocks.iter().enumerate() {
                let stride = if index == 0 { first_stride } else { 1 };
                let options = ConvolutionOptions { stride, dilation, ..ConvolutionOptions::RELU };
                // The first block of a level reads the level before, which is kept.
                let input = x.as_ref().unwrap_or_else(|| &images[images.len() - 1]);
                let output = block.run(scratch, options, input)?;
                if let Some(inner) = x.replace(output) {
                    scratch.recycle(inner);
                }
            }
            images.extend(x.take());
            level_stride = level_stride.saturating_mul(2);
        }
        Ok(images)
    }
}

impl<D: Device> BasicBlock<Convolution<D>> {
    /// Runs it; the stride is the first convolution's and the shortcut's.
    fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
    ) -> Result<Image<D>, DeviceError> {
        let inside = self.conv1.run(scratch, options, image, Residual::None)?;
        let shortcut_options = ConvolutionOptions { stride: options.stride, ..ConvolutionOptions::PLAIN };
        let shortcut = match &self.shortcut {
            Some(layer) => Some(layer.run(scratch, shortcut_options, image, Residual::None)?),
            None => None,
        };
        let residual = Residual::Image(shortcut.as_ref().unwrap_or(image));
        let output = self.conv2.run(scratch, ConvolutionOptions { stride: 1, ..options }, &inside, residual)?;
        scratch.recycle(inside);
        if let Some(shortcut) = shortcut {
            scratch.recycle(shortcut);
        }
        Ok(output)
    }
}
