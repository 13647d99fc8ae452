//! A residual block of the U-Net, and self-attention behind it.

use super::super::architecture::{self, Resampling};
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

/// A block's layers.
pub(super) struct Block<D: Device> {
    resampling: Resampling,
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
    /// The channels of its input in front of those of the skip connection; `None` without one.
    pub(super) in_front: Option<u32>,
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
        block: &architecture::Block,
        side: u32,
        first_shift: u32,
    ) -> Result<Block<D>, FieldError> {
        let architecture::Block { name, in_channels, joined_channels, resampling, .. } = block;
        let (resampling, joined_channels) = (*resampling, *joined_channels);
        let layer = |layer: &str| format!("{name}.{layer}");
        let shortcut = |weights: ConvolutionWeights| match resampling {
            Resampling::Down => weights.followed_by_average_pool(),
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
        let halving = (resampling == Resampling::Down).then(|| DepthwiseConvolution::average_pool(loader.device));
        Ok(Block {
            resampling,
            halving: halving.transpose()?,
            in_front: (joined_channels > 0).then(|| (in_channels - joined_channels) as u32),
            norm0: group_norm(loader, &layer("norm0"))?,
            conv0: loader.convolution(&layer("conv0"), side)?,
            first_shift,
            norm1: group_norm(loader, &layer("norm1"))?,
            conv1: loader.convolution(&layer("conv1"), side)?,
            shortcut: block.has_skip().then(|| loader.changed_convolution(&layer("skip"), 0, shortcut)).transpose()?,
            attention: block.has_attention.then(attention).transpose()?,
        })
    }

    /// Size of the output for an input.
    pub(super) fn out_size(&self, size: Size) -> Size {
        let size = match self.resampling {
            Resampling::None => size,
            Resampling::Down => size.halved(),
            Resampling::Up => size.doubled(),
        };
        size.with_channels(self.conv0.channels)
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
        let upsampling = if self.resampling == Resampling::Up { 2 } else { 1 };
        let options = ConvolutionOptions { upsampling, ..PLAIN };
        let shift = Residual::Channels(shifts, self.first_shift);
        let inside = self.conv0.run(scratch, options, &normalised, shift)?;
        scratch.recycle(normalised);
        let normalised = self.norm1.run(scratch, &inside, true)?;
        scratch.recycle(inside);
        let stride = if self.resampling == Resampling::Down { 2 } else { 1 };
        let shortcut_options = ConvolutionOptions { stride, padding: Some(0), ..options };
        let shortcut = match &self.shortcut {
            Some(layer) => Some(layer.run(scratch, shortcut_options, image, Residual::None)?),
            None => None,
        };
        let residual = Residual::Image(shortcut.as_ref().unwrap_or(image));
        // The sum of two independent images is scaled to the variance of one.
        let options = ConvolutionOptions { scale: FRAC_1_SQRT_2, ..PLAIN };
        match &self.attention {
            None => self.conv1.run_into(scratch, options, &normalised, residual, output)?,
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
        self.proj.run_into(scratch, options, &attended, Residual::Image(image), output)?;
        for image in [normalised, qkv, attended] {
            scratch.recycle(image);
        }
        Ok(())
    }
}
