//! Rays and where to look along them, at extremes: random numbers, depths of both passes, what is seen and what is
//! wanted.

use viewfuse::check::poses::Random;
use viewfuse::check::ray_inputs;
use viewfuse_core::composite::Compositor;
use viewfuse_core::depths::{FineBlock, fine_depth, random_draw, stratified_depth};
use viewfuse_core::math;
use viewfuse_core::random::{normal, uniform_pair};
use viewfuse_core::rays::{TargetRay, place_point};
use viewfuse_kernels::sample_mask::{SampleMaskBlock, is_sampled, weigh_sample};

/// As [`normal`], in `f64`.
fn normal_oracle(seed: [u32; 2], pixel: u32, sample: u32) -> f64 {
    let [u, v] = uniform_pair(seed, pixel, sample).map(f64::from);
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[test]
fn normal_numbers_are_normal() {
    const COUNT: u32 = 1 << 20;
    for seed in [[0, 0], [1, 0], [u32::MAX, 7]] {
        let (mut sum, mut squares, mut fourths, mut largest, mut lag, mut previous) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for i in 0..COUNT {
            let value = normal(seed, i / 64, i % 64);
            let expected = normal_oracle(seed, i / 64, i % 64);
            // The root's and the cosine's, whose argument of up to a turn is rounded twice.
            assert!((f64::from(value) - expected).abs() <= 6.0e-6, "{value} instead of {expected}");
            let value = f64::from(value);
            sum += value;
            squares += value * value;
            fourths += value.powi(4);
            lag += value * previous;
            previous = value;
            largest = value.abs().max(largest);
        }
        let count = f64::from(COUNT);
        let five = 5.0 / count.sqrt();
        assert!((sum / count).abs() < five, "mean {}", sum / count);
        assert!((squares / count - 1.0).abs() < five * 2.0_f64.sqrt(), "variance {}", squares / count);
        assert!((fourths / count - 3.0).abs() < five * 96.0_f64.sqrt(), "fourth moment {}", fourths / count);
        assert!((lag / count).abs() < five, "neighbours {}", lag / count);
        assert!((4.5..5.8).contains(&largest), "largest {largest}");
    }
    let furthest = math::sqrt(-2.0 * math::ln(1.0 / 16_777_216.0));
    assert!((5.7..5.8).contains(&furthest), "no number is larger than {furthest}");
}

#[test]
fn chances_are_one_in_each_part() {
    for importance_count in [1, 2, 16, 128] {
        let block = FineBlock { seed: [9, 0], coarse_count: 64, importance_count, ..FineBlock::default() };
        for pixel in 0..2_000 {
            for index in 0..importance_count {
                let [place, inside] = random_draw(pixel, index, &block);
                let part = f64::from(place) * f64::from(importance_count) - f64::from(index);
                assert!((0.0..=1.0).contains(&place) && (-1.0e-5..=1.0 + 1.0e-5).contains(&part), "{place}");
                assert!((0.0..1.0).contains(&inside));
            }
        }
    }
}

/// A sample at or behind the end of its ray stands for nothing.
#[test]
fn points_behind_the_end_have_no_length() {
    let ray = TargetRay { near: 1.0, direction: [0.0, 0.6, 0.8], far: 4.0, ..TargetRay::default() };
    for depth in [4.0, 5.0] {
        assert_eq!(place_point(&[ray], &[depth], 1, 0).length, 0.0);
    }
}

/// Weights that nobody should have.
fn odd_weights(random: &mut Random, case: usize) -> Vec<[f32; 2]> {
    let odd = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0e30, f32::MAX, 1.0e-38, 1.0e-45];
    let weight = |random: &mut Random| match case % 4 {
        0 => odd[case / 4 % odd.len()],
        1 => odd[random.below(odd.len())],
        2 if random.below(3) == 0 => odd[random.below(odd.len())],
        _ => random.unit() as f32,
    };
    (0..64).map(|_| [weight(random), random.unit() as f32]).collect()
}

#[test]
fn fine_depths_stay_within_the_ray() {
    let mut random = Random::new(62);
    for case in 0..4_000 {
        let seen = odd_weights(&mut random, case);
        let ray = ray_inputs::ray(&mut random);
        let block = FineBlock {
            seed: [case as u32, 0],
            coarse_count: 64,
            importance_count: 8,
            depth_count: 8,
            depth_deviation: [0.01, 100.0][case % 2],
            depth_times_opacity: case as u32 / 2 % 2,
        };
        let depth = [1.0, 0.0, -7.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0e30][random.below(7)];
        let opacity = [0.0, 0.5, 1.0, f32::NAN][random.below(4)];
        for index in 0..block.fine_count() {
            let draws = [random_draw(7, index, &block), [0.0; 2], [1.0; 2], [f32::NAN; 2], [2.0, -1.0]];
            for draw in draws {
                let depth = fine_depth(&seen[..], &ray, depth, opacity, draw, index, &block);
                assert!((ray.near..=ray.far).contains(&depth), "{depth} not in {ray:?}");
            }
        }
    }
}

