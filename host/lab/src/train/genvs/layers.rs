//! Layers by their names in a checkpoint, as both networks of GeNVS use them.

use super::super::images::{convolve_with, dims4};
use super::super::operations::{Apply, DepthwiseConvolution, Normalise, Window};
use super::super::parameters::Parameters;
use candle_core::{Result, Tensor};
use viewfuse_field::genvs::group_count;

/// Added to variances (epsilon), as in the field.
const VARIANCE_FLOOR: f64 = 1.0e-6;

/// Layers of a part of the network.
#[derive(Clone, Copy)]
pub(super) struct Layers<'a> {
    pub(super) parameters: &'a Parameters,
    /// The prefix of all names.
    pub(super) prefix: &'a str,
    /// Whether the parameters need no gradients.
    pub(super) is_frozen: bool,
}

impl Layers<'_> {
    /// A parameter.
    pub(super) fn get(&self, name: &str) -> Result<Tensor> {
        let parameter = self.parameters.get(&format!("{}{name}", self.prefix))?;
        Ok(if self.is_frozen { parameter.detach() } else { parameter.clone() })
    }

    /// A convolution without bias, rectified or not.
    pub(super) fn plain(&self, name: &str, images: &Tensor, window: Window, rectifies: bool) -> Result<Tensor> {
        let weights = self.get(&format!("{name}.weight"))?;
        let biases = Tensor::zeros(weights.dim(0)?, weights.dtype(), weights.device())?;
        convolved(images, [&weights, &biases], window, rectifies)
    }

    /// A convolution with bias, rectified or not.
    pub(super) fn convolved(&self, name: &str, images: &Tensor, window: Window, rectifies: bool) -> Result<Tensor> {
        let [weights, biases] = [self.get(&format!("{name}.weight"))?, self.get(&format!("{name}.bias"))?];
        convolved(images, [&weights, &biases], window, rectifies)
    }

    /// A depthwise convolution, then a 1x1 convolution, rectified.
    pub(super) fn separable(&self, name: &str, images: &Tensor, dilation: usize) -> Result<Tensor> {
        let weights = self.get(&format!("{name}.0.weight"))?;
        let weights = weights.flatten_from(1)?.t()?.contiguous()?;
        let window = Window { padding: dilation, dilation, ..Window::same(3) };
        let operation = DepthwiseConvolution { input: dims4(images)?, window };
        let inside = images.contiguous()?.apply_op2(&weights, Apply(operation))?;
        self.plain(&format!("{name}.1"), &inside, Window::same(1), true)
    }

    /// A transposed 2x2 convolution, rectified.
    pub(super) fn doubled(&self, name: &str, images: &Tensor) -> Result<Tensor> {
        let [count, height, width, channels] = dims4(images)?;
        let weights = self.get(&format!("{name}.weight"))?;
        let outs = weights.dim(1)?;
        // To [row][column][out][in]: a convolution of single pixels.
        let weights = weights.permute((2, 3, 1, 0))?.reshape((4 * outs, channels, 1, 1))?;
        let biases = self.get(&format!("{name}.bias"))?;
        let biases = Tensor::cat(&[&biases; 4], 0)?;
        let squares = convolved(images, [&weights, &biases], Window::same(1), true)?;
        let squares = squares.reshape(vec![count, height, width, 2, 2, outs])?;
        squares.permute(vec![0, 1, 3, 2, 4, 5])?.reshape((count, 2 * height, 2 * width, outs))
    }

    /// A group norm, with SiLU behind it or not.
    pub(super) fn normalised(&self, name: &str, images: &Tensor, silu: bool) -> Result<Tensor> {
        let input = dims4(images)?;
        let operation = Normalise { input, group_count: group_count(input[3]), variance_floor: VARIANCE_FLOOR, silu };
        let (weights, biases) = (self.get(&format!("{name}.weight"))?, self.get(&format!("{name}.bias"))?);
        images.contiguous()?.apply_op3(&weights, &biases, Apply(operation))
    }

    /// A fully connected layer on rows.
    pub(super) fn linear(&self, name: &str, rows: &Tensor) -> Result<Tensor> {
        let weights = self.get(&format!("{name}.weight"))?;
        rows.matmul(&weights.t()?)?.broadcast_add(&self.get(&format!("{name}.bias"))?)
    }
}

/// A convolution with these weights and biases. The input pictures need no gradient.
pub(super) fn convolved(images: &Tensor, layer: [&Tensor; 2], window: Window, rectifies: bool) -> Result<Tensor> {
    convolve_with(images, layer, window, images.track_op(), rectifies)
}
