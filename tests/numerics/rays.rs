//! Where to look along rays, at extremes: depths of the second pass, and which samples are wanted.

use viewfuse::check::poses::Random;
use viewfuse::check::ray_inputs;
use viewfuse_core::depths::{FineBlock, fine_depth, random_draw, stratified_depth};
use viewfuse_core::rays::{TargetRay, place_point};
use viewfuse_kernels::sample_mask::{SampleMaskBlock, is_sampled, weigh_sample};

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
        assert_eq!(block.fine_count(), 16);
        for index in 0..block.fine_count() {
            let draws = [random_draw(7, index, &block), [0.0; 2], [1.0; 2], [f32::NAN; 2], [2.0, -1.0]];
            for draw in draws {
                let depth = fine_depth(&seen[..], &ray, depth, opacity, draw, index, &block);
                assert!((ray.near..=ray.far).contains(&depth), "{depth} not in {ray:?}");
            }
        }
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
