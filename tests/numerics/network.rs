//! Layers of networks against direct loops in `f64`, and what degenerate input gives.

use viewfuse::check::compare::Comparator;
use viewfuse::check::poses::Random;
use viewfuse_kernels::network::convolve::{ConvolveBlock, convolve_element};
use viewfuse_kernels::network::linear::{LinearBlock, linear_element, rectified};
use viewfuse_kernels::network::resample::{PoolBlock, UpsampleBlock, aligned, pooled_element, upsampled_element};

fn numbers(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count).map(|_| random.normal() as f32).collect()
}

/// Numbers with zeros around them: what a network's padding is.
fn at(image: &[f32], [height, width, channels]: [usize; 3], row: i64, column: i64, channel: usize) -> Option<f64> {
    let inside = (0..height as i64).contains(&row) && (0..width as i64).contains(&column);
    inside.then(|| f64::from(image[(row as usize * width + column as usize) * channels + channel]))
}

/// Channels put into a wider image of NaN, `gap` in front of every pixel's and behind.
fn widened(image: &[f32], channels: usize, gap: usize) -> Vec<f32> {
    let around = vec![f32::NAN; gap];
    image.chunks_exact(channels).flat_map(|pixel| [&around, pixel, &around].concat()).collect()
}

#[test]
fn products_are_sums_of_products() {
    let mut random = Random::new(41);
    for case in 0..200 {
        let [rows, inner, columns] = [1 + random.below(9), 1 + random.below(200), 1 + random.below(9)];
        let [relu_inputs, relu_outputs, has_residual] = [case & 1, case >> 1 & 1, case >> 2 & 1];
        let block = LinearBlock {
            row_count: rows as u32,
            inner_count: inner as u32,
            column_count: columns as u32,
            relu_inputs,
            relu_outputs,
            has_residual,
        };
        let inputs = numbers(&mut random, rows * inner);
        let weights = numbers(&mut random, inner * columns);
        let bias = numbers(&mut random, columns);
        // Without a residual nothing of it may be read.
        let residual = if has_residual == 1 { numbers(&mut random, rows * columns) } else { Vec::new() };
        for element in 0..rows * columns {
            let (row, column) = (element / columns, element % columns);
            let mut sum = f64::from(bias[column]) + residual.get(element).map_or(0.0, |residual| f64::from(*residual));
            let mut size = sum.abs() + 8.0;
            for index in 0..inner {
                let input = f64::from(inputs[row * inner + index]);
                let input = if relu_inputs == 1 { input.max(0.0) } else { input };
                sum += input * f64::from(weights[index * columns + column]);
                size += (input * f64::from(weights[index * columns + column])).abs();
            }
            let expected = if relu_outputs == 1 { sum.max(0.0) } else { sum };
            let absolute = (inner + 2) as f64 * size / 16_777_216.0;
            let actual = linear_element(&inputs[..], &weights[..], &bias[..], &residual[..], &block, element);
            Comparator { absolute, relative: 0.0 }.compare(&[actual], &[expected]).unwrap_or_else(|e| panic!("{e}"));
        }
    }
}

#[test]
fn rectification_at_its_ends() {
    for (x, expected) in [(2.0, 2.0), (-2.0, 0.0), (0.0, 0.0), (f32::NEG_INFINITY, 0.0), (f32::INFINITY, f32::INFINITY)]
    {
        assert_eq!(rectified(x, 1), expected);
    }
    assert_eq!(rectified(-2.0, 0), -2.0);
    for relu in [0, 1] {
        assert!(rectified(f32::NAN, relu).is_nan());
    }
}

