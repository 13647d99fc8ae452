//! Convolutions: full, depthwise and transposed.

use super::image::{Image, Size};
use super::scratch::Scratch;
use super::window::Windows;
use std::ops::Range;
use viewfuse_device::{Device, DeviceError, Layer, Precision};
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::depthwise::DepthwiseBlock;
use viewfuse_kernels::network::transpose::TransposedBlock;

/// A convolution with bias on a device.
pub struct Convolution<D: Device> {
    pub(crate) layer: Layer<D>,
    /// Rows and columns of the window.
    pub size: u32,
    /// Channels of the output.
    pub channels: u32,
}

/// Options of a convolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvolutionOptions {
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Pixels from one place of the window to the next.
    pub dilation: u32,
    /// Rows and columns of zeros around the image; `None`: as many as keep its size at stride 1.
    pub padding: Option<u32>,
    /// How many times each input pixel is repeated in both directions first (nearest-neighbour upsampling).
    pub upsampling: u32,
    /// Factor of the result, the residual included.
    pub scale: f32,
    /// Whether negative outputs become 0.
    pub relu: bool,
}

impl ConvolutionOptions {
    /// Outputs of the input's size.
    pub const PLAIN: ConvolutionOptions =
        ConvolutionOptions { stride: 1, dilation: 1, padding: None, upsampling: 1, scale: 1.0, relu: false };
    /// The same, rectified.
    pub const RELU: ConvolutionOptions = ConvolutionOptions { relu: true, ..ConvolutionOptions::PLAIN };

    /// Rows and columns of zeros around the image for a window of this size.
    fn padding(&self, window: u32) -> u32 {
        self.padding.unwrap_or((window - 1) * self.dilation / 2)
    }

    fn windows(&self, window: u32) -> Windows {
        let (reach, padding) = ((window - 1) * self.dilation + 1, self.padding(window));
        Windows { reach, stride: self.stride, padding, ceil_mode: false }
    }

    /// Size of the output for an input; one row or column if no window fits.
    fn out_size(&self, size: Size, window: u32, channels: u32) -> Size {
        let count = |side: u32| self.windows(window).count_at_least_one(side * self.upsampling);
        Size { height: count(size.height), width: count(size.width), channels }
    }
}

/// The residual: added to a convolution's result before it is scaled and rectified.
pub enum Residual<'a, D: Device> {
    /// Nothing.
    None,
    /// An image of its output's size.
    Image(&'a Image<D>),
    /// The same numbers at every pixel: `[channel]` from an offset in a buffer.
    Channels(&'a D::Buffer<f32>, u32),
}

impl<D: Device> Convolution<D> {
    /// Size of the output for an image of this size; `None` if the image with its padding is smaller than the window.
    pub fn out_size(&self, options: ConvolutionOptions, size: Size) -> Option<Size> {
        let windows = options.windows(self.size);
        let count = |side: u32| windows.count(side * options.upsampling);
        Some(Size { height: count(size.height)?, width: count(size.width)?, channels: self.channels })
    }

    /// Runs it into a new image. Of an image smaller than the window, the output has one row or column.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
        residual: Residual<'_, D>,
    ) -> Result<Image<D>, DeviceError> {
        let mut output = scratch.image(options.out_size(image.size, self.size, self.channels))?;
        self.run_into(scratch, options, image, residual, &mut output)?;
        Ok(output)
    }

    /// Runs it into an image of the right size.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn run_into(
        &self,
        scratch: &Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
        residual: Residual<'_, D>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let block = self.block(options, image, output);
        debug_assert_eq!([block.out_height, block.out_width], [output.size.height, output.size.width]);
        let (residual, residual_pitch, residual_first) = match residual {
            Residual::None => (None, 0, 0),
            Residual::Image(image) => (Some(&image.values), image.pitch, image.first),
            Residual::Channels(values, first) => (Some(values), 0, first),
        };
        let block = ConvolveBlock { residual_pitch, residual_first, ..block };
        self.dispatch(scratch.device(), scratch.precision, &block, image, residual, output)
    }

    /// The same for some rows alone, exact; its windows are single pixels.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn run_rows(
        &self,
        device: &D,
        options: ConvolutionOptions,
        image: &Image<D>,
        rows: Range<u32>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let block = self.block(options, image, output);
        debug_assert_eq!([block.size, block.stride], [1, 1]);
        let (height, before) = (rows.len() as u32, rows.start * block.in_width);
        let block = ConvolveBlock {
            in_height: height,
            in_first: block.in_first + before * block.in_pitch,
            out_height: height,
            out_first: block.out_first + before * block.out_pitch,
            ..block
        };
        self.dispatch(device, Precision::Exact, &block, image, None, output)
    }

    /// The parameters for an input and an output, without residual.
    fn block(&self, options: ConvolutionOptions, image: &Image<D>, output: &Image<D>) -> ConvolveBlock {
        let size = options.out_size(image.size, self.size, self.channels);
        ConvolveBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            enlarge: options.upsampling,
            out_height: size.height,
            out_width: size.width,
            out_channels: size.channels,
            out_pitch: output.pitch,
            out_first: output.first,
            size: self.size,
            stride: options.stride,
            dilation: options.dilation,
            padding: options.padding(self.size),
            scale: options.scale,
            relu_outputs: u32::from(options.relu),
            ..ConvolveBlock::default()
        }
    }

    fn dispatch(
        &self,
        device: &D,
        precision: Precision,
        block: &ConvolveBlock,
        image: &Image<D>,
        residual: Option<&D::Buffer<f32>>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let Layer { weights, bias } = &self.layer;
        device.convolve_in(precision, block, &image.values, weights, bias, residual, &mut output.values)
    }
}

