//! A residual block of the U-Net, and self-attention behind it.

use super::super::image::{Image, Scratch, Size};
use super::super::layers::{Addend, Convolution, Depthwise, Loader, Norm, Way};
use super::Outcome;
use crate::FieldError;
use std::f32::consts::FRAC_1_SQRT_2;
use viewfuse_core::network::attend::MatrixBlock;
use viewfuse_device::Device;

/// What a block does to its image's size. The published filter is `[1, 1]`: the mean of 2x2 pixels, or each of them
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
    halving: Option<Depthwise<D>>,
    first_norm: Norm<D>,
    first: Convolution<D>,
    /// Where the block's shifts by noise level start.
    first_shift: u32,
    second_norm: Norm<D>,
    second: Convolution<D>,
    /// Where sizes or channels change.
    beside: Option<Convolution<D>>,
    attention: Option<Attention<D>>,
    /// Of its input.
    pub(super) in_channels: u32,
    /// Of its output.
    pub(super) channels: u32,
}

/// Self-attention with one head.
struct Attention<D: Device> {
    norm: Norm<D>,
    /// To queries, keys and values, one behind the other.
    entry: Convolution<D>,
    exit: Convolution<D>,
}

impl<D: Device> Block<D> {
    /// Reads it, for images of at least `side` rows and columns (of its output).
    pub(super) fn load(
        loader: &Loader<'_, D>,
        name: &str,
        resample: Resample,
        side: u32,
        first_shift: u32,
    ) -> Outcome<Block<D>, D> {
        let layer = |layer: &str| format!("{name}.{layer}");
        let first = loader.convolution(&layer("conv0"), side)?;
        let has = |name: &str| loader.has(&layer(&format!("{name}.weight")));
        // What is beside a block that halves sees the mean of 2x2 pixels: a window of 2x2.
        let beside = |window: super::super::layers::Window| match resample {
            Resample::Halve => window.then_halved(),
            _ => window,
        };
        let attention = || {
            Ok::<_, FieldError<D::Error>>(Attention {
                norm: loader.norm(&layer("norm2"))?,
                // Published: the three of a channel lie together.
                entry: loader.changed_convolution(&layer("qkv"), 0, |window| {
                    let channels = window.columns / 3;
                    window.reordered(|column| column % channels * 3 + column / channels)
                })?,
                exit: loader.convolution(&layer("proj"), 0)?,
            })
        };
        let halving = (resample == Resample::Halve).then(|| Depthwise::halving(loader.device)).transpose();
        Ok(Block {
            resample,
            halving: halving.map_err(FieldError::Device)?,
            in_channels: loader.tensor(&layer("norm0.weight"))?.len() as u32,
            channels: first.channels,
            first_norm: loader.norm(&layer("norm0"))?,
            first,
            first_shift,
            second_norm: loader.norm(&layer("norm1"))?,
            second: loader.convolution(&layer("conv1"), side)?,
            beside: has("skip").then(|| loader.changed_convolution(&layer("skip"), 0, beside)).transpose()?,
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
        device: &D,
        scratch: &mut Scratch<'_, D>,
        shifts: &D::Buffer<f32>,
        image: &Image<D>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let mut normalised = self.first_norm.run(scratch, device, image, true)?;
        if let Some(halving) = &self.halving {
            let way = Way { stride: 2, padding: Some(0), ..Way::PLAIN };
            let halved = halving.run(scratch, device, way, &normalised)?;
            scratch.give(std::mem::replace(&mut normalised, halved));
        }
        let enlarge = if self.resample == Resample::Double { 2 } else { 1 };
        let way = Way { enlarge, ..Way::PLAIN };
        let shift = Addend::Shared(shifts, self.first_shift);
        let inside = self.first.run(scratch, device, way, &normalised, shift)?;
        scratch.give(normalised);
        let normalised = self.second_norm.run(scratch, device, &inside, true)?;
        scratch.give(inside);
        let stride = if self.resample == Resample::Halve { 2 } else { 1 };
        let beside_way = Way { stride, padding: Some(0), ..way };
        let beside = self
            .beside
            .as_ref()
            .map(|layer| layer.run(scratch, device, beside_way, image, Addend::None))
            .transpose()?;
        let addend = Addend::Image(beside.as_ref().unwrap_or(image));
        // The sum of two independent images is brought back to the variance of one.
        let way = Way { scale: FRAC_1_SQRT_2, ..Way::PLAIN };
        match &self.attention {
            None => self.second.run_into(device, way, &normalised, addend, output)?,
            Some(attention) => {
                let sum = self.second.run(scratch, device, way, &normalised, addend)?;
                attention.run_into(device, scratch, &sum, output)?;
                scratch.give(sum);
            }
        }
        scratch.give(normalised);
        if let Some(beside) = beside {
            scratch.give(beside);
        }
        Ok(())
    }
}

impl<D: Device> Attention<D> {
    /// The image and what its pixels make of one another.
    fn run_into(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        image: &Image<D>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let (pixels, channels) = (image.size.pixel_count(), image.size.channels);
        let normalised = self.norm.run(scratch, device, image, false)?;
        let triples = self.entry.run(scratch, device, Way::PLAIN, &normalised, Addend::None)?;
        let table = Size { height: pixels, width: 1, channels: pixels };
        let (mut scores, mut weights) = (scratch.image(table)?, scratch.image(table)?);
        let block = MatrixBlock {
            row_count: pixels,
            inner_count: channels,
            column_count: pixels,
            left_pitch: 3 * channels,
            left_first: 0,
            // The keys, transposed.
            right_row_pitch: 1,
            right_column_pitch: 3 * channels,
            right_first: channels,
            scale: 1.0 / (channels as f32).sqrt(),
        };
        device.multiply_matrices(&block, &triples.values, &triples.values, &mut scores.values)?;
        device.softmax_rows(&pixels, pixels, &scores.values, &mut weights.values)?;
        let block = MatrixBlock {
            row_count: pixels,
            inner_count: pixels,
            column_count: channels,
            left_pitch: pixels,
            left_first: 0,
            right_row_pitch: 3 * channels,
            right_column_pitch: 1,
            right_first: 2 * channels,
            scale: 1.0,
        };
        let mut attended = scratch.image(image.size)?;
        device.multiply_matrices(&block, &weights.values, &triples.values, &mut attended.values)?;
        let way = Way { scale: FRAC_1_SQRT_2, ..Way::PLAIN };
        self.exit.run_into(device, way, &attended, Addend::Image(image), output)?;
        for image in [normalised, triples, scores, weights, attended] {
            scratch.give(image);
        }
        Ok(())
    }
}
