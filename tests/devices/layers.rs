//! Products and convolutions of awkward sizes: tiles that stick out of the matrices, steps that end within, images that
//! are some of the channels of wider ones.

use crate::candidate::{Candidate, Test};
use libtest_mimic::Failed;
use viewfuse::check::world::Numbers;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Layer, LayerShape};
use viewfuse_device::DeviceError;
use viewfuse_kernels::network::attend::MatrixBlock;
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::network::transpose::TransposedBlock;
use viewfuse_vulkan::{GpuOptions, Limits};

pub(crate) const TESTS: &[Test] = &[
    Test::new("products_of_any_size_are_the_cpus", products_of_any_size_are_the_cpus),
    Test::new("convolutions_of_any_shape_are_the_cpus", convolutions_of_any_shape_are_the_cpus),
    Test::new("transposed_convolutions_are_the_cpus", transposed_convolutions_are_the_cpus),
    Test::new("products_of_computed_matrices_are_the_cpus", products_of_computed_matrices_are_the_cpus),
];

/// Rows, inner numbers and columns.
const PRODUCTS: [[u32; 3]; 6] = [[1, 1, 1], [65, 3, 7], [1, 64, 65], [130, 64, 64], [64, 17, 128], [1000, 42, 512]];

/// Input height, width and channels, output channels, side of the window, stride, padding.
const CONVOLUTIONS: [[u32; 7]; 4] =
    [[21, 30, 3, 64, 7, 2, 3], [9, 11, 20, 70, 3, 1, 1], [13, 8, 64, 5, 1, 2, 0], [1, 1, 1, 1, 3, 1, 1]];

/// Input height, width and channels, output channels, side of the square.
const TRANSPOSED: [[u32; 5]; 4] = [[3, 5, 20, 7, 2], [1, 1, 1, 1, 1], [9, 8, 64, 33, 4], [13, 11, 5, 3, 2]];

/// What `outputs` hold before anything is written, and must still hold where nothing is.
const UNTOUCHED: f32 = -77.0;

/// Numbers of a layer: inputs, weights, bias and residual; and how many outputs there are.
struct Numbered {
    shape: LayerShape,
    inputs: Vec<f32>,
    weights: Vec<f32>,
    bias: Vec<f32>,
    residual: Vec<f32>,
    output_count: usize,
}

impl Numbered {
    /// `residual` may be the shortest of all: `[column]`.
    fn new(input_count: u32, [inner, columns]: [u32; 2], output_count: u32, residual_count: u32) -> Numbered {
        let numbers = &mut Numbers::new(u64::from(input_count + columns));
        let mut some = |count: u32| (0..count).map(|_| numbers.between(-1.0, 1.0)).collect::<Vec<f32>>();
        Numbered {
            shape: LayerShape { inner_count: inner as usize, column_count: columns as usize, has_wide_images: false },
            inputs: some(input_count),
            weights: some(inner * columns),
            bias: some(columns),
            residual: some(residual_count),
            output_count: output_count as usize,
        }
    }

    /// Outputs of a device, with one number behind the last.
    fn on<D: Device>(
        &self,
        device: &D,
        run: impl FnOnce(&D::Buffer<f32>, &Layer<D>, &D::Buffer<f32>, &mut D::Buffer<f32>) -> Result<(), DeviceError>,
    ) -> Result<Vec<f32>, DeviceError> {
        let layer = Layer::new(device, &self.shape, &self.weights, &self.bias)?;
        let mut outputs = device.upload(&vec![UNTOUCHED; self.output_count + 1])?;
        run(&device.upload(&self.inputs)?, &layer, &device.upload(&self.residual)?, &mut outputs)?;
        device.download(&outputs)
    }
}

/// Two orders of a sum of `length` products of numbers up to 1 differ by no more than this.
fn tolerance(length: u32) -> f32 {
    // Either is off by half an epsilon of the sum of magnitudes with each addition; bias and residual are terms as well.
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
        let output_count = row_count * column_count;
        let numbers = Numbered::new(row_count * inner_count, [inner_count, column_count], output_count, output_count);
        for [has_residual, relu_inputs, relu_outputs] in variants() {
            let (relu_inputs, relu_outputs) = (relu_inputs.into(), relu_outputs.into());
            let block =
                LinearBlock { row_count, inner_count, column_count, relu_inputs, relu_outputs, ..Default::default() };
            let expected = numbers.on(&Cpu, |inputs, layer, residual, outputs| {
                Cpu.linear(&block, inputs, &layer.weights, &layer.bias, has_residual.then_some(residual), outputs)
            })?;
            for device in &devices {
                let actual = numbers.on(device, |inputs, layer, residual, outputs| {
                    device.linear(
                        &block,
                        inputs,
                        &layer.weights,
                        &layer.bias,
                        has_residual.then_some(residual),
                        outputs,
                    )
                })?;
                assert_equal(&actual, &expected, inner_count, &format!("{block:?}, residual {has_residual}"))?;
            }
        }
    }
    Ok(())
}

/// The output image has the size that it must have.
fn fitted(block: ConvolveBlock) -> ConvolveBlock {
    let reach = (block.size - 1) * block.dilation + 1;
    let out = |side: u32| (side * block.enlarge + 2 * block.padding - reach) / block.stride + 1;
    ConvolveBlock { out_height: out(block.in_height), out_width: out(block.in_width), ..block }
}