#[test]
fn convolutions_are_direct_loops() {
    let mut random = Random::new(42);
    for case in 0..400 {
        let size = [1 + random.below(7), 1 + random.below(7), 1 + random.below(5)];
        let [height, width, channels] = size;
        let (stride, padding, out_channels) = (1 + random.below(3), random.below(4), 1 + random.below(4));
        let (enlarge, dilation) = (1 + random.below(3), 1 + random.below(3));
        let room = height.min(width) * enlarge + 2 * padding;
        let side = 1 + random.below(3.min((room - 1) / dilation + 1));
        let out = |inner: usize| (inner * enlarge + 2 * padding - (side - 1) * dilation - 1) / stride + 1;
        let (relu, has_residual, is_shared) = (case & 1, case >> 1 & 1, case >> 2 & 1);
        let [in_gap, out_gap, residual_gap] = [0, 1, 2].map(|_| random.below(3));
        let block = ConvolveBlock {
            in_height: height as u32,
            in_width: width as u32,
            in_channels: channels as u32,
            in_pitch: (channels + 2 * in_gap) as u32,
            in_first: in_gap as u32,
            enlarge: enlarge as u32,
            out_height: out(height) as u32,
            out_width: out(width) as u32,
            out_channels: out_channels as u32,
            out_pitch: (out_channels + 2 * out_gap) as u32,
            out_first: out_gap as u32,
            size: side as u32,
            stride: stride as u32,
            dilation: dilation as u32,
            padding: padding as u32,
            scale: random.range(0.5, 1.5) as f32,
            relu_outputs: relu,
            has_residual,
            residual_pitch: if is_shared == 1 { 0 } else { (out_channels + 2 * residual_gap) as u32 },
            residual_first: residual_gap as u32,
        };
        let image = numbers(&mut random, height * width * channels);
        let inputs = widened(&image, channels, in_gap);
        let weights = numbers(&mut random, side * side * channels * out_channels);
        let bias = numbers(&mut random, out_channels);
        let residuals = numbers(&mut random, if is_shared == 1 { 1 } else { out(height) * out(width) } * out_channels);
        // Without a residual nothing of it may be read.
        let residual = if has_residual == 1 { widened(&residuals, out_channels, residual_gap) } else { Vec::new() };
        for out_row in 0..out(height) {
            for out_column in 0..out(width) {
                for column in 0..out_channels {
                    let pixel = out_row * out(width) + out_column;
                    let own = if is_shared == 1 { column } else { pixel * out_channels + column };
                    let mut sum = f64::from(bias[column]) + f64::from(has_residual) * f64::from(residuals[own]);
                    for window_row in 0..side {
                        for window_column in 0..side {
                            let row = (out_row * stride + window_row * dilation) as i64 - padding as i64;
                            let place = (out_column * stride + window_column * dilation) as i64 - padding as i64;
                            // In the image before it was enlarged; what lies before it stays there.
                            let [row, place] = [row, place].map(|at| at.div_euclid(enlarge as i64));
                            for channel in 0..channels {
                                let inner = (window_row * side + window_column) * channels + channel;
                                let weight = f64::from(weights[inner * out_channels + column]);
                                sum += weight * at(&image, size, row, place, channel).unwrap_or(0.0);
                            }
                        }
                    }
                    let expected = f64::from(block.scale) * if relu == 1 { sum.max(0.0) } else { sum };
                    let (pixel, channel) = (pixel as u32, column as u32);
                    let actual =
                        convolve_element(&inputs[..], &weights[..], &bias[..], &residual[..], &block, pixel, channel);
                    // At most 47 summands of at most 16 each, most of them far smaller.
                    assert!((f64::from(actual) - expected).abs() <= 3.0e-5, "{block:?} {pixel}: {actual} {expected}");
                    let place = out_gap + pixel as usize * block.out_pitch as usize + column;
                    assert_eq!(block.place(pixel, channel), place);
                }
            }
        }
    }
}

#[test]
fn packed_images_lie_side_by_side() {
    let block = ConvolveBlock { in_channels: 5, out_channels: 7, size: 3, padding: 1, ..ConvolveBlock::default() };
    let packed = block.packed();
    let whole = [packed.in_pitch, packed.out_pitch, packed.residual_pitch, packed.enlarge, packed.dilation];
    assert_eq!((whole, packed.scale), ([5, 7, 7, 1, 1], 1.0));
    assert_eq!([packed.in_first, packed.out_first, packed.residual_first], [0; 3]);
    assert_eq!((packed.size, packed.padding, packed.place(3, 2)), (3, 1, 23));
}

#[test]
fn pooling_takes_the_largest() {
    let mut random = Random::new(43);
    for _ in 0..300 {
        let size = [1 + random.below(9), 1 + random.below(9), 1 + random.below(5)];
        let [height, width, channels] = size;
        let (stride, padding) = (1 + random.below(3), random.below(3));
        let side = 1 + random.below(4.min(height.min(width) + 2 * padding));
        let out = |inner: usize| (inner + 2 * padding - side) / stride + 1;
        let block = PoolBlock {
            in_height: height as u32,
            in_width: width as u32,
            out_height: out(height) as u32,
            out_width: out(width) as u32,
            channels: channels as u32,
            size: side as u32,
            stride: stride as u32,
            padding: padding as u32,
        };
        // Negative everywhere: a border that counted as 0 would win.
        let inputs: Vec<f32> = (0..height * width * channels).map(|_| -0.1 - random.unit() as f32).collect();
        for element in 0..out(height) * out(width) * channels {
            let (pixel, channel) = (element / channels, element % channels);
            let (out_row, out_column) = (pixel / out(width), pixel % out(width));
            let places = (0..side * side).map(|place| (place / side, place % side));
            let seen = places.filter_map(|(row, column)| {
                let row = (out_row * stride + row) as i64 - padding as i64;
                at(&inputs, size, row, (out_column * stride + column) as i64 - padding as i64, channel)
            });
            let expected = seen.fold(-f64::from(f32::MAX), f64::max);
            assert_eq!(f64::from(pooled_element(&inputs[..], &block, element)), expected, "{block:?} {element}");
        }
    }
}

