//! The denoiser's network: a U-Net of residual blocks with group norm and self-attention, conditioned on the noise
//! level. Its encoder receives the halved input again at every level.
//!
//! Source: `networks.py` (`SongUNet` with `residual` encoder and `positional` embedding), from Karras et al. 2022 and
//! Song et al. 2021. The image of a skip connection is written directly behind the channels that the decoder
//! concatenates it with: nothing is copied.

mod block;
mod calls;
mod embedding;

use super::architecture::{self, DenoiserStep, group_count};
use crate::FieldError;
use block::Block;
pub(super) use calls::Calls;
use embedding::{Embedding, ShiftLayers};
use std::f32::consts::FRAC_1_SQRT_2;
use viewfuse_device::{Device, DeviceError};
use viewfuse_nn::convolution::{Convolution, ConvolutionOptions, Residual};
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::norm::GroupNorm;
use viewfuse_nn::scratch::Scratch;

/// Added to variances by group norms (epsilon, `networks.py`).
const GROUP_NORM_EPSILON: f32 = 1.0e-6;

const PLAIN: ConvolutionOptions = ConvolutionOptions::PLAIN;

/// A group norm with as many groups as published.
fn group_norm<D: Device>(loader: &Loader<'_, D>, name: &str) -> Result<GroupNorm<D>, FieldError> {
    Ok(loader.group_norm(name, group_count, GROUP_NORM_EPSILON)?)
}

/// A step of the encoder; each makes an image that the decoder reads.
enum Step<D: Device> {
    First(Convolution<D>),
    Block(Block<D>),
    /// A block that halves, and the last residual input, halved and mapped to the block's channels.
    Down(Block<D>, Convolution<D>),
}

/// The denoiser's layers on a device.
pub(super) struct Denoiser<D: Device> {
    embedding: Embedding<D>,
    encoder: Vec<Step<D>>,
    decoder: Vec<Block<D>>,
    aux_norm: GroupNorm<D>,
    aux_conv: Convolution<D>,
}

impl<D: Device> Denoiser<D> {
    /// Loads it, for pictures of at least `side` rows and columns.
    pub(super) fn load(
        loader: &Loader<'_, D>,
        side: u32,
        architecture: &architecture::Denoiser,
    ) -> Result<Denoiser<D>, FieldError> {
        let mut shifts = ShiftLayers::default();
        let at = |trained: usize| side >> (architecture.image_side / trained).ilog2();
        let mut block = |block: architecture::Block| {
            let first_shift = shifts.push(&loader.tensors, &block.name)?;
            Block::load(loader, &block, at(block.side), first_shift)
        };
        let mut encoder = Vec::new();
        for step in architecture.down() {
            match (step, encoder.pop()) {
                (DenoiserStep::Residual(layer), Some(Step::Block(down))) => {
                    let pooled =
                        loader.changed_convolution(&layer.name, 0, |weights| weights.followed_by_average_pool());
                    encoder.push(Step::Down(down, pooled?));
                }
                (step, before) => {
                    encoder.extend(before);
                    encoder.push(match step {
                        DenoiserStep::Block(next) => Step::Block(block(next)?),
                        DenoiserStep::Convolution(layer) | DenoiserStep::Residual(layer) => {
                            Step::First(loader.convolution(&layer.name, side)?)
                        }
                    });
                }
            }
        }
        let decoder = architecture.up().into_iter().map(block).collect::<Result<_, _>>()?;
        let (norm, convolution) = architecture.exit();
        Ok(Denoiser {
            embedding: Embedding::load(loader, shifts)?,
            encoder,
            decoder,
            aux_norm: group_norm(loader, &norm)?,
            aux_conv: loader.convolution(&convolution.name, side)?,
        })
    }

    /// What its layers make of its input and the shifts: red, green, blue a pixel.
    fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        inputs: &Image<D>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Image<D>, DeviceError> {
        let skips = self.encode(scratch, inputs, shifts)?;
        let x = self.decode(scratch, skips, shifts)?;
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
        inputs: &Image<D>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Vec<Image<D>>, DeviceError> {
        // The last image is read first, behind the channels of the block before its reader.
        let mut in_front: Vec<u32> = self.decoder.iter().filter_map(|block| block.in_front).collect();
        let mut place = |scratch: &mut Scratch<'_, D>, size: Size| {
            let front = in_front.pop().unwrap_or(0);
            scratch.channel_slice(size, front + size.channels, front)
        };
        let mut skips: Vec<Image<D>> = Vec::new();
        // Where the last residual input is, once it is not the network's own.
        let mut residual: Option<usize> = None;
        for step in &self.encoder {
            let x = skips.last().unwrap_or(inputs);
            let next = match step {
                Step::First(layer) => {
                    let mut first = place(scratch, x.size.with_channels(layer.channels))?;
                    layer.run_into(scratch, PLAIN, x, Residual::None, &mut first)?;
                    first
                }
                Step::Block(block) => {
                    let mut next = place(scratch, block.out_size(x.size))?;
                    block.run(scratch, shifts, x, &mut next)?;
                    next
                }
                Step::Down(block, aux_residual) => {
                    let mut halved = scratch.image(block.out_size(x.size))?;
                    block.run(scratch, shifts, x, &mut halved)?;
                    let mut first = place(scratch, halved.size)?;
                    let options = ConvolutionOptions { stride: 2, padding: Some(1), scale: FRAC_1_SQRT_2, ..PLAIN };
                    let input = residual.map_or(inputs, |index| &skips[index]);
                    aux_residual.run_into(scratch, options, input, Residual::Image(&halved), &mut first)?;
                    scratch.recycle(halved);
                    residual = Some(skips.len());
                    first
                }
            };
            skips.push(next);
        }
        Ok(skips)
    }

    fn decode(
        &self,
        scratch: &mut Scratch<'_, D>,
        mut skips: Vec<Image<D>>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Image<D>, DeviceError> {
        let mut x: Option<Image<D>> = None;
        for (index, block) in self.decoder.iter().enumerate() {
            // Where the next block has a skip connection, the output goes in front of what comes through it.
            let is_joined = self.decoder.get(index + 1).is_some_and(|next| next.in_front.is_some());
            let skip = if is_joined { skips.pop() } else { None };
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
        // The last image, which lies in front of no other.
        skips.into_iter().for_each(|image| scratch.recycle(image));
        Ok(x.unwrap_or_else(|| unreachable!("a decoder has blocks")))
    }
}
