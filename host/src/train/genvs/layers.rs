//! Layers by their names in a checkpoint, as both networks of GeNVS use them.

use super::super::images::{convolve, dims4};
use super::super::operations::{Apply, DepthwiseConvolution, Normalise, Shift, Window};
use super::super::parameters::Parameters;
use crate::field::genvs::group_count;
use candle_core::{Result, Tensor};

/// What is added to variances, as the field has it.
const VARIANCE_FLOOR: f64 = 1.0e-6;

/// Layers of a part of the network.
#[derive(Clone, Copy)]
pub(super) struct Layers<'a> {
    pub(super) parameters: &'a Parameters,
    /// What all names begin with.
    pub(super) prefix: &'a str,
    /// Whether nobody asks for the parameters' gradients.
    pub(super) is_frozen: bool,
}

impl Layers<'_> {
    /// A parameter.
    pub(super) fn get(&self, name: &str) -> Result<Tensor> {
        let parameter = self.parameters.get(&format!("{}{name}", self.prefix))?;
        Ok(if self.is_frozen { parameter.detach() } else { parameter.clone() })
    }

    /// A convolution without bias. Pictures, the first thing that is looked at, need no gradient.
    pub(super) fn plain(&self, name: &str, images: &Tensor, window: Window) -> Result<Tensor> {
        let weights = self.get(&format!("{name}.weight"))?;
        convolve(images, &weights, window, images.track_op() || images.is_variable())
    }

    /// A convolution with bias.
    pub(super) fn convolved(&self, name: &str, images: &Tensor, window: Window) -> Result<Tensor> {
        shifted(&self.plain(name, images, window)?, &self.get(&format!("{name}.bias"))?, false)
    }

    /// A convolution with bias, rectified.
    pub(super) fn rectified(&self, name: &str, images: &Tensor, window: Window) -> Result<Tensor> {
        shifted(&self.plain(name, images, window)?, &self.get(&format!("{name}.bias"))?, true)
    }

    /// A filter for every channel, then single pixels mixed, rectified.
    pub(super) fn separable(&self, name: &str, images: &Tensor, dilation: usize) -> Result<Tensor> {
        let weights = self.get(&format!("{name}.0.weight"))?;
        let weights = weights.flatten_from(1)?.t()?.contiguous()?;
        let window = Window { padding: dilation, dilation, ..Window::same(3) };
        let operation = DepthwiseConvolution { input: dims4(images)?, window };
        let inside = images.contiguous()?.apply_op2(&weights, Apply(operation))?;
        self.plain(&format!("{name}.1"), &inside, Window::same(1))?.relu()
    }

    /// Every pixel as a square of four, rectified.
    pub(super) fn doubled(&self, name: &str, images: &Tensor) -> Result<Tensor> {
        let [count, height, width, channels] = dims4(images)?;
        let weights = self.get(&format!("{name}.weight"))?;
        let outs = weights.dim(1)?;
        // To [row][column][out][in]: a convolution of single pixels.
        let weights = weights.permute((2, 3, 1, 0))?.reshape((4 * outs, channels, 1, 1))?;
        let squares =
            convolve(images, &weights, Window::same(1), true)?.reshape(vec![count, height, width, 2, 2, outs])?;
        let image = squares.permute(vec![0, 1, 3, 2, 4, 5])?.reshape((count, 2 * height, 2 * width, outs))?;
        shifted(&image, &self.get(&format!("{name}.bias"))?, true)
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

/// Images with shifts `[channel]` or `[image][channel]` added.
pub(super) fn shifted(images: &Tensor, shifts: &Tensor, rectifies: bool) -> Result<Tensor> {
    let operation = Shift { input: dims4(images)?, is_own: shifts.rank() == 2, rectifies };
    images.contiguous()?.apply_op2(&shifts.contiguous()?, Apply(operation))
}