/// The same convolution, and what else it may be: between channels of wider images, scaled, with one residual for all
/// pixels, with gaps in its windows, of an enlarged image, and all at once.
fn extended(block: ConvolveBlock) -> [ConvolveBlock; 6] {
    let packed = fitted(block.packed());
    let within = |block: ConvolveBlock| ConvolveBlock {
        in_pitch: block.in_channels + 3,
        in_first: 2,
        out_pitch: block.out_channels + 5,
        out_first: 4,
        residual_pitch: block.out_channels + 1,
        residual_first: 3,
        scale: 0.7,
        ..block
    };
    let broadcast = ConvolveBlock { residual_pitch: 0, ..packed };
    let dilated = fitted(ConvolveBlock { dilation: 2, padding: 2 * block.padding, ..packed });
    let enlarged = fitted(ConvolveBlock { enlarge: 2, ..packed });
    let all = fitted(ConvolveBlock { enlarge: 3, ..dilated });
    [packed, within(packed), broadcast, dilated, enlarged, ConvolveBlock { residual_pitch: 0, ..within(all) }]
}

fn convolutions_of_any_shape_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let devices = devices(candidate)?;
    for [in_height, in_width, in_channels, out_channels, size, stride, padding] in CONVOLUTIONS {
        let shape = ConvolveBlock {
            in_height,
            in_width,
            in_channels,
            out_channels,
            size,
            stride,
            padding,
            ..Default::default()
        };
        for block in extended(shape) {
            let input_count = block.in_first + in_height * in_width * block.in_pitch;
            let output_count = block.out_first + block.pixel_count() * block.out_pitch;
            let residual_count = block.residual_first + out_channels + (block.pixel_count() - 1) * block.residual_pitch;
            let numbers = Numbered::new(input_count, [block.patch_len(), out_channels], output_count, residual_count);
            for [has_residual, relu_outputs, _] in variants().take(4) {
                let block = ConvolveBlock { relu_outputs: relu_outputs.into(), ..block };
                let expected = numbers.on(&Cpu, |inputs, layer, residual, outputs| {
                    Cpu.convolve(&block, inputs, &layer.weights, &layer.bias, has_residual.then_some(residual), outputs)
                })?;
                for device in &devices {
                    let actual = numbers.on(device, |inputs, layer, residual, outputs| {
                        device.convolve(
                            &block,
                            inputs,
                            &layer.weights,
                            &layer.bias,
                            has_residual.then_some(residual),
                            outputs,
                        )
                    })?;
                    assert_equal(
                        &actual,
                        &expected,
                        block.patch_len(),
                        &format!("{block:?}, residual {has_residual}"),
                    )?;
                }
            }
        }
    }
    Ok(())
}

fn transposed_convolutions_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let devices = devices(candidate)?;
    for [in_height, in_width, in_channels, out_channels, size] in TRANSPOSED {
        for [is_within, relu_outputs, _] in variants().take(4) {
            let (more, first) = if is_within { (3, 2) } else { (0, 0) };
            let block = TransposedBlock {
                in_height,
                in_width,
                in_channels,
                in_pitch: in_channels + more,
                in_first: first,
                out_channels,
                out_pitch: out_channels + more,
                out_first: first,
                size,
                relu_outputs: relu_outputs.into(),
            };
            let input_count = block.in_first + block.pixel_count() * block.in_pitch;
            let output_count = block.out_first + block.pixel_count() * size * size * block.out_pitch;
            let numbers = Numbered::new(input_count, [in_channels, block.column_count()], output_count, 1);
            let expected = numbers.on(&Cpu, |inputs, layer, _, outputs| {
                Cpu.convolve_transposed(&block, inputs, &layer.weights, &layer.bias, outputs)
            })?;
            for device in &devices {
                let actual = numbers.on(device, |inputs, layer, _, outputs| {
                    device.convolve_transposed(&block, inputs, &layer.weights, &layer.bias, outputs)
                })?;
                assert_equal(&actual, &expected, in_channels, &format!("{block:?}"))?;
            }
        }
    }
    Ok(())
}

fn products_of_computed_matrices_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let devices = devices(candidate)?;
    for [row_count, inner_count, column_count] in PRODUCTS {
        for is_transposed in [false, true] {
            let (right_row_pitch, right_column_pitch, right_rows) =
                if is_transposed { (1, inner_count + 2, column_count) } else { (column_count + 2, 1, inner_count) };
            let block = MatrixBlock {
                row_count,
                inner_count,
                column_count,
                left_pitch: inner_count + 3,
                left_first: 2,
                right_row_pitch,
                right_column_pitch,
                // Both in one buffer.
                right_first: 2 + row_count * (inner_count + 3),
                scale: 0.3,
            };
            let input_count = block.right_first + right_rows * right_row_pitch.max(right_column_pitch);
            let numbers = Numbered::new(input_count, [1, 1], row_count * column_count, 1);
            let expected =
                numbers.on(&Cpu, |matrices, _, _, outputs| Cpu.matrix_product(&block, matrices, matrices, outputs))?;
            for device in &devices {
                let actual = numbers
                    .on(device, |matrices, _, _, outputs| device.matrix_product(&block, matrices, matrices, outputs))?;
                assert_equal(&actual, &expected, inner_count, &format!("{block:?}"))?;
            }
        }
    }
    Ok(())
}
