//! Self-attention of an image's pixels.

use super::image::{Image, Size};
use super::scratch::Scratch;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::network::attend::MatrixBlock;

/// Scaled dot-product attention with one head: of `qkv[pixel][query, key, value][channel]`, an image that fills its
/// buffer, each pixel's mean of all values, weighted by the softmax of `query . key / sqrt(channels)`.
///
/// # Errors
/// If the device is lost or has no memory left.
pub fn self_attention<D: Device>(scratch: &mut Scratch<'_, D>, qkv: &Image<D>) -> Result<Image<D>, DeviceError> {
    let device = scratch.device();
    let (pixels, channels) = (qkv.size.pixel_count(), qkv.size.channels / 3);
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
    device.matrix_product(&block, &qkv.values, &qkv.values, &mut scores.values)?;
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
    let mut attended = scratch.image(qkv.size.with_channels(channels))?;
    device.matrix_product(&block, &weights.values, &qkv.values, &mut attended.values)?;
    scratch.recycle(scores);
    scratch.recycle(weights);
    Ok(attended)
}
