//! Layers of networks in `f64`, with bounds on what `f32` may make of them in whatever order a device sums.

use super::bounded::{Bounded, DIVISION, ROUNDING};
use super::camera_oracle::{bilinear, tents};
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};

/// What a layer reads.
#[derive(Clone, Copy, Debug)]
pub struct LayerInputs<'a> {
    /// Rows or an image.
    pub inputs: &'a [f32],
    /// `[inner][column]`.
    pub weights: &'a [f32],
    /// `[column]`.
    pub bias: &'a [f32],
    /// As the outputs, if there is one.
    pub addend: Option<&'a [f32]>,
}

impl LayerInputs<'_> {
    /// A sum in any order: bias, addend, and products of `input(inner)` with a column's weights.
    ///
    /// Of `n` summands each is rounded at most `n` times: once as a product, and in at most `n - 1` additions, in
    /// whichever order they run (Higham, "Accuracy and Stability of Numerical Algorithms", section 4.2): the bound is
    /// `n u / (1 - n u)` of the sum of magnitudes. Products that a device may flush to 0 are counted as well.
    fn sum(&self, element: usize, columns: usize, inner_count: usize, input: impl Fn(usize) -> f32) -> Bounded {
        let column = element % columns;
        let products =
            (0..inner_count).map(|inner| f64::from(input(inner)) * f64::from(self.weights[inner * columns + column]));
        let addend = self.addend.map_or(0.0, |addend| f64::from(addend[element]));
        let summands = products.chain([f64::from(self.bias[column]), addend]);
        let (sum, magnitudes) = summands.fold((0.0, 0.0), |(sum, all), next| (sum + next, all + next.abs()));
        let roundings = (inner_count + 2) as f64 * ROUNDING / 2.0;
        let flushed = (inner_count + 2) as f64 * f64::from(f32::MIN_POSITIVE);
        Bounded { value: sum, error: magnitudes * roundings / (1.0 - roundings) + flushed }
    }
}

/// The negative part cut off, or not.
fn relu(value: Bounded, relu: u32) -> Bounded {
    if relu == 0 { value } else { value.greater(Bounded::ZERO) }
}

/// Output number `element` of a matrix product.
pub fn product(layer: &LayerInputs, block: &ProductBlock, element: usize) -> Bounded {
    let (columns, inner_count) = (block.column_count as usize, block.inner_count as usize);
    let row = &layer.inputs[element / columns * inner_count..][..inner_count];
    let least = if block.relu_inputs == 0 { f32::MIN } else { 0.0 };
    relu(layer.sum(element, columns, inner_count, |inner| row[inner].max(least)), block.relu_outputs)
}

/// The pixel that place `[row, column]` of the window of an output pixel `[row, column]` lies over; `None` outside the
/// image.
fn under(out: [usize; 2], place: [usize; 2], stride: u32, padding: u32, size: [u32; 2]) -> Option<usize> {
    let at = |axis: usize| {
        let at = (out[axis] * stride as usize + place[axis]) as i64 - i64::from(padding);
        (0..i64::from(size[axis])).contains(&at).then_some(at as usize)
    };
    Some(at(0)? * size[1] as usize + at(1)?)
}

/// Output number `element` of a convolution.
pub fn convolve(layer: &LayerInputs, block: &ConvolveBlock, element: usize) -> Bounded {
    let (columns, channels, side) = (block.out_channels as usize, block.in_channels as usize, block.size as usize);
    let (pixel, out_width) = (element / columns, block.out_width as usize);
    let input = |inner: usize| {
        let place = [inner / channels / side, inner / channels % side];
        let size = [block.in_height, block.in_width];
        let under = under([pixel / out_width, pixel % out_width], place, block.stride, block.padding, size);
        under.map_or(0.0, |pixel| layer.inputs[pixel * channels + inner % channels])
    };
    relu(layer.sum(element, columns, side * side * channels, input), block.relu_outputs)
}

/// Output number `element` of pooling: exact.
pub fn max_pool(inputs: &[f32], block: &PoolBlock, element: usize) -> Bounded {
    let (channels, out_width) = (block.channels as usize, block.out_width as usize);
    let (pixel, channel) = (element / channels, element % channels);
    let out = [pixel / out_width, pixel % out_width];
    let places = (0..block.size as usize).flat_map(|row| (0..block.size as usize).map(move |column| [row, column]));
    let size = [block.in_height, block.in_width];
    places
        .filter_map(|place| under(out, place, block.stride, block.padding, size))
        .map(|pixel| inputs[pixel * channels + channel])
        .fold(f32::MIN, f32::max)
        .into()
}

/// What lies in an enlarged image at output pixel `[row, column]`, of an input channel.
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
