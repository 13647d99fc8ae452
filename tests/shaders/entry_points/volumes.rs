//! From volumes to a feature image, and the denoiser's inputs.

use super::vectors::{cameras, points};
use super::{UNTOUCHED, dispatch, numbers, points_of};
use viewfuse::check::world::World;
use viewfuse_core::half_precision::packed_f16;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::genvs::{
    DenoiserInputBlock, FeatureBlock, VolumeBlock, denoiser_input, summed_feature, volume_value, volume_value_f16,
    weigh_features,
};

#[test]
fn gather_volume_is_core_s() {
    let world = World::new(1);
    let (views, there, volume) = (&world.views, points_of(&world, 40), numbers(29, 5 * 6 * 4 * 3));
    let block = VolumeBlock {
        view: 1,
        point_count: 40,
        feature_count: 3,
        height: 5,
        width: 6,
        depth_count: 4,
        near: 0.5,
        far: 9.0,
    };
    let mut gathered = vec![UNTOUCHED; views.len() * 120];
    let (words, at) = (cameras(views), points(&there));
    dispatch(block, 120, |id, push| viewfuse_shaders::gather_volume(id, push, &words, &at, &volume, &mut gathered));
    let expected: Vec<f32> = (0..120).map(|at| volume_value(&views[..], &there[..], &volume[..], &block, at)).collect();
    assert!(expected.iter().any(|value| *value != 0.0) && expected.contains(&0.0));
    assert_eq!(gathered[120..240], expected);
    assert_eq!(gathered.iter().filter(|value| **value == UNTOUCHED).count(), gathered.len() - 120);
}

#[test]
fn halves_are_core_s() {
    let world = World::new(1);
    let (views, there, numbers) = (&world.views, points_of(&world, 40), numbers(35, 5 * 7 * 3 * 3));
    let mut volume = vec![0xabab_abab; 160];
    dispatch(315, 158, |id, push| viewfuse_shaders::pack_f16(id, push, &numbers, &mut volume));
    let expected: Vec<u32> = (0..158).map(|word| packed_f16(&numbers[..], 315, word)).collect();
    assert_eq!(volume[..158], expected);
    assert_eq!(volume[158..], [0xabab_abab; 2]);

    let block = VolumeBlock {
        view: 1,
        point_count: 40,
        feature_count: 3,
        height: 5,
        width: 7,
        depth_count: 3,
        near: 0.5,
        far: 9.0,
    };
    let mut gathered = vec![UNTOUCHED; views.len() * 120];
    let (words, at) = (cameras(views), points(&there));
    dispatch(block, 120, |id, push| viewfuse_shaders::gather_volume_f16(id, push, &words, &at, &volume, &mut gathered));
    let value = |at| volume_value_f16(&views[..], &there[..], &volume[..], &block, at);
    let expected: Vec<f32> = (0..120).map(value).collect();
    assert!(expected.iter().any(|value| *value != 0.0) && expected.contains(&0.0));
    assert_eq!(gathered[120..240], expected);
    assert_eq!(gathered.iter().filter(|value| **value == UNTOUCHED).count(), gathered.len() - 120);
}

#[test]
fn features_are_core_s() {
    let there: Vec<RayPoint> =
        numbers(34, 70 * 6).iter().map(|length| RayPoint { length: length.abs(), ..RayPoint::default() }).collect();
    let (raw, fused) = (numbers(30, 70 * 6 * 4), numbers(31, 70 * 6 * 3));
    for inclusive in [0, 1] {
        let block = FeatureBlock {
            sample_count: 6,
            feature_count: 3,
            length_scale: 0.8,
            last_length: 2.0,
            inclusive,
            first_ray: 0,
        };
        let mut weights = vec![UNTOUCHED; 420];
        dispatch(block, 70, |id, push| viewfuse_shaders::weigh_features(id, push, &raw, &there, &mut weights));
        let mut expected = vec![UNTOUCHED; 420];
        for ray in 0..70 {
            weigh_features(&raw[..], &there[..], &block, ray, |sample, weight| expected[sample] = weight);
        }
        assert_eq!(weights, expected);
        assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)));

        let mut summed = vec![UNTOUCHED; 210];
        dispatch(block, 210, |id, push| viewfuse_shaders::sum_features(id, push, &weights, &fused, &raw, &mut summed));
        let sum = |at| summed_feature(&weights[..], &fused[..], &raw[..], &block, at);
        assert_eq!(summed, (0..210).map(sum).collect::<Vec<f32>>());
    }
}

#[test]
fn denoiser_input_is_core_s() {
    let (noisy, condition) = (numbers(32, 40 * 3), numbers(33, 40 * 5));
    let block = DenoiserInputBlock { picture_channels: 3, condition_channels: 5, scale: 0.7 };
    let mut inputs = vec![UNTOUCHED; 320];
    dispatch(block, 320, |id, push| viewfuse_shaders::denoiser_input(id, push, &noisy, &condition, &mut inputs));
    let expected: Vec<f32> = (0..320).map(|at| denoiser_input(&noisy[..], &condition[..], &block, at)).collect();
    assert_eq!(inputs, expected);
}