/// A depthwise convolution without bias, on a device.
pub struct DepthwiseConvolution<D: Device> {
    pub(crate) weights: D::Buffer<f32>,
    pub(crate) size: u32,
    /// Whether all channels have the same window.
    pub(crate) is_shared: bool,
}

impl<D: Device> DepthwiseConvolution<D> {
    /// An average pool of 2x2 pixels, if it is run with stride 2 and no padding.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn average_pool(device: &D) -> Result<DepthwiseConvolution<D>, DeviceError> {
        Ok(DepthwiseConvolution { weights: device.upload(&[0.25; 4])?, size: 2, is_shared: true })
    }

    /// Runs it into a new image. It has no scale, upsampling or rectification.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
    ) -> Result<Image<D>, DeviceError> {
        self.run_leading(scratch, options, image, image.size.channels)
    }

    /// The same on the first `channels` channels of the image.
    fn run_leading(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
        channels: u32,
    ) -> Result<Image<D>, DeviceError> {
        debug_assert_eq!((options.scale, options.upsampling, options.relu), (1.0, 1, false));
        let size = options.out_size(image.size, self.size, channels);
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
            stride: options.stride,
            dilation: options.dilation,
            padding: options.padding(self.size),
            is_shared: u32::from(self.is_shared),
        };
        scratch.device().convolve_depthwise(&block, &image.values, &self.weights, &mut output.values)?;
        Ok(output)
    }
}

/// The first `channels` channels of an image as an image of their own: a depthwise convolution with a window of one
/// pixel and weight 1.
///
/// # Errors
/// If the device is lost or has no memory left.
pub fn leading_channels<D: Device>(
    scratch: &mut Scratch<'_, D>,
    image: &Image<D>,
    channels: u32,
) -> Result<Image<D>, DeviceError> {
    let weights = scratch.device().upload(&[1.0])?;
    let single = DepthwiseConvolution { weights, size: 1, is_shared: true };
    single.run_leading(scratch, ConvolutionOptions::PLAIN, image, channels)
}

/// A transposed convolution with bias whose stride is its window's size, on a device.
pub struct TransposedConvolution<D: Device> {
    pub(crate) layer: Layer<D>,
    pub(crate) size: u32,
    /// Channels of the output.
    pub channels: u32,
}

impl<D: Device> TransposedConvolution<D> {
    /// Runs it, rectified, into an image of the right size: the input's rows and columns times the window's size.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn run_into(&self, device: &D, image: &Image<D>, output: &mut Image<D>) -> Result<(), DeviceError> {
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
        let Layer { weights, bias } = &self.layer;
        device.convolve_transposed(&block, &image.values, weights, bias, &mut output.values)
    }
}
