//! Layers of networks in `f64`, with bounds on the error of `f32` for any order of summation.

use super::bounded::{Bounded, DIVISION, ROUNDING};
use super::camera_oracle::{bilinear, tents};
use super::winograd_oracle::{SIDE, Tile};
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::depthwise::DepthwiseBlock;
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_kernels::network::transpose::TransposedBlock;

/// The inputs of a layer.
#[derive(Clone, Copy, Debug)]
pub struct LayerInputs<'a> {
    /// Rows or an image.
    pub inputs: &'a [f32],
    /// `[inner][column]`.
    pub weights: &'a [f32],
    /// `[column]`.
    pub bias: &'a [f32],
    /// The residual in the outputs' shape, if there is one.
    pub residual: Option<&'a [f32]>,
}

impl LayerInputs<'_> {
    /// A sum in any order: bias, residual, and products of `input(inner)` with a column's weights.
    fn sum(
        &self,
        element: usize,
        [inner_count, columns]: [usize; 2],
        column: usize,
        input: impl Fn(usize) -> f32,
    ) -> Bounded {
        let products =
            (0..inner_count).map(|inner| f64::from(input(inner)) * f64::from(self.weights[inner * columns + column]));
        let residual = self.residual.map_or(0.0, |residual| f64::from(residual[element]));
        Bounded::sum(products.chain([f64::from(self.bias[column]), residual]))
    }
}

/// Rectified, or not.
fn relu(value: Bounded, relu: u32) -> Bounded {
    if relu == 0 { value } else { value.greater(Bounded::ZERO) }
}

/// Output number `element` of a linear layer.
pub fn linear(layer: &LayerInputs, block: &LinearBlock, element: usize) -> Bounded {
    let (columns, inner_count) = (block.column_count as usize, block.inner_count as usize);
    let row = &layer.inputs[element / columns * inner_count..][..inner_count];
    let least = if block.relu_inputs == 0 { f32::MIN } else { 0.0 };
    let sum = layer.sum(element, [inner_count, columns], element % columns, |inner| row[inner].max(least));
    relu(sum, block.relu_outputs)
}

/// Positions of windows on an image.
#[derive(Clone, Copy, Debug)]
struct Windows {
    /// Rows and columns of the image, enlarged.
    size: [u32; 2],
    stride: u32,
    dilation: u32,
    padding: u32,
}

impl Windows {
    /// The row and column that place `[row, column]` of the window of an output pixel `[row, column]` lies over; `None`
    /// outside the image.
    fn under(&self, out: [usize; 2], place: [usize; 2]) -> Option<[usize; 2]> {
        let at = |axis: usize| {
            let at = out[axis] * self.stride as usize + place[axis] * self.dilation as usize;
            at.checked_sub(self.padding as usize).filter(|at| *at < self.size[axis] as usize)
        };
        Some([at(0)?, at(1)?])
    }
}

/// The input of a convolution at `[row, column]` of its image, counted from `-padding`: 0 outside.
fn seen(layer: &LayerInputs, block: &ConvolveBlock, out: [usize; 2], place: [usize; 2], channel: usize) -> f32 {
    let size = [block.in_height, block.in_width].map(|side| side * block.enlarge);
    let windows = Windows { size, stride: block.stride, dilation: block.dilation, padding: block.padding };
    windows.under(out, place).map_or(0.0, |at| {
        let [row, column] = at.map(|at| at / block.enlarge as usize);
        let pixel = row * block.in_width as usize + column;
        layer.inputs[block.in_first as usize + pixel * block.in_pitch as usize + channel]
    })
}

/// Channel `channel` of output pixel `pixel` of a convolution whose products are summed one by one.
pub fn convolve(layer: &LayerInputs, block: &ConvolveBlock, pixel: usize, channel: usize) -> Bounded {
    ended(block, convolve_sum(layer, block, pixel, channel))
}

/// The same of a layer for large images, for which a device may use Winograd's algorithm.
pub fn convolve_wide(layer: &LayerInputs, block: &ConvolveBlock, pixel: usize, channel: usize) -> Bounded {
    let sum = convolve_sum(layer, block, pixel, channel);
    let side = [block.out_height, block.out_width].map(|side| side as usize);
    let corner = [pixel / side[1], pixel % side[1]].map(|at| at / SIDE * SIDE);
    let tile = Tile {
        place: [pixel / side[1] - corner[0], pixel % side[1] - corner[1]],
        channels: block.in_channels as usize,
        input: |place, inner| f64::from(seen(layer, block, corner, place, inner)),
        weight: |[row, column]: [usize; 2], inner| {
            let inner = (row * 3 + column) * block.in_channels as usize + inner;
            f64::from(layer.weights[inner * block.out_channels as usize + channel])
        },
    };
    ended(block, Bounded { error: sum.error + tile.error(), ..sum })
}

