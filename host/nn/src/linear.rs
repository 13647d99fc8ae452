//! Linear layers.

use viewfuse_device::{Device, DeviceError, Layer};
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

/// Rectification at a linear layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinearOptions {
    /// Whether negative inputs count as 0.
    pub relu_inputs: bool,
    /// Whether negative outputs become 0.
    pub relu_outputs: bool,
}

impl LinearOptions {
    /// Nothing is rectified.
    pub const PLAIN: LinearOptions = LinearOptions { relu_inputs: false, relu_outputs: false };
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
        device.linear(&block, inputs, weights, bias, residual, outputs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::LinearWeights;
    use viewfuse_device::cpu::Cpu;

    #[test]
    fn the_device_agrees_with_the_host() -> Result<(), DeviceError> {
        let weights = LinearWeights::new(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], vec![10.0, -20.0]);
        let layer = weights.load(&Cpu)?;
        assert_eq!((layer.in_count, layer.out_count), (3, 2));
        let inputs = vec![1.0, 0.5, -1.0, 0.0, 2.0, 0.25];
        let mut outputs = vec![0.0; 4];
        layer.run(&Cpu, 2, LinearOptions::PLAIN, &inputs, None, &mut outputs)?;
        let expected: Vec<f32> = inputs.chunks(3).flat_map(|row| weights.run(row)).collect();
        assert_eq!(outputs, expected);
        let options = LinearOptions { relu_inputs: true, relu_outputs: true };
        layer.run(&Cpu, 2, options, &inputs, Some(&vec![0.0, 0.0, 1.0, 2.0]), &mut outputs)?;
        assert_eq!(outputs, [12.0, 0.0, 15.75, 0.0]);
        Ok(())
    }
}
