//! Normalisation, SiLU and softmax at their ends: values far from 0, constant ones, infinite ones.

use crate::relative_units;
use viewfuse::check::poses::Random;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_kernels::network::attend::{softmax_scale, softmax_value};
use viewfuse_kernels::network::group_norm::{
    GroupNormBlock, group_norm_element, group_norm_partials, group_norm_statistics, silu,
};

/// An image through both kernels: by their bodies, and by the CPU's own way.
fn normalised(inputs: &[f32], weights: &[f32], bias: &[f32], block: &GroupNormBlock) -> [Vec<f32>; 2] {
    let groups = block.group_count as usize;
    let part_count = block.part_count() as usize;
    let count = (block.pixel_count * block.channels) as usize;
    let parts: Vec<[f32; 2]> =
        (0..part_count * groups).map(|element| group_norm_partials(inputs, block, element)).collect();
    let statistics: Vec<[f32; 2]> = (0..groups).map(|group| group_norm_statistics(&parts[..], block, group)).collect();
    let of = |element: usize| statistics[block.group_of(element as u32) as usize];
    let output = |element: usize| group_norm_element(inputs, of(element), weights, bias, block, element);
    let by_bodies = (0..count).map(output).collect();

    let [inputs, weights, bias] = [inputs, weights, bias].map(<[f32]>::to_vec);
    let (mut parts, mut outputs) = (vec![[0.0; 2]; parts.len()], vec![0.0; count]);
    Cpu.group_norm_partials(block, &inputs, &mut parts).expect("the CPU computes");
    Cpu.group_norm(block, &inputs, &parts, &weights, &bias, &mut outputs).expect("the CPU computes");
    [by_bodies, outputs]
}

fn block(pixel_count: u32, group_count: u32, group_channels: u32) -> GroupNormBlock {
    let channels = group_count * group_channels;
    GroupNormBlock {
        pixel_count,
        channels,
        in_pitch: channels,
        in_first: 0,
        group_count,
        variance_floor: 1.0e-5,
        silu_outputs: 0,
    }
}

/// Largest error of both ways, with weights of 1 and a bias of 0, against each group's mean and deviation in `f64`.
fn error(inputs: &[f32], block: &GroupNormBlock) -> f64 {
    let [channels, groups] = [block.channels, block.group_count].map(|count| count as usize);
    let mut expected = vec![0.0; inputs.len()];
    for group in 0..groups {
        let members = || (0..inputs.len()).filter(|at| at % channels / (channels / groups) == group);
        let mean_of = |value: &dyn Fn(usize) -> f64| members().map(value).sum::<f64>() / members().count() as f64;
        let mean = mean_of(&|at| f64::from(inputs[at]));
        let deviation = mean_of(&|at| (f64::from(inputs[at]) - mean).powi(2)).sqrt();
        members().for_each(|at| expected[at] = (f64::from(inputs[at]) - mean) / deviation);
    }
    let difference = |actual: Vec<f32>| {
        assert_eq!(actual.len(), expected.len());
        let differences = actual.iter().zip(&expected).map(|(actual, expected)| (f64::from(*actual) - expected).abs());
        differences.fold(0.0, |largest, difference| if difference <= largest { largest } else { difference })
    };
    let [by_bodies, by_cpu] = normalised(inputs, &vec![1.0; channels], &vec![0.0; channels], block).map(difference);
    if by_bodies <= by_cpu { by_cpu } else { by_bodies }
}

#[test]
fn values_far_from_0_are_normalised() {
    let mut random = Random::new(62);
    for (distance, tolerance) in [(1.0e2, 5.0e-5), (1.0e3, 5.0e-4), (1.0e4, 5.0e-3)] {
        for (pixels, groups, channels) in [(64, 1, 32), (1024, 2, 16), (4096, 1, 4), (777, 3, 1)] {
            let block = GroupNormBlock { variance_floor: 0.0, ..block(pixels, groups, channels) };
            let count = (block.pixel_count * block.channels) as usize;
            // As many bits as the inputs have decide: what they are is given, their mean is not.
            let inputs: Vec<f32> = (0..count).map(|_| (distance + random.normal()) as f32).collect();
            let error = error(&inputs, &block);
            assert!(error <= tolerance, "{block:?} {distance}: {error}");
        }
    }
}

