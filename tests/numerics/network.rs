//! Layers of networks: what degenerate input gives, and nodes of enlarged images.

use viewfuse::check::poses::Random;
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::linear::rectified;
use viewfuse_kernels::network::resample::{UpsampleBlock, aligned, upsampled_element};

fn numbers(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count).map(|_| random.normal() as f32).collect()
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
fn packed_images_lie_side_by_side() {
    let block = ConvolveBlock { in_channels: 5, out_channels: 7, size: 3, padding: 1, ..ConvolveBlock::default() };
    let packed = block.packed();
    let whole = [packed.in_pitch, packed.out_pitch, packed.residual_pitch, packed.enlarge, packed.dilation];
    assert_eq!((whole, packed.scale), ([5, 7, 7, 1, 1], 1.0));
    assert_eq!([packed.in_first, packed.out_first, packed.residual_first], [0; 3]);
    assert_eq!((packed.size, packed.padding, packed.place(3, 2)), (3, 1, 23));
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
