//! Convolutions of single channels, transposed ones, products of matrices, and Winograd's way on the CPU, against `f64`
//! loops that go another way: from the inputs to the outputs.

use viewfuse::check::poses::Random;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Layer, LayerShape, Memory};
use viewfuse_kernels::network::attend::{MatrixBlock, matrix_element};
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::depthwise::{DepthwiseBlock, depthwise_element};
use viewfuse_kernels::network::transpose::{TransposedBlock, transposed_element};

fn numbers(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count).map(|_| random.normal() as f32).collect()
}

/// The output index whose window has place `place` over input index `at`, if there is one.
fn output_of(at: usize, place: usize, [stride, dilation, padding, out_count]: [usize; 4]) -> Option<usize> {
    let first = (at + padding).checked_sub(place * dilation)?;
    (first % stride == 0 && first / stride < out_count).then_some(first / stride)
}

#[test]
fn channels_are_filtered_by_themselves() {
    let mut random = Random::new(51);
    for case in 0..300 {
        let [height, width, channels] = [1 + random.below(9), 1 + random.below(9), 1 + random.below(6)];
        let (stride, dilation, padding, gap) =
            (1 + random.below(3), 1 + random.below(4), random.below(5), random.below(3));
        let side = 1 + random.below(3.min((height.min(width) + 2 * padding - 1) / dilation + 1));
        let [out_height, out_width] =
            [height, width].map(|count| (count + 2 * padding - (side - 1) * dilation - 1) / stride + 1);
        let block = DepthwiseBlock {
            in_height: height as u32,
            in_width: width as u32,
            in_pitch: (channels + gap) as u32,
            in_first: gap as u32,
            out_height: out_height as u32,
            out_width: out_width as u32,
            channels: channels as u32,
            size: side as u32,
            stride: stride as u32,
            dilation: dilation as u32,
            padding: padding as u32,
            is_shared: case & 1,
        };
        let inputs = numbers(&mut random, gap + height * width * (channels + gap));
        let weights = numbers(&mut random, side * side * if case & 1 == 1 { 1 } else { channels });
        let mut expected = vec![0.0; out_height * out_width * channels];
        for pixel in 0..height * width {
            for place in 0..side * side {
                let way = |out_count| [stride, dilation, padding, out_count];
                let row = output_of(pixel / width, place / side, way(out_height));
                let column = output_of(pixel % width, place % side, way(out_width));
                let Some((row, column)) = row.zip(column) else { continue };
                for channel in 0..channels {
                    let weight = weights[if case & 1 == 1 { place } else { place * channels + channel }];
                    let input = inputs[gap + pixel * (channels + gap) + channel];
                    expected[(row * out_width + column) * channels + channel] += f64::from(input) * f64::from(weight);
                }
            }
        }
        for (element, expected) in expected.into_iter().enumerate() {
            let actual = f64::from(depthwise_element(&inputs[..], &weights[..], &block, element));
            assert!((actual - expected).abs() <= 1.0e-5, "{block:?} {element}: {actual} {expected}");
        }
    }
}

