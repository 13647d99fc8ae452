//! Images in the graph: `[image][row][column][channel]`, as kernels have them.

use super::operations::{Apply, Convolution, Window};
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

/// A convolution with weights `[out][in][row][column]` and biases `[out]` or, each image its own, `[image][out]`, rectified
/// or not.
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

/// Bilinear upsampling with aligned corners, as matrix products with constant matrices.
pub(crate) fn enlarge(images: &Tensor, height: usize, width: usize) -> Result<Tensor> {
    let [count, in_height, in_width, channels] = dims4(images)?;
    if (in_height, in_width) == (height, width) {
        return Ok(images.clone());
    }
    let mixing = |outer: usize, inner: usize| -> Result<Tensor> {
        let mut values = vec![0_f32; outer * inner];
        for (index, row) in values.chunks_exact_mut(inner).enumerate() {
            let at = viewfuse_core::network::resample::aligned(index as u32, outer as u32, inner as u32);
            let (before, behind, share) = viewfuse_core::lookup::split(at, inner as u32);
            row[before] += 1.0 - share;
            row[behind] += share;
        }
        Tensor::from_vec(values, (outer, inner), images.device())?.to_dtype(images.dtype())
    };
    let rows = images.contiguous()?.reshape((count, in_height, in_width * channels))?;
    let tall = mixing(height, in_height)?.broadcast_matmul(&rows)?.reshape((count * height, in_width, channels))?;
    mixing(width, in_width)?.broadcast_matmul(&tall)?.reshape((count, height, width, channels))
}

/// The four sizes of images.
pub(crate) fn dims4(images: &Tensor) -> Result<[usize; 4]> {
    let (count, height, width, channels) = images.dims4()?;
    Ok([count, height, width, channels])
}
