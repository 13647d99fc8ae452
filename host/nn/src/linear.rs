//! Linear layers.

use viewfuse_device::{Device, DeviceError, Layer, Precision};
use viewfuse_kernels::network::linear::LinearBlock;

/// A linear layer on a device: `outputs[row][output] = bias[output] + sum over inputs of inputs[row][input] *
/// weights[input][output]`.
pub struct Linear<D: Device> {
    pub(crate) layer: Layer<D>,
    /// The number of inputs.
    pub in_count: u32,
    /// The number of outputs.
    pub out_count: u32,
}

/// Options of a linear layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinearOptions {
    /// Whether negative inputs count as 0.
    pub relu_inputs: bool,
    /// Whether negative outputs become 0.
    pub relu_outputs: bool,
    /// The precision of its products, on devices that have another than the exact one.
    pub precision: Precision,
}

impl LinearOptions {
    /// Nothing is rectified, and products are exact.
    pub const PLAIN: LinearOptions =
        LinearOptions { relu_inputs: false, relu_outputs: false, precision: Precision::Exact };
    /// Negative outputs become 0.
    pub const RELU: LinearOptions = LinearOptions { relu_outputs: true, ..LinearOptions::PLAIN };

    /// The same in another precision.
    pub const fn in_precision(self, precision: Precision) -> LinearOptions {
        LinearOptions { precision, ..self }
    }
}

impl<D: Device> Linear<D> {
    /// Runs it on the first `row_count` rows of buffers: `inputs[row][input]`, `outputs[row][output]`, and a `residual`
    /// of the outputs' shape that is added before the outputs are rectified.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn run(
        &self,
        device: &D,
        row_count: u32,
        options: LinearOptions,
        inputs: &D::Buffer<f32>,
        residual: Option<&D::Buffer<f32>>,
        outputs: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let block = LinearBlock {
            row_count,
            inner_count: self.in_count,
            column_count: self.out_count,
            relu_inputs: u32::from(options.relu_inputs),
            relu_outputs: u32::from(options.relu_outputs),
            ..LinearBlock::default()
        };
        let Layer { weights, bias } = &self.layer;
        device.linear_in(options.precision, &block, inputs, weights, bias, residual, outputs)
    }
}