fn enlarge(inputs: &[f32], size: [u32; 3], out: [u32; 2]) -> Vec<f32> {
    let [in_height, in_width, in_channels] = size;
    let [out_height, out_width] = out;
    let block = UpsampleBlock {
        in_height,
        in_width,
        in_channels,
        out_height,
        out_width,
        out_channels: in_channels + 3,
        first_channel: 2,
    };
    let mut wide = vec![f32::NAN; (out_height * out_width * block.out_channels) as usize];
    for element in 0..(out_height * out_width * in_channels) as usize {
        let place = block.place(element);
        assert!(wide[place].is_nan(), "each place once");
        wide[place] = upsampled_element(inputs, &block, element);
    }
    for (index, value) in wide.iter().enumerate() {
        let channel = index as u32 % block.out_channels;
        assert_eq!(value.is_nan(), channel < 2 || channel >= 2 + in_channels, "only its own channels");
    }
    wide.into_iter().filter(|value| !value.is_nan()).collect()
}

#[test]
fn enlargement_is_bilinear() {
    let mut random = Random::new(44);
    for _ in 0..300 {
        let size = [1 + random.below(9), 1 + random.below(9), 1 + random.below(4)];
        let [height, width, channels] = size;
        let out = [1 + random.below(20), 1 + random.below(20)];
        let inputs = numbers(&mut random, height * width * channels);
        let enlarged = enlarge(&inputs, size.map(|count| count as u32), out.map(|count| count as u32));
        for (element, actual) in enlarged.iter().enumerate() {
            let (pixel, channel) = (element / channels, element % channels);
            let position = |index: usize, out_count: usize, in_count: usize| {
                if out_count == 1 { 0.0 } else { index as f64 * (in_count - 1) as f64 / (out_count - 1) as f64 }
            };
            let y = position(pixel / out[1], out[0], height);
            let x = position(pixel % out[1], out[1], width);
            let mut expected = 0.0;
            for row in 0..height {
                for column in 0..width {
                    let share = (1.0 - (y - row as f64).abs()).max(0.0) * (1.0 - (x - column as f64).abs()).max(0.0);
                    expected += share * f64::from(inputs[(row * width + column) * channels + channel]);
                }
            }
            // A place is off by a few units of up to 8.5, and the image changes by up to 8 over a node.
            assert!((f64::from(*actual) - expected).abs() <= 3.0e-5, "{size:?} {out:?} {element}");
        }
    }
}

#[test]
fn enlargement_hits_nodes() {
    let mut random = Random::new(45);
    // Twice, three and four times as dense; and as it is.
    for (height, width, times) in [(4, 7, 2), (5, 3, 3), (9, 2, 4), (6, 6, 1), (2, 2, 63)] {
        let inputs = numbers(&mut random, height * width * 2);
        let out = [(height - 1) * times + 1, (width - 1) * times + 1];
        let enlarged = enlarge(&inputs, [height as u32, width as u32, 2], out.map(|count| count as u32));
        for row in 0..height {
            for column in 0..width {
                for channel in 0..2 {
                    let actual = enlarged[(row * times * out[1] + column * times) * 2 + channel];
                    let expected = inputs[(row * width + column) * 2 + channel];
                    // A third is no binary number: its third multiple may miss the node by a rounding.
                    let slack = if times.is_power_of_two() { 0.0 } else { 8.0e-6 };
                    assert!((actual - expected).abs() <= slack, "{times}: {actual} instead of {expected}");
                }
            }
        }
    }
    assert_eq!(aligned(0, 1, 9), 0.5);
    assert_eq!(aligned(5, 9, 1), 0.5);
    assert_eq!(enlarge(&[7.0], [1, 1, 1], [3, 2]), [7.0; 6]);
}
