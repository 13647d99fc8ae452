//! Fusing views against `f64`, and compositing thin, opaque and useless samples.

use crate::assert_near;
use viewfuse::check::poses::Random;
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::fuse::{VisibleFusion, fuse_views, fuse_visible};
use viewfuse_core::weights::Weights;

const S: usize = 5;
const C: usize = 4;

#[test]
fn fusion_is_the_weighted_sum() {
    let mut random = Random::new(31);
    for _ in 0..5_000 {
        let scores: [f32; S] = std::array::from_fn(|_| random.unit() as f32);
        let count = 1 + random.below(S);
        let weights = Weights::from_scores(&scores, count as u32);
        // Beyond the count lies NaN, which must not be touched.
        let latents: [[f32; C]; S] = std::array::from_fn(|view| {
            std::array::from_fn(|_| if view < count { random.normal() as f32 } else { f32::NAN })
        });
        let visibility: [f32; S] = std::array::from_fn(|_| (random.range(-0.3, 1.3).clamp(0.0, 1.0)) as f32);
        let (mut sum, mut visible, mut seen, mut size) = ([0.0; C], [0.0; C], 0.0, 0.0_f64);
        for view in 0..count {
            let share = f64::from(weights.values()[view]);
            seen += share * f64::from(visibility[view]);
            for channel in 0..C {
                let latent = f64::from(latents[view][channel]);
                size = size.max(latent.abs());
                sum[channel] += share * latent;
                visible[channel] += share * f64::from(visibility[view]) * latent;
            }
        }
        // A product, S additions of parts of a convex combination; the visible mean adds a product and a division.
        assert_near(&fuse_views(&weights, &latents), &sum, (S as f64 + 1.0) * size, 0.0);
        let fused = fuse_visible(&weights, &visibility, &latents, [9.0; C]);
        if seen == 0.0 {
            assert_eq!(fused, [9.0; C]);
            continue;
        }
        assert_near(&fused, &visible.map(|v| v / seen), (2.0 * S as f64 + 4.0) * size, 0.0);
    }
}

#[test]
fn invisible_views_count_for_nothing() {
    let weights = Weights::from_scores(&[0.25_f32, 0.5, 0.25], 3);
    let latents = [[1.0, 2.0], [100.0, 100.0], [3.0, 6.0]];
    assert_eq!(fuse_visible(&weights, &[1.0, 0.0, 1.0], &latents, [0.0; 2]), [2.0, 4.0]);
    assert_eq!(fuse_visible(&weights, &[1.0; 3], &latents, [0.0; 2]), fuse_views(&weights, &latents));
    assert_eq!(fuse_visible(&weights, &[0.0; 3], &latents, [7.0, 8.0]), [7.0, 8.0]);
    assert_eq!(VisibleFusion::<2>::EMPTY.mean_or([7.0, 8.0]), [7.0, 8.0]);
    // However little a view is seen, alone it decides.
    assert_eq!(fuse_visible(&weights, &[1.0e-20, 0.0, 0.0], &[[4.0], [1.0], [1.0]], [0.0]), [4.0]);
}

/// One sample: channels, optical depth, distance.
type Sample = ([f32; 3], f32, f32);

fn composite(samples: &[Sample], background: [f32; 3]) -> (Composite<3>, Vec<f32>) {
    let mut ray = Compositor::<3>::START;
    let weights = samples.iter().map(|(channels, depth, at)| ray.add(channels, *depth, *at)).collect();
    (ray.finish(&background, -1.0), weights)
}

#[test]
fn two_thousand_thin_samples_are_not_lost() {
    let samples = vec![([1.0, 0.5, 0.0], 1.0e-7, 2.0); 2000];
    let (actual, _) = composite(&samples, [0.0; 3]);
    let opacity = -(-2000.0 * f64::from(1.0e-7_f32)).exp_m1();
    // One by one each would round to 0 or 2^-24; kept as a sum they are right to half a step of the transmittance.
    let [red, green, blue] = actual.channels;
    assert_near(&[red, green, blue, actual.opacity], &[opacity, 0.5 * opacity, 0.0, opacity], 2.5, 0.0);
    assert!((actual.depth - 2.0).abs() < 2.0e-6, "{}", actual.depth);
}

#[test]
fn empty_opaque_and_useless_samples() {
    let (empty, _) = composite(&[], [0.1, 0.2, 0.3]);
    assert_eq!(empty, Composite { channels: [0.1, 0.2, 0.3], depth: -1.0, opacity: 0.0 });
    for nothing in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
        let (same, weights) = composite(&[([9.0; 3], nothing, 5.0)], [0.1, 0.2, 0.3]);
        assert_eq!((same, weights[0]), (empty, 0.0), "{nothing}");
    }
    for opaque in [f32::INFINITY, f32::MAX, 1.0e3] {
        let samples = [([0.5, 0.6, 0.7], opaque, 3.0), ([9.0; 3], opaque, 5.0)];
        let (actual, weights) = composite(&samples, [0.1; 3]);
        assert_eq!(actual, Composite { channels: [0.5, 0.6, 0.7], depth: 3.0, opacity: 1.0 });
        assert_eq!(weights, [1.0, 0.0]);
    }
}
