//! The denoiser's network: a U-Net of residual blocks with group normalisation and self-attention, told the noise level,
//! its encoder fed with the halved input once more at every level.
//!
//! Source: `networks.py` (`SongUNet` with `residual` encoder and `positional` embedding), from Karras et al. 2022 and Song
//! et al. 2021. An image that skips from the encoder to the decoder is written, when it is made, behind the channels that
//! will stand in front of it there: nothing is copied.

mod block;
mod embedding;

use super::architecture::COLOUR_CHANNELS;
use super::image::{Image, Scratch, Size};
use super::layers::{Addend, Convolution, Loader, Norm, Way};
use crate::FieldError;
use block::{Block, Resample};
use embedding::{Embedding, Parts};
use std::f32::consts::FRAC_1_SQRT_2;
use viewfuse_core::genvs::DenoiserInputBlock;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::Device;

/// Channels of a picture.
const PICTURE_CHANNELS: u32 = COLOUR_CHANNELS as u32;

/// A level of the encoder.
struct Level<D: Device> {
    /// What halves the image of the level before; at the first level there is none.
    down: Option<Down<D>>,
    blocks: Vec<Block<D>>,
}

/// The way from a level to the next.
struct Down<D: Device> {
    block: Block<D>,
    /// The network's input, or what it became a level before, halved and brought to the level's channels.
    residual: Convolution<D>,
}

/// A level of the decoder: blocks that join nothing, then those that join what skipped.
struct Rise<D: Device> {
    alone: Vec<Block<D>>,
    joining: Vec<Block<D>>,
}

/// The denoiser's layers on a device.
pub(super) struct Denoiser<D: Device> {
    embedding: Embedding<D>,
    entry: Convolution<D>,
    levels: Vec<Level<D>>,
    rises: Vec<Rise<D>>,
    exit_norm: Norm<D>,
    exit: Convolution<D>,
}

/// Reads blocks, and gathers what the noise level shifts in each.
struct Blocks<'a, 'b, D: Device> {
    loader: &'a Loader<'b, D>,
    shifts: Parts,
}

impl<D: Device> Blocks<'_, '_, D> {
    fn load(&mut self, level: &str, what: &str, resample: Resample, side: u32) -> Outcome<Block<D>, D> {
        let name = format!("{level}_{what}");
        let first_shift = self.shifts.push(self.loader, &name)?;
        Block::load(self.loader, &name, resample, side, first_shift)
    }

    /// `block0`, `block1` and so on, as many as there are.
    fn load_all(&mut self, level: &str, side: u32) -> Outcome<Vec<Block<D>>, D> {
        let mut blocks = Vec::new();
        while self.loader.has(&format!("{level}_block{}.norm0.weight", blocks.len())) {
            blocks.push(self.load(level, &format!("block{}", blocks.len()), Resample::None, side)?);
        }
        Ok(blocks)
    }
}

type Outcome<T, D> = Result<T, FieldError<<D as viewfuse_device::Memory>::Error>>;

impl<D: Device> Denoiser<D> {
    /// Reads it, for pictures of at least `side` rows and columns. `resolutions` are its levels' in the names of the
    /// tensors, from the largest, at least one.
    ///
    /// # Errors
    /// If the checkpoint cannot be read, or the device has no room.
    pub(super) fn load(loader: &Loader<'_, D>, side: u32, resolutions: &[u32]) -> Outcome<Denoiser<D>, D> {
        let mut blocks = Blocks { loader, shifts: Parts::default() };
        let (mut levels, mut rises) = (Vec::new(), Vec::new());
        for (depth, resolution) in resolutions.iter().enumerate() {
            let (side, name) = (side >> depth, format!("enc.{resolution}x{resolution}"));
            let down = match depth {
                0 => None,
                _ => Some(Down {
                    block: blocks.load(&name, "down", Resample::Halve, side)?,
                    residual: loader
                        .changed_convolution(&format!("{name}_aux_residual"), 0, |window| window.then_halved())?,
                }),
            };
            levels.push(Level { down, blocks: blocks.load_all(&name, side)? });
        }
        for (depth, resolution) in resolutions.iter().enumerate().rev() {
            let (side, name) = (side >> depth, format!("dec.{resolution}x{resolution}"));
            let alone = if rises.is_empty() {
                vec![blocks.load(&name, "in0", Resample::None, side)?, blocks.load(&name, "in1", Resample::None, side)?]
            } else {
                vec![blocks.load(&name, "up", Resample::Double, side)?]
            };
            rises.push(Rise { alone, joining: blocks.load_all(&name, side)? });
        }
        let largest = resolutions[0];
        let (first, last) = (format!("enc.{largest}x{largest}"), format!("dec.{largest}x{largest}"));
        Ok(Denoiser {
            embedding: Embedding::load(loader, blocks.shifts)?,
            entry: loader.convolution(&format!("{first}_conv"), side)?,
            levels,
            rises,
            exit_norm: loader.norm(&format!("{last}_aux_norm"))?,
            exit: loader.convolution(&format!("{last}_aux_conv"), side)?,
        })
    }

