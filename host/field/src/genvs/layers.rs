//! Layers as both networks use them, on a device; [`loader`] reads them from a checkpoint.

mod loader;

pub(super) use loader::{Loader, Window};

use super::architecture::group_count;
use super::image::{Image, Scratch, Size};
use std::ops::Range;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::normalise::NormaliseBlock;
use viewfuse_core::network::transpose::TransposedBlock;
use viewfuse_device::{Device, Layer};

/// A convolution on a device.
pub(super) struct Convolution<D: Device> {
    layer: Layer<D>,
    size: u32,
    /// Of the output.
    pub(super) channels: u32,
}

/// How a convolution is run.
#[derive(Clone, Copy)]
pub(super) struct Way {
    /// Pixels from one window to the next.
    pub(super) stride: u32,
    /// Pixels from one place of the window to the next.
    pub(super) dilation: u32,
    /// Rows and columns of zeros around the image; `None`: as many as keep its size at stride 1.
    pub(super) padding: Option<u32>,
    /// How many times each input pixel is repeated in both directions.
    pub(super) enlarge: u32,
    /// Factor of the result.
    pub(super) scale: f32,
    /// Whether negative outputs become 0.
    pub(super) relu: bool,
}

impl Way {
    /// Image to image of the same size.
    pub(super) const PLAIN: Way = Way { stride: 1, dilation: 1, padding: None, enlarge: 1, scale: 1.0, relu: false };
    /// The same, rectified.
    pub(super) const RELU: Way = Way { relu: true, ..Way::PLAIN };

    /// Size of the output for an input and a window.
    fn out(&self, size: Size, window: u32, channels: u32) -> (Size, u32) {
        let reach = (window - 1) * self.dilation;
        let padding = self.padding.unwrap_or(reach / 2);
        let out = |side: u32| (side * self.enlarge + 2 * padding).saturating_sub(reach + 1) / self.stride + 1;
        (Size { height: out(size.height), width: out(size.width), channels }, padding)
    }
}

/// What is added to a convolution's result.
pub(super) enum Addend<'a, D: Device> {
    /// Nothing.
    None,
    /// An image of its output's size.
    Image(&'a Image<D>),
    /// The same numbers at every pixel, from a place of a buffer on.
    Shared(&'a D::Buffer<f32>, u32),
}

impl<D: Device> Convolution<D> {
    /// Runs it into a new image.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        way: Way,
        image: &Image<D>,
        addend: Addend<'_, D>,
    ) -> Result<Image<D>, D::Error> {
        let (size, _) = way.out(image.size, self.size, self.channels);
        let mut output = scratch.image(size)?;
        self.run_into(device, way, image, addend, &mut output)?;
        Ok(output)
    }

    /// Runs it into an image of the right size.
    pub(super) fn run_into(
        &self,
        device: &D,
        way: Way,
        image: &Image<D>,
        addend: Addend<'_, D>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let block = self.block(way, image, output);
        debug_assert_eq!([block.out_height, block.out_width], [output.size.height, output.size.width]);
        let (addend, addend_pitch, addend_first) = match addend {
            Addend::None => (None, 0, 0),
            Addend::Image(image) => (Some(&image.values), image.pitch, image.first),
            Addend::Shared(values, first) => (Some(values), 0, first),
        };
        let block = ConvolveBlock { addend_pitch, addend_first, ..block };
        let Layer { weights, bias } = &self.layer;
        device.convolve(&block, &image.values, weights, bias, addend, &mut output.values)
    }

    /// The same for some rows alone; its windows are single pixels.
    pub(super) fn run_rows(
        &self,
        device: &D,
        way: Way,
        image: &Image<D>,
        rows: Range<u32>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let block = self.block(way, image, output);
        debug_assert_eq!([block.size, block.stride], [1, 1]);
        let (height, before) = (rows.len() as u32, rows.start * block.in_width);
        let block = ConvolveBlock {
            in_height: height,
            in_first: block.in_first + before * block.in_pitch,
            out_height: height,
            out_first: block.out_first + before * block.out_pitch,
            ..block
        };
        let Layer { weights, bias } = &self.layer;
        device.convolve(&block, &image.values, weights, bias, None, &mut output.values)
    }

    /// The dispatch for an input and an output, without addend.
    fn block(&self, way: Way, image: &Image<D>, output: &Image<D>) -> ConvolveBlock {
        let (size, padding) = way.out(image.size, self.size, self.channels);
        ConvolveBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            enlarge: way.enlarge,
            out_height: size.height,
            out_width: size.width,
            out_channels: size.channels,
            out_pitch: output.pitch,
            out_first: output.first,
            size: self.size,
            stride: way.stride,
            dilation: way.dilation,
            padding,
            scale: way.scale,
            relu_outputs: u32::from(way.relu),
            ..ConvolveBlock::default()
        }
    }
}

