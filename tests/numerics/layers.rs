//! Winograd's way on the CPU, for inputs and weights of very different sizes, against `f64` loops that go another way:
//! from the inputs to the outputs.

use viewfuse::check::poses::Random;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Layer, LayerShape, Memory};
use viewfuse_kernels::network::convolve::ConvolveBlock;

fn numbers(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count).map(|_| random.normal() as f32).collect()
}

/// The output index whose window has place `place` over input index `at`, if there is one.
fn output_of(at: usize, place: usize, [stride, dilation, padding, out_count]: [usize; 4]) -> Option<usize> {
    let first = (at + padding).checked_sub(place * dilation)?;
    (first % stride == 0 && first / stride < out_count).then_some(first / stride)
}

/// A layer of 3x3 windows run by the CPU, as it comes and for large images, with its errors against `f64` in units of
/// 2^-24 of the largest sum of magnitudes: the largest, and the root of the mean of their squares.
fn convolution_errors(
    random: &mut Random,
    [height, width, channels, columns, padding]: [usize; 5],
    [input_magnitude, weight_magnitude]: [f64; 2],
) -> [[f64; 2]; 2] {
    let scaled = |numbers: Vec<f32>, magnitude: f64| -> Vec<f32> {
        numbers.into_iter().map(|number| (f64::from(number) * magnitude) as f32).collect()
    };
    let inputs = scaled(numbers(random, height * width * channels), input_magnitude);
    let weights = scaled(numbers(random, 9 * channels * columns), weight_magnitude);
    let [out_height, out_width] = [height, width].map(|count| count + 2 * padding - 2);
    let (mut expected, mut magnitudes) =
        (vec![0.0_f64; out_height * out_width * columns], vec![0.0_f64; out_height * out_width * columns]);
    for pixel in 0..height * width {
        for place in 0..9 {
            let row = output_of(pixel / width, place / 3, [1, 1, padding, out_height]);
            let column = output_of(pixel % width, place % 3, [1, 1, padding, out_width]);
            let Some((row, column)) = row.zip(column) else { continue };
            for channel in 0..channels {
                let input = f64::from(inputs[pixel * channels + channel]);
                for out in 0..columns {
                    let product = input * f64::from(weights[(place * channels + channel) * columns + out]);
                    let output = (row * out_width + column) * columns + out;
                    expected[output] += product;
                    magnitudes[output] += product.abs();
                }
            }
        }
    }
    let block = ConvolveBlock {
        in_height: height as u32,
        in_width: width as u32,
        in_channels: channels as u32,
        out_height: out_height as u32,
        out_width: out_width as u32,
        out_channels: columns as u32,
        size: 3,
        stride: 1,
        padding: padding as u32,
        ..ConvolveBlock::default()
    }
    .packed();
    [false, true].map(|has_wide_images| {
        let shape = LayerShape { inner_count: 9 * channels, column_count: columns, has_wide_images };
        let layer = Layer::new(&Cpu, &shape, &weights, &vec![0.0; columns]).expect("the CPU computes");
        let mut outputs = Cpu.zeros(expected.len()).expect("the CPU computes");
        Cpu.convolve(&block, &inputs, &layer.weights, &layer.bias, None, &mut outputs).expect("the CPU computes");
        let unit = magnitudes.iter().copied().fold(0.0, f64::max) / 16_777_216.0;
        let errors =
            outputs.iter().zip(&expected).map(|(output, expected)| (f64::from(*output) - expected).abs() / unit);
        let (largest, squares) = errors.fold((0.0_f64, 0.0), |(largest, squares), error| {
            assert!(error.is_finite(), "{block:?}");
            (largest.max(error), squares + error * error)
        });
        [largest, (squares / expected.len() as f64).sqrt()]
    })
}

#[test]
fn winograds_way_loses_little() {
    let mut random = Random::new(54);
    let sizes = [
        [1, 1, 3, 2, 1],
        [3, 3, 1, 1, 0],
        [5, 6, 40, 9, 1],
        [17, 4, 7, 33, 2],
        [32, 32, 24, 16, 1],
        [33, 37, 5, 4, 0],
        [40, 39, 64, 3, 3],
    ];
    for size in sizes {
        for magnitudes in [[1.0, 1.0], [1.0e-6, 1.0e-6], [1.0e6, 1.0e6], [1.0e6, 1.0e-6], [1.0e-6, 1.0]] {
            let [direct, winograd] = convolution_errors(&mut random, size, magnitudes);
            println!("{size:?} {magnitudes:?}: {direct:.2?} {winograd:.2?}");
            assert!(direct[0] <= 6.0 && direct[1] <= 1.5, "{size:?} {magnitudes:?}: {direct:?}");
            assert!(winograd[0] <= 64.0 && winograd[1] <= 8.0, "{size:?} {magnitudes:?}: {winograd:?}");
        }
    }
}
