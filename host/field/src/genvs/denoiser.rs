//! The denoiser's network: a U-Net of residual blocks with group norm and self-attention, conditioned on the noise
//! level. Its encoder receives the halved input again at every level.
//!
//! Source: `networks.py` (`SongUNet` with `residual` encoder and `positional` embedding), from Karras et al. 2022 and
//! Song et al. 2021. The image of a skip connection is written directly behind the channels that the decoder
//! concatenates it with: nothing is copied.

use viewfuse_device::DeviceError;
mod block;
mod embedding;

use super::architecture::{COLOUR_CHANNELS, group_count};
use crate::FieldError;
use block::{Block, Resample};
use embedding::{Embedding, ShiftLayers};
use std::f32::consts::FRAC_1_SQRT_2;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::Device;
use viewfuse_kernels::genvs::DenoiserInputBlock;
use viewfuse_nn::convolution::{Convolution, ConvolutionOptions, Residual};
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::norm::GroupNorm;
use viewfuse_nn::scratch::Scratch;

/// Channels of a picture.
const PICTURE_CHANNELS: u32 = COLOUR_CHANNELS as u32;
/// Added to variances by group norms (epsilon, `networks.py`).
const GROUP_NORM_EPSILON: f32 = 1.0e-6;

const PLAIN: ConvolutionOptions = ConvolutionOptions::PLAIN;

/// A group norm with as many groups as published.
fn group_norm<D: Device>(loader: &Loader<'_, D>, name: &str) -> Result<GroupNorm<D>, FieldError> {
    Ok(loader.group_norm(name, group_count, GROUP_NORM_EPSILON)?)
}

/// A level of the encoder.
struct Level<D: Device> {
    /// The block that halves the image of the level before; the first level has none.
    down: Option<Down<D>>,
    blocks: Vec<Block<D>>,
}

/// The step from a level to the next.
struct Down<D: Device> {
    block: Block<D>,
    /// The residual input of the level before, halved and mapped to the level's channels.
    aux_residual: Convolution<D>,
}

/// A level of the decoder: blocks without skip connection, then those that read one.
struct DecoderLevel<D: Device> {
    plain: Vec<Block<D>>,
    skipped: Vec<Block<D>>,
}

/// The denoiser's layers on a device.
pub(super) struct Denoiser<D: Device> {
    embedding: Embedding<D>,
    first: Convolution<D>,
    levels: Vec<Level<D>>,
    decoder_levels: Vec<DecoderLevel<D>>,
    aux_norm: GroupNorm<D>,
    aux_conv: Convolution<D>,
}

/// Loads blocks, and collects their layers for the noise level.
struct Blocks<'a, 'b, D: Device> {
    loader: &'a Loader<'b, D>,
    shifts: ShiftLayers,
}

impl<D: Device> Blocks<'_, '_, D> {
    fn load(&mut self, level: &str, what: &str, resample: Resample, side: u32) -> Result<Block<D>, FieldError> {
        let name = format!("{level}_{what}");
        let first_shift = self.shifts.push(&self.loader.tensors, &name)?;
        Block::load(self.loader, &name, resample, side, first_shift)
    }

    /// `block0`, `block1` and so on.
    fn load_all(&mut self, level: &str, side: u32) -> Result<Vec<Block<D>>, FieldError> {
        let mut blocks = Vec::new();
        while self.loader.tensors.has(&format!("{level}_block{}.norm0.weight", blocks.len())) {
            blocks.push(self.load(level, &format!("block{}", blocks.len()), Resample::None, side)?);
        }
        Ok(blocks)
    }
}

impl<D: Device> Denoiser<D> {
    /// Loads it, for pictures of at least `side` rows and columns. `resolutions` are those of its levels in the names
    /// of the tensors, the largest first, at least one.
    ///
    /// # Errors
    /// If the checkpoint cannot be read, or the device has no memory left.
    pub(super) fn load(loader: &Loader<'_, D>, side: u32, resolutions: &[u32]) -> Result<Denoiser<D>, FieldError> {
        let mut blocks = Blocks { loader, shifts: ShiftLayers::default() };
        let (mut levels, mut decoder_levels) = (Vec::new(), Vec::new());
        for (depth, resolution) in resolutions.iter().enumerate() {
            let (side, name) = (side >> depth, format!("enc.{resolution}x{resolution}"));
            let down = match depth {
                0 => None,
                _ => Some(Down {
                    block: blocks.load(&name, "down", Resample::Halve, side)?,
                    aux_residual: loader.changed_convolution(&format!("{name}_aux_residual"), 0, |weights| {
                        weights.followed_by_average_pool()
                    })?,
                }),
            };
            levels.push(Level { down, blocks: blocks.load_all(&name, side)? });
        }
        for (depth, resolution) in resolutions.iter().enumerate().rev() {
            let (side, name) = (side >> depth, format!("dec.{resolution}x{resolution}"));
            let plain = if decoder_levels.is_empty() {
                vec![blocks.load(&name, "in0", Resample::None, side)?, blocks.load(&name, "in1", Resample::None, side)?]
            } else {
                vec![blocks.load(&name, "up", Resample::Double, side)?]
            };
            decoder_levels.push(DecoderLevel { plain, skipped: blocks.load_all(&name, side)? });
        }
        let largest = resolutions[0];
        let (first, last) = (format!("enc.{largest}x{largest}"), format!("dec.{largest}x{largest}"));
        Ok(Denoiser {
            embedding: Embedding::load(loader, blocks.shifts)?,
            first: loader.convolution(&format!("{first}_conv"), side)?,
            levels,
            decoder_levels,
            aux_norm: group_norm(loader, &format!("{last}_aux_norm"))?,
            aux_conv: loader.convolution(&format!("{last}_aux_conv"), side)?,
        })
    }