/// A convolution of every channel by itself, on a device.
pub(super) struct Depthwise<D: Device> {
    weights: D::Buffer<f32>,
    size: u32,
    is_shared: bool,
}

impl<D: Device> Depthwise<D> {
    /// The mean of every 2x2 pixels: the published filter `[1, 1]` in both directions.
    pub(super) fn halving(device: &D) -> Result<Depthwise<D>, D::Error> {
        Ok(Depthwise { weights: device.upload(&[0.25; 4])?, size: 2, is_shared: true })
    }

    /// Runs it into a new image. The way's scale, enlargement and rectification are not for it.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        way: Way,
        image: &Image<D>,
    ) -> Result<Image<D>, D::Error> {
        let (size, padding) = way.out(image.size, self.size, image.size.channels);
        let mut output = scratch.image(size)?;
        let block = DepthwiseBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_pitch: image.pitch,
            in_first: image.first,
            out_height: size.height,
            out_width: size.width,
            channels: size.channels,
            size: self.size,
            stride: way.stride,
            dilation: way.dilation,
            padding,
            is_shared: u32::from(self.is_shared),
        };
        device.convolve_depthwise(&block, &image.values, &self.weights, &mut output.values)?;
        Ok(output)
    }
}

/// A transposed convolution on a device.
pub(super) struct Transposed<D: Device> {
    layer: Layer<D>,
    size: u32,
    /// Of the output.
    pub(super) channels: u32,
}

impl<D: Device> Transposed<D> {
    /// Runs it, rectified, into an image of the right size.
    pub(super) fn run_into(&self, device: &D, image: &Image<D>, output: &mut Image<D>) -> Result<(), D::Error> {
        let block = TransposedBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            out_channels: self.channels,
            out_pitch: output.pitch,
            out_first: output.first,
            size: self.size,
            relu_outputs: 1,
        };
        device.convolve_transposed(&block, &image.values, &self.layer.weights, &self.layer.bias, &mut output.values)
    }
}

/// A group normalisation on a device.
pub(super) struct Norm<D: Device> {
    weights: D::Buffer<f32>,
    bias: D::Buffer<f32>,
}

/// What is added to variances (`networks.py`).
const VARIANCE_FLOOR: f32 = 1.0e-6;

impl<D: Device> Norm<D> {
    /// Normalises an image into a new one.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        image: &Image<D>,
        silu: bool,
    ) -> Result<Image<D>, D::Error> {
        let channels = image.size.channels;
        let block = NormaliseBlock {
            pixel_count: image.size.pixel_count(),
            channels,
            in_pitch: image.pitch,
            in_first: image.first,
            group_count: group_count(channels as usize) as u32,
            variance_floor: VARIANCE_FLOOR,
            silu_outputs: u32::from(silu),
        };
        let mut parts = device.zeros((block.part_count() * block.group_count) as usize)?;
        let mut moments = device.zeros(block.group_count as usize)?;
        device.part_moments(&block, &image.values, &mut parts)?;
        device.merge_moments(&block, &parts, &mut moments)?;
        let mut output = scratch.image(image.size)?;
        device.normalise(&block, &image.values, &moments, &self.weights, &self.bias, &mut output.values)?;
        Ok(output)
    }
}
