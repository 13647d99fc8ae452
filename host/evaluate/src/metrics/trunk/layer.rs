//! A convolution's parameters: from a checkpoint to a device.

use super::{Convolution, Step};
use crate::metrics::MetricError;
use viewfuse_device::{Device, Layer, LayerShape};
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// What Inception's batch norm adds to variances.
const VARIANCE_FLOOR: f64 = 1.0e-3;

/// A convolution with its parameters on a device. Kernels know square windows: those of one row or one column lie in the
/// middle of a square of zeros, which changes no sum and makes Inception compute about twice as much.
pub(super) struct Loaded<D: Device> {
    pub(super) layer: Layer<D>,
    pub(super) channels: u32,
    /// Side of the square.
    pub(super) side: u32,
    pub(super) stride: u32,
    /// Zeros around the image.
    pub(super) padding: u32,
}

/// Takes steps to a device.
pub(super) fn load<D: Device>(
    device: &D,
    checkpoint: &Checkpoint,
    steps: &[Step<Convolution>],
) -> Result<Vec<Step<Loaded<D>>>, MetricError<D::Error>> {
    let step = |step: &Step<Convolution>| {
        Ok(match step {
            Step::Convolve(convolution) => Step::Convolve(Loaded::read(device, checkpoint, convolution)?),
            Step::Largest(window) => Step::Largest(*window),
            Step::Mean { counts_border } => Step::Mean { counts_border: *counts_border },
            Step::RootMeanSquare => Step::RootMeanSquare,
            Step::Beside(branches) => {
                Step::Beside(branches.iter().map(|branch| load(device, checkpoint, branch)).collect::<Result<_, _>>()?)
            }
            Step::Tap => Step::Tap,
        })
    };
    steps.iter().map(step).collect()
}

impl<D: Device> Loaded<D> {
    fn read(
        device: &D,
        checkpoint: &Checkpoint,
        convolution: &Convolution,
    ) -> Result<Loaded<D>, MetricError<D::Error>> {
        let (kernel, bias) = kernel_and_bias(checkpoint, convolution)?;
        let [rows, columns] = convolution.window;
        let (side, channels) = (rows.max(columns), convolution.channels);
        let [above, left] = [rows, columns].map(|length| (side - length) / 2);
        debug_assert_eq!(convolution.padding[0] + above, convolution.padding[1] + left, "{}", convolution.name);
        let in_channels = kernel.len() / (channels * rows * columns);
        // From `[out][in][row][column]` to `[row][column][in][out]`.
        let mut weights = vec![0.0; side * side * in_channels * channels];
        for (at, value) in kernel.into_iter().enumerate() {
            let (column, rest) = (at % columns, at / columns);
            let (row, rest) = (rest % rows, rest / rows);
            let (in_channel, out_channel) = (rest % in_channels, rest / in_channels);
            let place = (row + above) * side + column + left;
            weights[(place * in_channels + in_channel) * channels + out_channel] = value;
        }
        let inner_count = side * side * in_channels;
        // Scores are to be exact: no device may take another way for large images.
        let shape = LayerShape { inner_count, column_count: channels, has_wide_images: false };
        Ok(Loaded {
            layer: Layer::new(device, &shape, &weights, &bias).map_err(MetricError::Device)?,
            channels: channels as u32,
            side: side as u32,
            stride: convolution.stride as u32,
            padding: (convolution.padding[0] + above) as u32,
        })
    }
}

/// The weights `[out][in][row][column]` and the bias; a batch norm is folded in (in `f64`).
fn kernel_and_bias(
    checkpoint: &Checkpoint,
    convolution: &Convolution,
) -> Result<(Vec<f32>, Vec<f32>), CheckpointError> {
    let tensor = |leaf: &str| checkpoint.tensor(&format!("{}.{leaf}", convolution.name));
    if !convolution.is_normalised {
        return Ok((tensor("weight")?, tensor("bias")?));
    }
    let (mut kernel, scale, shift) = (tensor("conv.weight")?, tensor("bn.weight")?, tensor("bn.bias")?);
    let (mean, variance) = (tensor("bn.running_mean")?, tensor("bn.running_var")?);
    let per_channel = kernel.len() / convolution.channels;
    let mut bias = Vec::with_capacity(convolution.channels);
    for (channel, weights) in kernel.chunks_exact_mut(per_channel).enumerate() {
        let factor = f64::from(scale[channel]) / (f64::from(variance[channel]).max(0.0) + VARIANCE_FLOOR).sqrt();
        weights.iter_mut().for_each(|weight| *weight = (f64::from(*weight) * factor) as f32);
        bias.push((f64::from(shift[channel]) - f64::from(mean[channel]) * factor) as f32);
    }
    Ok((kernel, bias))
}
