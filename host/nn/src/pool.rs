//! Pools: max pool and global average pool as kernels; the 3x3 average pool and DISTS' L2 pool on the host, in `f64`,
//! because no kernel computes them: their images are downloaded and uploaded again.

use super::image::{HostImage, Image, Size};
use super::scratch::Scratch;
use super::window::Windows;
use viewfuse_device::parallel::for_each_row;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::network::group_norm::MeanBlock;
use viewfuse_kernels::network::resample::PoolBlock;

/// Max pool over square windows, channel by channel; places outside of the image do not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaxPool {
    /// Rows and columns of the window.
    pub size: u32,
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Padding: how far windows reach over the border.
    pub padding: u32,
    /// Whether a last window may reach over the bottom and right padding (PyTorch's `ceil_mode`).
    pub ceil_mode: bool,
}

impl MaxPool {
    fn windows(&self) -> Windows {
        let MaxPool { size, stride, padding, ceil_mode } = *self;
        Windows { reach: size, stride, padding, ceil_mode }
    }

    /// Size of the output for an image of this size; `None` if the image is smaller than the window.
    pub fn out_size(&self, size: Size) -> Option<Size> {
        let windows = self.windows();
        Some(Size { height: windows.count(size.height)?, width: windows.count(size.width)?, ..size })
    }

    /// Pools an image that fills its buffer. Of an image smaller than the window, the output has one row or column.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub fn run<D: Device>(&self, scratch: &mut Scratch<'_, D>, image: &Image<D>) -> Result<Image<D>, DeviceError> {
        let count = |side: u32| self.windows().count_at_least_one(side);
        let size = Size { height: count(image.size.height), width: count(image.size.width), ..image.size };
        let block = PoolBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            out_height: size.height,
            out_width: size.width,
            channels: size.channels,
            size: self.size,
            stride: self.stride,
            padding: self.padding,
        };
        let mut output = scratch.image(size)?;
        scratch.device().max_pool(&block, &image.values, &mut output.values)?;
        Ok(output)
    }
}

/// The mean of every channel of an image that fills its buffer, as an image of one pixel.
///
/// # Errors
/// If the device is lost or has no memory left.
pub fn global_average_pool<D: Device>(scratch: &mut Scratch<'_, D>, image: &Image<D>) -> Result<Image<D>, DeviceError> {
    let Size { channels, .. } = image.size;
    let mut mean = scratch.image(Size { height: 1, width: 1, channels })?;
    let block = MeanBlock { pixel_count: image.size.pixel_count(), channels };
    scratch.device().channel_means(&block, &image.values, &mut mean.values)?;
    Ok(mean)
}

/// The mean of the 3x3 pixels around each pixel. Pixels outside of the image count as zeros, or, without
/// `count_include_pad`, are left out.
pub fn average_pool(image: &HostImage, count_include_pad: bool) -> HostImage {
    pooled(image, [image.height, image.width], 1, |window, channel| {
        let (mut sum, mut count) = (0.0, 0);
        for (_, pixel) in window {
            sum += f64::from(pixel[channel]);
            count += 1;
        }
        sum / if count_include_pad { 9.0 } else { f64::from(count) }
    })
}

/// Added by DISTS before the square root.
const L2_POOL_EPSILON: f64 = 1.0e-12;

/// DISTS' L2 pool: the root of the squares, blurred with `[1, 2, 1] / 4` in both directions, at every second pixel;
/// outside of the image there are zeros.
pub fn l2_pool(image: &HostImage) -> HostImage {
    let size = [image.height.div_ceil(2), image.width.div_ceil(2)];
    pooled(image, size, 2, |window, channel| {
        let sum: f64 = window
            .map(|([row, column], pixel)| {
                // 1, 2, 1 in both directions.
                let share = (2 - row.abs_diff(1)) * (2 - column.abs_diff(1));
                share as f64 / 16.0 * f64::from(pixel[channel]).powi(2)
            })
            .sum();
        (sum + L2_POOL_EPSILON).sqrt()
    })
}

/// A position in a window of 3x3 and the channels of the pixel there.
type WindowPixel<'a> = ([usize; 2], &'a [f32]);

/// An image of `size`: `value` of the 3x3 window around every `stride`-th pixel.
fn pooled(
    image: &HostImage,
    size: [usize; 2],
    stride: usize,
    value: impl Fn(&mut dyn Iterator<Item = WindowPixel<'_>>, usize) -> f64 + Sync,
) -> HostImage {
    let [height, width] = size;
    let channels = image.channels;
    let mut values = vec![0.0; height * width * channels];
    for_each_row(&mut values, channels, 512, |pixel, outputs| {
        let (top, left) = (pixel / width * stride, pixel % width * stride);
        let window: Vec<WindowPixel<'_>> = (0..9)
            .map(|place| [place / 3, place % 3])
            .filter_map(|[row, column]| {
                // Outside of the image the difference is none.
                let (y, x) = ((top + row).checked_sub(1)?, (left + column).checked_sub(1)?);
                (y < image.height && x < image.width).then(|| ([row, column], image.pixel(y, x)))
            })
            .collect();
        for (channel, output) in outputs.iter_mut().enumerate() {
            *output = value(&mut window.iter().copied(), channel) as f32;
        }
    });
    HostImage { height, width, channels, values }
}