    /// The network's output (red, green, blue a pixel) for a noisy picture `[row][column][3]` and a condition
    /// `[row][column][channel]`. Rows and columns are multiples of two to the number of halvings.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        noisy: &D::Buffer<f32>,
        condition: &Image<D>,
        at: &Preconditioning,
    ) -> Result<Image<D>, DeviceError> {
        let (device, size) = (scratch.device(), condition.size);
        let block = DenoiserInputBlock {
            picture_channels: PICTURE_CHANNELS,
            condition_channels: size.channels,
            scale: at.input,
        };
        let mut inputs = scratch.image(size.with_channels(PICTURE_CHANNELS + size.channels))?;
        device.denoiser_input(&block, size.pixel_count(), noisy, &condition.values, &mut inputs.values)?;
        let shifts = self.embedding.shifts(device, at.noise)?;
        let skips = self.encode(scratch, inputs, &shifts)?;
        let x = self.decode(scratch, skips, &shifts)?;
        let normalised = self.aux_norm.run(scratch, &x, true)?;
        let output = self.aux_conv.run(scratch, PLAIN, &normalised, Residual::None)?;
        scratch.recycle(x);
        scratch.recycle(normalised);
        Ok(output)
    }

    /// The images of all skip connections, in the order in which they are computed.
    fn encode(
        &self,
        scratch: &mut Scratch<'_, D>,
        inputs: Image<D>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Vec<Image<D>>, DeviceError> {
        let device = scratch.device();
        let mut in_front = self.channels_in_front().into_iter();
        let mut place = |scratch: &mut Scratch<'_, D>, size: Size| {
            let front = in_front.next().unwrap_or(0);
            scratch.channel_slice(size, front + size.channels, front)
        };
        let mut skips: Vec<Image<D>> = Vec::new();
        // Where the first image of the level before is, once there is one.
        let mut residual: Option<usize> = None;
        for level in &self.levels {
            let first = match (&level.down, skips.last()) {
                (Some(down), Some(x)) => {
                    let mut halved = scratch.image(down.block.out_size(x.size))?;
                    down.block.run(scratch, shifts, x, &mut halved)?;
                    let mut first = place(scratch, halved.size)?;
                    let options = ConvolutionOptions { stride: 2, padding: Some(1), scale: FRAC_1_SQRT_2, ..PLAIN };
                    let input = residual.map_or(&inputs, |index| &skips[index]);
                    down.aux_residual.run_into(device, options, input, Residual::Image(&halved), &mut first)?;
                    scratch.recycle(halved);
                    residual = Some(skips.len());
                    first
                }
                _ => {
                    let mut first = place(scratch, inputs.size.with_channels(self.first.channels))?;
                    self.first.run_into(device, PLAIN, &inputs, Residual::None, &mut first)?;
                    first
                }
            };
            skips.push(first);
            for block in &level.blocks {
                let x = &skips[skips.len() - 1];
                let mut next = place(scratch, block.out_size(x.size))?;
                block.run(scratch, shifts, x, &mut next)?;
                skips.push(next);
            }
        }
        scratch.recycle(inputs);
        Ok(skips)
    }

    /// The channels in front of the image of each skip connection, in the order in which these are computed.
    fn channels_in_front(&self) -> Vec<u32> {
        let mut made = Vec::new();
        for level in &self.levels {
            made.push(level.down.as_ref().map_or(self.first.channels, |down| down.block.channels));
            made.extend(level.blocks.iter().map(|block| block.channels));
        }
        // The last one made is read first.
        let skipped = self.decoder_levels.iter().flat_map(|level| &level.skipped).map(|block| block.in_channels);
        let mut in_front: Vec<u32> = made.iter().rev().zip(skipped).map(|(own, all)| all - own).collect();
        in_front.reverse();
        in_front
    }

    fn decode(
        &self,
        scratch: &mut Scratch<'_, D>,
        mut skips: Vec<Image<D>>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Image<D>, DeviceError> {
        let mut x: Option<Image<D>> = None;
        for level in &self.decoder_levels {
            let count = level.plain.len() + level.skipped.len();
            for (index, block) in level.plain.iter().chain(&level.skipped).enumerate() {
                let next_is_skipped = index + 1 >= level.plain.len() && index + 1 < count;
                // Where the next block has a skip connection, the output goes in front of what comes through it.
                let skip = if next_is_skipped { skips.pop() } else { None };
                // The first block reads the last image that skips, and nothing beside it.
                let input = x.as_ref().unwrap_or_else(|| &skips[skips.len() - 1]);
                let size = block.out_size(input.size);
                let mut output = match skip {
                    Some(skip) => skip.channel_slice(0, size.channels),
                    None => scratch.image(size)?,
                };
                block.run(scratch, shifts, input, &mut output)?;
                if let Some(x) = x.take() {
                    scratch.recycle(x);
                }
                let channels = output.pitch;
                x = Some(output.channel_slice(0, channels));
            }
        }
        Ok(x.unwrap_or_else(|| unreachable!("a decoder has blocks")))
    }
}