#[test]
fn constant_groups_give_the_bias() {
    for constant in [0.0, 1.0, 0.1, -10_000.3, 1.0e6, 3.3e-5] {
        for (pixels, channels) in [(1, 1), (1, 7), (64, 32), (100, 3), (1000, 16)] {
            for variance_floor in [0.0, 1.0e-5] {
                let block = GroupNormBlock { variance_floor, ..block(pixels, 2, channels) };
                let inputs = vec![constant; (block.pixel_count * block.channels) as usize];
                let bias: Vec<f32> = (0..block.channels).map(|channel| channel as f32 + 0.5).collect();
                let expected = bias.repeat(block.pixel_count as usize);
                for outputs in normalised(&inputs, &vec![2.0; bias.len()], &bias, &block) {
                    assert_eq!(outputs, expected, "{constant} {block:?}");
                }
            }
        }
    }
}

#[test]
fn silu_at_its_ends() {
    let mut worst = 0.0_f64;
    for step in -86_000..=200_000 {
        let x = step as f32 / 1000.0;
        let expected = f64::from(x) / (1.0 + (-f64::from(x)).exp());
        worst = worst.max(relative_units(silu(x), expected));
    }
    assert!(worst <= 6.0, "{worst} units of 2^-24");
    for x in [-86.5, -87.0, -88.0, -100.0, -1.0e4, -1.0e30, f32::MIN, f32::NEG_INFINITY] {
        assert!(silu(x) <= 0.0 && silu(x) >= -3.0e-36, "{x}: {}", silu(x));
    }
    for x in [100.0, 1.0e4, 1.0e30, f32::MAX, f32::INFINITY] {
        assert_eq!(silu(x), x);
    }
    assert_eq!(silu(0.0), 0.0);
    assert!(silu(f32::NAN).is_nan());
}

/// A row's weights: by the body, and by the CPU.
fn softmax(scores: &[f32]) -> [Vec<f32>; 2] {
    // Another row around it.
    let rows = [&vec![7.0; scores.len()][..], scores, &vec![-7.0; scores.len()]].concat();
    let scale = softmax_scale(&rows[..], scores.len(), scores.len() as u32);
    let by_body = scores.iter().map(|score| softmax_value(*score, scale)).collect();
    let mut weights = vec![0.0; rows.len()];
    Cpu.softmax_rows(&(scores.len() as u32), 3, &rows, &mut weights).expect("the CPU computes");
    [by_body, weights[scores.len()..2 * scores.len()].to_vec()]
}

#[test]
fn softmax_at_its_ends() {
    const NAN: f32 = f32::NAN;
    const INFINITE: f32 = f32::INFINITY;
    let one_of = [
        (vec![1.0e4, -1.0e4, 0.0], vec![1.0, 0.0, 0.0]),
        (vec![-1.0e4], vec![1.0]),
        (vec![f32::MAX, f32::MIN], vec![1.0, 0.0]),
        (vec![f32::MIN, f32::MIN], vec![0.5, 0.5]),
        (vec![1.0e4; 4], vec![0.25; 4]),
        (vec![-1.0e4; 2], vec![0.5; 2]),
        (vec![-INFINITE, 3.0, -INFINITE, 3.0], vec![0.0, 0.5, 0.0, 0.5]),
        (vec![-INFINITE; 3], vec![0.0; 3]),
    ];
    for (scores, expected) in one_of {
        for weights in softmax(&scores) {
            assert_eq!(weights, expected, "{scores:?}");
        }
    }
    for scores in [vec![NAN, 3.0, 3.0], vec![3.0, -INFINITE, NAN], vec![NAN; 2], vec![INFINITE, 1.0, INFINITE]] {
        for weights in softmax(&scores) {
            assert!(weights.iter().any(|weight| weight.is_nan()), "{scores:?}: {weights:?}");
        }
    }
    for weights in softmax(&[1.0e4, 1.0e4 - 1.0]) {
        let expected = 1.0 / (1.0 + (-1.0_f64).exp());
        assert!((f64::from(weights[0]) - expected).abs() <= 2.0e-7, "{weights:?}");
    }
}
