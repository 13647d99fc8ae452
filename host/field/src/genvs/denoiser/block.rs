//! A residual block of the U-Net, and self-attention behind it.

use super::{PLAIN, group_norm};
use crate::FieldError;
use std::f32::consts::FRAC_1_SQRT_2;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_nn::attention::self_attention;
use viewfuse_nn::convolution::{Convolution, ConvolutionOptions, DepthwiseConvolution, Residual};
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::norm::GroupNorm;
use viewfuse_nn::scratch::Scratch;
use viewfuse_nn::weights::ConvolutionWeights;

/// Resampling of a block. The published filter is `[1, 1]`: the mean of 2x2 pixels, or each of them
/// repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Resample {
    /// Nothing.
    None,
    /// Half as many rows and columns.
    Halve,
    /// Twice as many.
    Double,
}

/// A block's layers.
pub(super) struct Block<D: Device> {
    resample: Resample,
    halving: Option<DepthwiseConvolution<D>>,
    norm0: GroupNorm<D>,
    conv0: Convolution<D>,
    /// Offset of the block's shifts by noise level.
    first_shift: u32,
    norm1: GroupNorm<D>,
    conv1: Convolution<D>,
    /// The shortcut's convolution (`skip`), where sizes or channels change.
    shortcut: Option<Convolution<D>>,
    attention: Option<Attention<D>>,
    /// Channels of its input.
    pub(super) in_channels: u32,
    /// Channels of its output.
    pub(super) channels: u32,
}

/// Self-attention with one head.
struct Attention<D: Device> {
    norm2: GroupNorm<D>,
    /// The layer of queries, keys and values, concatenated.
    qkv: Convolution<D>,
    proj: Convolution<D>,
}

impl<D: Device> Block<D> {
    /// Loads it, for images of at least `side` rows and columns (of its output).
    pub(super) fn load(
        loader: &Loader<'_, D>,
        name: &str,
        resample: Resample,
        side: u32,
        first_shift: u32,
    ) -> Result<Block<D>, FieldError> {
        let layer = |layer: &str| format!("{name}.{layer}");
        let conv0 = loader.convolution(&layer("conv0"), side)?;
        let has = |name: &str| loader.tensors.has(&layer(&format!("{name}.weight")));
        let shortcut = |weights: ConvolutionWeights| match resample {
            Resample::Halve => weights.followed_by_average_pool(),
            _ => weights,
        };
        let attention = || {
            Ok::<_, FieldError>(Attention {
                norm2: group_norm(loader, &layer("norm2"))?,
                // Published: query, key and value of a channel are adjacent.
                qkv: loader.changed_convolution(&layer("qkv"), 0, |weights| {
                    let channels = weights.out_channels / 3;
                    weights.with_outputs_reordered(|column| column % channels * 3 + column / channels)
                })?,
                proj: loader.convolution(&layer("proj"), 0)?,
            })
        };
        let halving = (resample == Resample::Halve).then(|| DepthwiseConvolution::average_pool(loader.device));
        let norm0 = group_norm(loader, &layer("norm0"))?;
        Ok(Block {
            resample,
            halving: halving.transpose()?,
            in_channels: norm0.channels,
            channels: conv0.channels,
            norm0,
            conv0,
            first_shift,
            norm1: group_norm(loader, &layer("norm1"))?,
            conv1: loader.convolution(&layer("conv1"), side)?,
            shortcut: has("skip").then(|| loader.changed_convolution(&layer("skip"), 0, shortcut)).transpose()?,
            attention: has("qkv").then(attention).transpose()?,
        })
    }

    /// Size of the output for an input.
    pub(super) fn out_size(&self, size: Size) -> Size {
        let size = match self.resample {
            Resample::None => size,
            Resample::Halve => size.halved(),
            Resample::Double => size.doubled(),
        };
        size.with_channels(self.channels)
    }

    /// Runs it into an image of the right size; `shifts` are those of all blocks.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        shifts: &D::Buffer<f32>,
        image: &Image<D>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let mut normalised = self.norm0.run(scratch, image, true)?;
        if let Some(halving) = &self.halving {
            let options = ConvolutionOptions { stride: 2, padding: Some(0), ..PLAIN };
            let halved = halving.run(scratch, options, &normalised)?;
            scratch.recycle(std::mem::replace(&mut normalised, halved));
        }
        let upsampling = if self.resample == Resample::Double { 2 } else { 1 };
        let options = ConvolutionOptions { upsampling, ..PLAIN };
        let shift = Residual::Channels(shifts, self.first_shift);
        let inside = self.conv0.run(scratch, options, &normalised, shift)?;
        scratch.recycle(normalised);
        let normalised = self.norm1.run(scratch, &inside, true)?;
        scratch.recycle(inside);
        let stride = if self.resample == Resample::Halve { 2 } else { 1 };
        let shortcut_options = ConvolutionOptions { stride, padding: Some(0), ..options };
        let shortcut = match &self.shortcut {
            Some(layer) => Some(layer.run(scratch, shortcut_options, image, Residual::None)?),
            None => None,
        };
        let residual = Residual::Image(shortcut.as_ref().unwrap_or(image));
        // The sum of two independent images is scaled to the variance of one.
        let options = ConvolutionOptions { scale: FRAC_1_SQRT_2, ..PLAIN };
        match &self.attention {
            None => self.conv1.run_into(scratch.device(), options, &normalised, residual, output)?,
            Some(attention) => {
                let sum = self.conv1.run(scratch, options, &normalised, residual)?;
                attention.run_into(scratch, &sum, output)?;
                scratch.recycle(sum);
            }
        }
        scratch.recycle(normalised);
        if let Some(shortcut) = shortcut {
            scratch.recycle(shortcut);
        }
        Ok(())
    }
}

impl<D: Device> Attention<D> {
    /// The image plus its self-attention.
    fn run_into(
        &self,
        scratch: &mut Scratch<'_, D>,
        image: &Image<D>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let normalised = self.norm2.run(scratch, image, false)?;
        let qkv = self.qkv.run(scratch, PLAIN, &normalised, Residual::None)?;
        let attended = self_attention(scratch, &qkv)?;
        let options = ConvolutionOptions { scale: FRAC_1_SQRT_2, ..PLAIN };
        self.proj.run_into(scratch.device(), options, &attended, Residual::Image(image), output)?;
        for image in [normalised, qkv, attended] {
            scratch.recycle(image);
        }
        Ok(())
    }
}
