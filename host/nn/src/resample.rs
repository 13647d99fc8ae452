//! Upsampling and concatenation by channels.

use super::image::Image;
use super::scratch::Scratch;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::network::resample::UpsampleBlock;

/// Upsamples an image that fills its buffer to the size of another, bilinear with aligned corners, into the channels of
/// that one's buffer from `first_channel` on. To an image of its own size, the values are copied.
///
/// # Errors
/// If the device is lost.
pub fn upsample<D: Device>(
    device: &D,
    image: &Image<D>,
    first_channel: u32,
    output: &mut Image<D>,
) -> Result<(), DeviceError> {
    let block = UpsampleBlock {
        in_height: image.size.height,
        in_width: image.size.width,
        in_channels: image.size.channels,
        out_height: output.size.height,
        out_width: output.size.width,
        out_channels: output.pitch,
        first_channel,
    };
    device.upsample(&block, &image.values, &mut output.values)
}

/// Concatenates images that fill their buffers by channels, in their order, in a new one of the first one's rows and
/// columns. Smaller images are upsampled as by [`upsample`].
///
/// # Errors
/// If the device is lost or has no memory left.
///
/// # Panics
/// Without images.
pub fn concatenate<D: Device>(scratch: &mut Scratch<'_, D>, images: &[&Image<D>]) -> Result<Image<D>, DeviceError> {
    let channels = images.iter().map(|image| image.size.channels).sum();
    let mut wide = scratch.image(images[0].size.with_channels(channels))?;
    let mut first_channel = 0;
    for image in images {
        upsample(scratch.device(), image, first_channel, &mut wide)?;
        first_channel += image.size.channels;
    }
    Ok(wide)
}