    /// The network's output (red, green, blue a pixel) for a noisy picture `[row][column][3]` and a condition
    /// `[row][column][channel]`. Rows and columns are multiples of two to the number of halvings.
    ///
    /// # Errors
    /// If the device is lost or has no room.
    pub(super) fn run(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        noisy: &D::Buffer<f32>,
        condition: &Image<D>,
        at: &Preconditioning,
    ) -> Result<Image<D>, D::Error> {
        let size = condition.size;
        let block = DenoiserInputBlock {
            picture_channels: PICTURE_CHANNELS,
            condition_channels: size.channels,
            scale: at.input,
        };
        let mut inputs = scratch.image(size.with_channels(PICTURE_CHANNELS + size.channels))?;
        device.denoiser_input(&block, size.pixel_count(), noisy, &condition.values, &mut inputs.values)?;
        let shifts = self.embedding.shifts(device, at.noise)?;
        let skips = self.encode(device, scratch, inputs, &shifts)?;
        let x = self.decode(device, scratch, skips, &shifts)?;
        let normalised = self.exit_norm.run(scratch, device, &x, true)?;
        let output = self.exit.run(scratch, device, Way::PLAIN, &normalised, Addend::None)?;
        scratch.give(x);
        scratch.give(normalised);
        Ok(output)
    }

    /// All that skips to the decoder, in the order in which it is made.
    fn encode(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        inputs: Image<D>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Vec<Image<D>>, D::Error> {
        let mut in_front = self.channels_in_front().into_iter();
        let mut place = |scratch: &mut Scratch<'_, D>, size: Size| {
            let front = in_front.next().unwrap_or(0);
            scratch.beside(size, front + size.channels, front)
        };
        let mut skips: Vec<Image<D>> = Vec::new();
        // Where the first image of the level before is, once there is one.
        let mut residual: Option<usize> = None;
        for level in &self.levels {
            let first = match (&level.down, skips.last()) {
                (Some(down), Some(x)) => {
                    let mut halved = scratch.image(down.block.out_size(x.size))?;
                    down.block.run(device, scratch, shifts, x, &mut halved)?;
                    let mut first = place(scratch, halved.size)?;
                    let way = Way { stride: 2, padding: Some(1), scale: FRAC_1_SQRT_2, ..Way::PLAIN };
                    let given = residual.map_or(&inputs, |index| &skips[index]);
                    down.residual.run_into(device, way, given, Addend::Image(&halved), &mut first)?;
                    scratch.give(halved);
                    residual = Some(skips.len());
                    first
                }
                _ => {
                    let mut first = place(scratch, inputs.size.with_channels(self.entry.channels))?;
                    self.entry.run_into(device, Way::PLAIN, &inputs, Addend::None, &mut first)?;
                    first
                }
            };
            skips.push(first);
            for block in &level.blocks {
                let x = &skips[skips.len() - 1];
                let mut next = place(scratch, block.out_size(x.size))?;
                block.run(device, scratch, shifts, x, &mut next)?;
                skips.push(next);
            }
        }
        scratch.give(inputs);
        Ok(skips)
    }

    /// How many channels will stand in front of each image that skips, in the order in which they are made.
    fn channels_in_front(&self) -> Vec<u32> {
        let mut made = Vec::new();
        for level in &self.levels {
            made.push(level.down.as_ref().map_or(self.entry.channels, |down| down.block.channels));
            made.extend(level.blocks.iter().map(|block| block.channels));
        }
        // The last one made is joined first.
        let joining = self.rises.iter().flat_map(|rise| &rise.joining).map(|block| block.in_channels);
        let mut in_front: Vec<u32> = made.iter().rev().zip(joining).map(|(own, all)| all - own).collect();
        in_front.reverse();
        in_front
    }

    fn decode(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        mut skips: Vec<Image<D>>,
        shifts: &D::Buffer<f32>,
    ) -> Result<Image<D>, D::Error> {
        let mut x: Option<Image<D>> = None;
        for rise in &self.rises {
            let count = rise.alone.len() + rise.joining.len();
            for (index, block) in rise.alone.iter().chain(&rise.joining).enumerate() {
                let joins_next = index + 1 >= rise.alone.len() && index + 1 < count;
                // Where the next block joins what skipped, the output goes in front of that.
                let skip = if joins_next { skips.pop() } else { None };
                // The first block reads the last image that skips, and joins nothing.
                let input = x.as_ref().unwrap_or_else(|| &skips[skips.len() - 1]);
                let size = block.out_size(input.size);
                let mut output = match skip {
                    Some(skip) => skip.seen_as(0, size.channels),
                    None => scratch.image(size)?,
                };
                block.run(device, scratch, shifts, input, &mut output)?;
                if let Some(x) = x.take() {
                    scratch.give(x);
                }
                let channels = output.pitch;
                x = Some(output.seen_as(0, channels));
            }
        }
        Ok(x.unwrap_or_else(|| unreachable!("a decoder has blocks")))
    }
}
