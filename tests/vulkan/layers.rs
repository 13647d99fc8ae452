//! Products and convolutions of awkward sizes: tiles that stick out of the matrices, steps that end within.

use crate::candidate::{Candidate, Test};
use libtest_mimic::Failed;
use viewfuse::check::world::Numbers;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Layer, Memory, NetworkKernels};
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_vulkan::{GpuOptions, Limits};

pub(crate) const TESTS: &[Test] = &[
    Test::new("products_of_any_size_are_the_cpus", products_of_any_size_are_the_cpus),
    Test::new("convolutions_of_any_shape_are_the_cpus", convolutions_of_any_shape_are_the_cpus),
];

/// Rows, inner numbers and columns.
const PRODUCTS: [[u32; 3]; 6] = [[1, 1, 1], [65, 3, 7], [1, 64, 65], [130, 64, 64], [64, 17, 128], [1000, 42, 512]];

/// Input height, width and channels, output channels, side of the window, stride, padding.
const CONVOLUTIONS: [[u32; 7]; 4] =
    [[21, 30, 3, 64, 7, 2, 3], [9, 11, 20, 70, 3, 1, 1], [13, 8, 64, 5, 1, 2, 0], [1, 1, 1, 1, 3, 1, 1]];

/// What `outputs` hold before anything is written, and must still hold behind the last one.
const UNTOUCHED: f32 = -77.0;

/// Numbers of a layer: inputs, weights, bias and addend.
struct Numbered {
    inputs: Vec<f32>,
    weights: Vec<f32>,
    bias: Vec<f32>,
    addend: Vec<f32>,
}

impl Numbered {
    fn new(input_count: u32, inner: u32, columns: u32, output_count: u32) -> Numbered {
        let numbers = &mut Numbers::new(u64::from(input_count + columns));
        let mut some = |count: u32| (0..count).map(|_| numbers.between(-1.0, 1.0)).collect::<Vec<f32>>();
        Numbered {
            inputs: some(input_count),
            weights: some(inner * columns),
            bias: some(columns),
            addend: some(output_count),
        }
    }

    /// Outputs of a device, with one number behind the last.
    fn on<D: Memory>(
        &self,
        device: &D,
        run: impl FnOnce(&D::Buffer<f32>, &Layer<D>, &D::Buffer<f32>, &mut D::Buffer<f32>) -> Result<(), D::Error>,
    ) -> Result<Vec<f32>, D::Error> {
        let layer = Layer::new(device.upload(&self.weights)?, device.upload(&self.bias)?);
        let mut outputs = device.upload(&vec![UNTOUCHED; self.addend.len() + 1])?;
        run(&device.upload(&self.inputs)?, &layer, &device.upload(&self.addend)?, &mut outputs)?;
        device.download(&outputs)
    }
}

/// Two orders of a sum of `length` products of numbers up to 1 differ by no more than this.
fn tolerance(length: u32) -> f32 {
    // Either is off by half an epsilon of the sum of magnitudes with each addition; bias and addend are terms as well.
    let terms = length as f32 + 2.0;
    terms * terms * f32::EPSILON
}

fn assert_equal(actual: &[f32], expected: &[f32], length: u32, what: &str) -> Result<(), Failed> {
    assert_eq!((actual.len(), actual.last()), (expected.len(), Some(&UNTOUCHED)), "{what}");
    let differs = |(actual, expected): (&f32, &f32)| !((actual - expected).abs() <= tolerance(length));
    match actual.iter().zip(expected).position(differs) {
        None => Ok(()),
        Some(at) => Err(format!("{what}: output {at}: {} instead of {}", actual[at], expected[at]).into()),
    }
}

/// The device as it is, and with so few workgroups that large products are cut.
fn devices(candidate: &Candidate) -> Result<[Vulkan; 2], Failed> {
    let limits = Limits { workgroup_count: 3, ..GpuOptions::default().limits };
    let own = GpuOptions::default();
    Ok([candidate.vulkan(&own)?, candidate.vulkan(&GpuOptions { limits, ..own })?])
}

/// Every combination of what a layer may do besides.
fn variants() -> impl Iterator<Item = [bool; 3]> {
    (0..8).map(|bits| [bits & 1 != 0, bits & 2 != 0, bits & 4 != 0])
}

fn products_of_any_size_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let devices = devices(candidate)?;
    for [row_count, inner_count, column_count] in PRODUCTS {
        let numbers = Numbered::new(row_count * inner_count, inner_count, column_count, row_count * column_count);
        for [has_addend, relu_inputs, relu_outputs] in variants() {
            let (relu_inputs, relu_outputs) = (relu_inputs.into(), relu_outputs.into());
            let block =
                ProductBlock { row_count, inner_count, column_count, relu_inputs, relu_outputs, ..Default::default() };
            let expected = numbers.on(&Cpu, |inputs, layer, addend, outputs| {
                Cpu.product(&block, inputs, layer, has_addend.then_some(addend), outputs)
            })?;
            for device in &devices {
                let actual = numbers.on(device, |inputs, layer, addend, outputs| {
                    device.product(&block, inputs, layer, has_addend.then_some(addend), outputs)
                })?;
                assert_equal(&actual, &expected, inner_count, &format!("{block:?}, addend {has_addend}"))?;
            }
        }
    }
    Ok(())
}

fn convolutions_of_any_shape_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let devices = devices(candidate)?;
    for [in_height, in_width, in_channels, out_channels, size, stride, padding] in CONVOLUTIONS {
        let out = |side: u32| (side + 2 * padding - size) / stride + 1;
        let shape = ConvolveBlock {
            in_height,
            in_width,
            in_channels,
            out_height: out(in_height),
            out_width: out(in_width),
            out_channels,
            size,
            stride,
            padding,
            ..Default::default()
        };
        let input_count = in_height * in_width * in_channels;
        let numbers = Numbered::new(input_count, shape.patch_len(), out_channels, shape.pixel_count() * out_channels);
        for [has_addend, relu_outputs, _] in variants().take(4) {
            let block = ConvolveBlock { relu_outputs: relu_outputs.into(), ..shape };
            let expected = numbers.on(&Cpu, |inputs, layer, addend, outputs| {
                Cpu.convolve(&block, inputs, layer, has_addend.then_some(addend), outputs)
            })?;
            for device in &devices {
                let actual = numbers.on(device, |inputs, layer, addend, outputs| {
                    device.convolve(&block, inputs, layer, has_addend.then_some(addend), outputs)
                })?;
                assert_equal(&actual, &expected, shape.patch_len(), &format!("{block:?}, addend {has_addend}"))?;
            }
        }
    }
    Ok(())
}