#[test]
fn depth_samples_lie_around_the_depth() {
    let ray = TargetRay { near: 1.0, far: 3.0, ..TargetRay::default() };
    let block = FineBlock { coarse_count: 1, depth_count: 4, depth_deviation: 0.01, ..FineBlock::default() };
    let at = |depth, opacity, draw, block: &FineBlock| fine_depth(&[[0.0; 2]], &ray, depth, opacity, draw, 0, block);
    assert_eq!(at(2.0, 0.5, [1.0, 0.0], &block), 2.0 + 0.01);
    let published = FineBlock { depth_times_opacity: 1, ..block };
    // Too near, as published: the sum of weights times depths.
    assert_eq!(at(2.4, 0.5, [-2.0, 0.0], &published), 1.2 - 2.0 * 0.01);
    // A ray that met nothing looks at its beginning, or wherever nothing was said to be.
    for draw in [[0.0, 0.0], [-5.0, 0.0]] {
        assert_eq!(at(0.0, 0.0, draw, &block), 1.0);
        assert_eq!(at(9.0, 0.0, draw, &published), 1.0);
    }
    assert_eq!(at(9.0, 0.0, [0.0, 0.0], &block), 3.0);
}

#[test]
fn weights_are_the_compositors() {
    let mut random = Random::new(65);
    for case in 0..5_000 {
        let (mut ray, mut sum, mut total) = (Compositor::<1>::START, 0.0, 0.0_f64);
        let (low, high) = [(1.0e-6, 1.0e-3), (1.0e-3, 1.0), (0.1, 1.0e3)][case % 3];
        for _ in 0..1 + random.below(128) {
            let odd = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(5)];
            let optical_depth = if random.below(20) == 0 { odd } else { random.log_range(low, high) as f32 };
            let before = ray.transmittance();
            let ([weight, transmittance], after) = weigh_sample(sum, optical_depth);
            assert_eq!(transmittance.to_bits(), before.to_bits());
            assert_eq!(weight.to_bits(), ray.add(&[0.0], optical_depth, 0.0).to_bits(), "{optical_depth}");
            sum = after;
            total += f64::from(weight);
        }
        // Each weight is a difference of neighbours, rounded once.
        assert!((total - (1.0 - f64::from(ray.transmittance()))).abs() <= 64.0 / 16_777_216.0, "{total}");
    }
}

/// Weights and transmittances of optical depths.
fn weighed(optical_depths: impl IntoIterator<Item = f32>) -> Vec<[f32; 2]> {
    let mut sum = 0.0;
    let weigh = |optical_depth| {
        let seen;
        (seen, sum) = weigh_sample(sum, optical_depth);
        seen
    };
    optical_depths.into_iter().map(weigh).collect()
}

const EVERYTHING: SampleMaskBlock = SampleMaskBlock {
    sample_count: 1,
    part_count: 8,
    least_share: 0.0,
    termination: -1.0,
    least_opacity: 0.0,
    step: 0,
    seen_columns: 0,
    seen_rows: 0,
    width: 1,
};

const RAY: TargetRay = TargetRay { origin: [0.0; 3], near: 1.0, direction: [0.0, 0.0, 1.0], far: 3.0 };

/// Whether the middles of the parts are wanted.
fn wanted_parts(seen: &[[f32; 2]], block: &SampleMaskBlock) -> Vec<bool> {
    let middle = |part| stratified_depth(RAY.near, RAY.far, part, block.part_count, 0.5);
    (0..block.part_count).map(|part| is_sampled(seen, &RAY, middle(part), 0, 0, block)).collect()
}

#[test]
fn without_thresholds_everything_is_sampled() {
    let mut random = Random::new(66);
    for case in 0..200_000 {
        // Also where neighbouring optical depths differ by less than the exponential can tell.
        let (low, high) = [(1.0e-8, 1.0e-5), (1.0e-7, 1.0), (0.1, 1.0e2)][case % 3];
        let first = random.log_range(1.0e-6, 80.0) as f32;
        let others: Vec<f32> = (0..7).map(|_| random.log_range(low, high) as f32).collect();
        let seen = weighed([first].into_iter().chain(others));
        assert!(wanted_parts(&seen, &EVERYTHING).iter().all(|wanted| *wanted), "{seen:?}");
    }
    for nothing in [0.0, f32::NAN, f32::INFINITY] {
        assert_eq!(wanted_parts(&weighed([nothing; 8]), &EVERYTHING), [true; 8]);
    }
    // An exponential that a device rounds otherwise may leave less than nothing.
    for seen in [[[-1.0e-9, 0.5]; 8], [[-1.0e-7, 1.0]; 8], [[f32::NAN, 0.5]; 8]] {
        assert_eq!(wanted_parts(&seen, &EVERYTHING), [true; 8]);
    }
    // Wherever the sample is said to be.
    let seen = weighed([0.1; 8]);
    for depth in [-9.0, 1.0, 3.0, 9.0, f32::NAN, f32::INFINITY] {
        assert!(is_sampled(&seen[..], &RAY, depth, 0, 0, &EVERYTHING));
        assert!(is_sampled(&seen[..], &TargetRay { far: 1.0, ..RAY }, depth, 0, 0, &EVERYTHING));
    }
}