/// Bias, residual and products.
fn convolve_sum(layer: &LayerInputs, block: &ConvolveBlock, pixel: usize, channel: usize) -> Bounded {
    let (columns, channels, side) = (block.out_channels as usize, block.in_channels as usize, block.size as usize);
    let out = [pixel / block.out_width as usize, pixel % block.out_width as usize];
    let input = |inner: usize| {
        let place = [inner / channels / side, inner / channels % side];
        seen(layer, block, out, place, inner % channels)
    };
    let residual = block.residual_first as usize + pixel * block.residual_pitch as usize + channel;
    layer.sum(residual, [side * side * channels, columns], channel, input)
}

/// Scaled and rectified.
fn ended(block: &ConvolveBlock, sum: Bounded) -> Bounded {
    relu(sum * Bounded::from(block.scale), block.relu_outputs)
}

/// Channel `channel` of output pixel `pixel` of a depthwise convolution.
pub fn depthwise(inputs: &[f32], weights: &[f32], block: &DepthwiseBlock, pixel: usize, channel: usize) -> Bounded {
    let size = [block.in_height, block.in_width];
    let windows = Windows { size, stride: block.stride, dilation: block.dilation, padding: block.padding };
    let (side, channels) = (block.size as usize, block.channels as usize);
    let out = [pixel / block.out_width as usize, pixel % block.out_width as usize];
    let product = |place: usize| {
        let [row, column] = windows.under(out, [place / side, place % side])?;
        let pixel = row * block.in_width as usize + column;
        let input = inputs[block.in_first as usize + pixel * block.in_pitch as usize + channel];
        let weight = if block.is_shared == 1 { weights[place] } else { weights[place * channels + channel] };
        Some(f64::from(input) * f64::from(weight))
    };
    Bounded::sum((0..side * side).filter_map(product))
}

/// Channel `channel` of the output pixel at `[row, column]` of a transposed convolution.
pub fn transposed(layer: &LayerInputs, block: &TransposedBlock, at: [usize; 2], channel: usize) -> Bounded {
    let size = block.size as usize;
    let [row, column] = at.map(|at| at / size);
    let pixel =
        &layer.inputs[block.in_first as usize + (row * block.in_width as usize + column) * block.in_pitch as usize..];
    let columns = size * size * block.out_channels as usize;
    let corner = (at[0] % size * size + at[1] % size) * block.out_channels as usize + channel;
    let products = (0..block.in_channels as usize)
        .map(|inner| f64::from(pixel[inner]) * f64::from(layer.weights[inner * columns + corner]));
    relu(Bounded::sum(products.chain([f64::from(layer.bias[channel])])), block.relu_outputs)
}

/// Output number `element` of max pool: exact.
pub fn max_pool(inputs: &[f32], block: &PoolBlock, element: usize) -> Bounded {
    let (channels, out_width) = (block.channels as usize, block.out_width as usize);
    let (pixel, channel) = (element / channels, element % channels);
    let out = [pixel / out_width, pixel % out_width];
    let places = (0..block.size as usize).flat_map(|row| (0..block.size as usize).map(move |column| [row, column]));
    let size = [block.in_height, block.in_width];
    let windows = Windows { size, stride: block.stride, dilation: 1, padding: block.padding };
    places
        .filter_map(|place| windows.under(out, place))
        .map(|[row, column]| inputs[(row * block.in_width as usize + column) * channels + channel])
        .fold(f32::MIN, f32::max)
        .into()
}

/// An upsampled image at output pixel `[row, column]`, of an input channel.
pub fn upsample(inputs: &[f32], block: &UpsampleBlock, row: u32, column: u32, channel: usize) -> Bounded {
    let (width, channels) = (block.in_width as usize, block.in_channels as usize);
    let coordinate = |index: u32, out_count: u32, in_count: u32| {
        if out_count == 1 {
            return Bounded::from(0.5);
        }
        let value = f64::from(index) * f64::from(in_count - 1) / f64::from(out_count - 1);
        // A quotient and a product; and 0.5 added, for which there are the shares' own roundings.
        Bounded { value: value + 0.5, error: (DIVISION + ROUNDING) * value + ROUNDING * (value + 0.5) }
    };
    let columns = tents(coordinate(column, block.out_width, block.in_width), block.in_width);
    let rows = tents(coordinate(row, block.out_height, block.in_height), block.in_height);
    bilinear(|row, column| inputs[(row * width + column) * channels + channel], &columns, &rows)
}
