//! Layers of networks.

use super::{UNTOUCHED, dispatch, numbers};
use viewfuse_kernels::network::attend::{softmax_scale, softmax_value};
use viewfuse_kernels::network::depthwise::{DepthwiseBlock, depthwise_element};
use viewfuse_kernels::network::group_norm::{
    GroupNormBlock, MeanBlock, channel_mean, group_norm_element, group_norm_partials, group_norm_statistics,
};
use viewfuse_kernels::network::resample::{PoolBlock, UpsampleBlock, pooled_element, upsampled_element};

#[test]
fn other_sizes_are_core_s() {
    let inputs = numbers(22, 7 * 9 * 4);
    let (in_height, in_width) = (7, 9);
    let block =
        PoolBlock { in_height, in_width, out_height: 4, out_width: 5, channels: 4, size: 3, stride: 2, padding: 1 };
    let mut pooled = vec![UNTOUCHED; 80];
    dispatch(block, 80, |id, push| viewfuse_shaders::max_pool(id, push, &inputs, &mut pooled));
    assert_eq!(pooled, (0..80).map(|at| pooled_element(&inputs[..], &block, at)).collect::<Vec<f32>>());

    let (in_channels, out_channels) = (4, 6);
    let block = UpsampleBlock {
        in_height,
        in_width,
        in_channels,
        out_height: 5,
        out_width: 11,
        out_channels,
        first_channel: 1,
    };
    let mut upsampled = vec![UNTOUCHED; 5 * 11 * 6];
    dispatch(block, 5 * 11 * 4, |id, push| viewfuse_shaders::upsample(id, push, &inputs, &mut upsampled));
    let mut expected = vec![UNTOUCHED; 5 * 11 * 6];
    for at in 0..5 * 11 * 4 {
        expected[at / 4 * 6 + 1 + at % 4] = upsampled_element(&inputs[..], &block, at);
    }
    assert_eq!(upsampled, expected);
}

#[test]
fn convolve_depthwise_is_core_s() {
    let (inputs, weights) = (numbers(23, 7 * 9 * 6), numbers(24, 3 * 3 * 4));
    for is_shared in [0, 1] {
        let block = DepthwiseBlock {
            in_height: 7,
            in_width: 9,
            in_pitch: 6,
            in_first: 1,
            out_height: 4,
            out_width: 5,
            channels: 4,
            size: 3,
            stride: 2,
            dilation: 2,
            padding: 2,
            is_shared,
        };
        let mut filtered = vec![UNTOUCHED; 80];
        dispatch(block, 80, |id, push| {
            viewfuse_shaders::convolve_depthwise(id, push, &inputs, &weights, &mut filtered)
        });
        let expected: Vec<f32> = (0..80).map(|at| depthwise_element(&inputs[..], &weights[..], &block, at)).collect();
        assert_eq!(filtered, expected);
    }
}

#[test]
fn normalise_is_core_s() {
    let block = GroupNormBlock {
        pixel_count: 150,
        channels: 12,
        in_pitch: 14,
        in_first: 2,
        group_count: 4,
        variance_floor: 1.0e-5,
        silu_outputs: 1,
    };
    let inputs = numbers(25, 150 * 14);
    let mut partials = vec![[UNTOUCHED; 2]; 12];
    dispatch(block, 12, |id, push| viewfuse_shaders::group_norm_partials(id, push, &inputs, &mut partials));
    assert_eq!(partials, (0..12).map(|at| group_norm_partials(&inputs[..], &block, at)).collect::<Vec<[f32; 2]>>());

    let mut statistics = vec![[UNTOUCHED; 2]; 4];
    dispatch(block, 4, |id, push| viewfuse_shaders::group_norm_statistics(id, push, &partials, &mut statistics));
    assert_eq!(
        statistics,
        (0..4).map(|group| group_norm_statistics(&partials[..], &block, group)).collect::<Vec<[f32; 2]>>()
    );

    let (weights, bias) = (numbers(26, 12), numbers(27, 12));
    let mut outputs = vec![UNTOUCHED; 1800];
    dispatch(block, 1800, |id, push| {
        viewfuse_shaders::group_norm(id, push, &inputs, &statistics, &weights, &bias, &mut outputs);
    });
    let normalised = |at| group_norm_element(&inputs[..], &statistics[..], &weights[..], &bias[..], &block, at);
    assert_eq!(outputs, (0..1800).map(normalised).collect::<Vec<f32>>());

    let block = MeanBlock { pixel_count: 21, channels: 100 };
    let mut means = vec![UNTOUCHED; 100];
    dispatch(block, 100, |id, push| viewfuse_shaders::channel_means(id, push, &inputs, &mut means));
    assert_eq!(means, (0..100).map(|channel| channel_mean(&inputs[..], &block, channel)).collect::<Vec<f32>>());
}

#[test]
fn softmax_rows_is_core_s() {
    let scores = numbers(28, 70 * 9);
    let mut weights = vec![UNTOUCHED; 70 * 9];
    dispatch(9, 70, |id, push| viewfuse_shaders::softmax_rows(id, push, &scores, &mut weights));
    let weight = |at: usize| softmax_value(scores[at], softmax_scale(&scores[..], at / 9 * 9, 9));
    assert_eq!(weights, (0..70 * 9).map(weight).collect::<Vec<f32>>());
}