#[test]
fn transposed_convolutions_put_squares_side_by_side() {
    let mut random = Random::new(52);
    for case in 0..200 {
        let [height, width, channels] = [1 + random.below(6), 1 + random.below(6), 1 + random.below(20)];
        let (size, out_channels) = (1 + random.below(3), 1 + random.below(5));
        let (in_gap, out_gap) = (random.below(3), random.below(3));
        let block = TransposedBlock {
            in_height: height as u32,
            in_width: width as u32,
            in_channels: channels as u32,
            in_pitch: (channels + in_gap) as u32,
            in_first: in_gap as u32,
            out_channels: out_channels as u32,
            out_pitch: (out_channels + out_gap) as u32,
            out_first: out_gap as u32,
            size: size as u32,
            relu_outputs: case & 1,
        };
        let inputs = numbers(&mut random, in_gap + height * width * (channels + in_gap));
        let weights = numbers(&mut random, channels * size * size * out_channels);
        let bias = numbers(&mut random, out_channels);
        let mut outputs = vec![f32::NAN; out_gap + height * width * size * size * (out_channels + out_gap)];
        for pixel in 0..block.pixel_count() {
            for column in 0..block.column_count() {
                let place = block.place(pixel, column);
                assert!(outputs[place].is_nan(), "each place once");
                outputs[place] = transposed_element(&inputs[..], &weights[..], &bias[..], &block, pixel, column);
            }
        }
        for (index, output) in outputs.into_iter().enumerate() {
            let at =
                index.checked_sub(out_gap).map(|at| (at / (out_channels + out_gap), at % (out_channels + out_gap)));
            let Some((pixel, channel)) = at.filter(|(_, channel)| *channel < out_channels) else {
                assert!(output.is_nan(), "only its own channels");
                continue;
            };
            let (row, column) = (pixel / (width * size), pixel % (width * size));
            let mut sum = f64::from(bias[channel]);
            for inner in 0..channels {
                let input = inputs[in_gap + (row / size * width + column / size) * (channels + in_gap) + inner];
                // `[input channel][row of the square][column of the square][output channel]`
                let weight = ((inner * size + row % size) * size + column % size) * out_channels + channel;
                sum += f64::from(input) * f64::from(weights[weight]);
            }
            let expected = if case & 1 == 1 { sum.max(0.0) } else { sum };
            assert!((f64::from(output) - expected).abs() <= 2.0e-5, "{block:?} {index}: {output} {expected}");
        }
    }
}

#[test]
fn matrices_may_be_columns_of_wider_ones() {
    let mut random = Random::new(53);
    for case in 0..200 {
        // Queries, keys and values side by side, as a layer makes them.
        let (pixels, channels) = (1 + random.below(9), 1 + random.below(40));
        let pitch = 3 * channels;
        let matrix = numbers(&mut random, pixels * pitch);
        let is_scores = case % 2 == 0;
        let weights = numbers(&mut random, pixels * pixels);
        let (block, left) = if is_scores {
            let [rows, inner, columns] = [pixels, channels, pixels].map(|count| count as u32);
            let block = MatrixBlock {
                row_count: rows,
                inner_count: inner,
                column_count: columns,
                left_pitch: pitch as u32,
                left_first: 0,
                right_row_pitch: 1,
                right_column_pitch: pitch as u32,
                right_first: channels as u32,
                scale: 0.3,
            };
            (block, &matrix)
        } else {
            let [rows, inner, columns] = [pixels, pixels, channels].map(|count| count as u32);
            let block = MatrixBlock {
                row_count: rows,
                inner_count: inner,
                column_count: columns,
                left_pitch: pixels as u32,
                left_first: 0,
                right_row_pitch: pitch as u32,
                right_column_pitch: 1,
                right_first: 2 * channels as u32,
                scale: 1.0,
            };
            (block, &weights)
        };
        for row in 0..pixels {
            for column in 0..block.column_count as usize {
                let product = |inner: usize| {
                    if is_scores {
                        f64::from(matrix[row * pitch + inner]) * f64::from(matrix[column * pitch + channels + inner])
                    } else {
                        let value = matrix[inner * pitch + 2 * channels + column];
                        f64::from(weights[row * pixels + inner]) * f64::from(value)
                    }
                };
                let expected = (0..block.inner_count as usize).map(product).sum::<f64>() * f64::from(block.scale);
                let element = row * block.column_count as usize + column;
                let actual = f64::from(matrix_element(&left[..], &matrix[..], &block, element));
                assert!((actual - expected).abs() <= 2.0e-5, "{block:?} {element}: {actual} {expected}");
            }
        }
    }
}

/// A layer of 3x3 windows run by the CPU, as it comes and for large images, with its errors against `f64` in units of 2^-24
/// of the largest sum of magnitudes: the largest, and the root of the mean of their squares.
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
