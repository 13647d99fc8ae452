//! Images in the graph: `[image][row][column][channel]`, as kernels have them.

use super::operations::{AddEnlarged, Apply, Convolution, Window};
use candle_core::{Result, Tensor};

/// A convolution with weights as checkpoints have them, `[out][in][row][column]`, without bias.
pub(crate) fn convolve(
    images: &Tensor,
    weights: &Tensor,
    window: Window,
    differentiates_input: bool,
) -> Result<Tensor> {
    let biases = Tensor::zeros(weights.dim(0)?, weights.dtype(), weights.device())?;
    convolve_with(images, [weights, &biases], window, differentiates_input, false)
}

/// A convolution with weights `[out][in][row][column]` and biases `[out]` or, each image its own, `[image][out]`,
/// rectified or not.
pub(crate) fn convolve_with(
    images: &Tensor,
    [weights, biases]: [&Tensor; 2],
    window: Window,
    differentiates_input: bool,
    rectifies: bool,
) -> Result<Tensor> {
    let weights = weights.permute((0, 2, 3, 1))?.contiguous()?;
    let (input, out_channels) = (dims4(images)?, weights.dim(0)?);
    let has_own_biases = biases.rank() == 2;
    let operation = Convolution { input, out_channels, window, has_own_biases, rectifies, differentiates_input };
    images.contiguous()?.apply_op3(&weights, &biases.contiguous()?, Apply(operation))
}

/// Max pool with windows of 3x3 and stride 2, of images without negative values.
pub(crate) fn max_pool(images: &Tensor) -> Result<Tensor> {
    let along = |images: &Tensor, axis: usize| -> Result<Tensor> {
        // The side must be even; zeros outside change no maximum of non-negative values.
        let odd = images.dim(axis)? % 2;
        let padded = images.pad_with_zeros(axis, 0, odd)?;
        let mut pairs = padded.dims().to_vec();
        pairs[axis] /= 2;
        pairs.insert(axis + 1, 2);
        let pairs = padded.reshape(pairs)?;
        let [even, odd] = [0, 1].map(|which| pairs.narrow(axis + 1, which, 1)?.squeeze(axis + 1));
        let (even, odd) = (even?, odd?);
        let before = odd.narrow(axis, 0, odd.dim(axis)? - 1)?.pad_with_zeros(axis, 1, 0)?;
        even.maximum(&odd)?.maximum(&before)
    };
    along(&along(images, 1)?, 2)
}

/// Bilinear upsampling with aligned corners.
pub(crate) fn enlarge(images: &Tensor, height: usize, width: usize) -> Result<Tensor> {
    let [count, rows, columns, channels] = dims4(images)?;
    if (rows, columns) == (height, width) {
        return Ok(images.clone());
    }
    add_enlarged(&Tensor::zeros((count, height, width, channels), images.dtype(), images.device())?, images)
}

/// Images with smaller ones, which are enlarged as [`enlarge`] does, added.
pub(crate) fn add_enlarged(images: &Tensor, small: &Tensor) -> Result<Tensor> {
    let (size, [_, rows, columns, _]) = (dims4(images)?, dims4(small)?);
    let operation = AddEnlarged { size, small: [rows, columns] };
    images.contiguous()?.apply_op2(&small.contiguous()?, Apply(operation))
}

/// The four sizes of images.
pub(crate) fn dims4(images: &Tensor) -> Result<[usize; 4]> {
    let (count, height, width, channels) = images.dims4()?;
    Ok([count, height, width, channels])
}
