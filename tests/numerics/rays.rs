//! Rays and where to look along them: random numbers, depths of both passes, what is seen and what is wanted, against `f64`
//! and at extremes.

use viewfuse::check::poses::Random;
use viewfuse::check::ray_inputs;
use viewfuse_core::composite::Compositor;
use viewfuse_core::depths::{
    CoarseBlock, FineBlock, coarse_depth, fine_depth, inverse_cdf, merged_depth, random_draw, stratified_depth,
};
use viewfuse_core::math;
use viewfuse_core::random::{normal, uniform_from, uniform_pair};
use viewfuse_core::rays::{CastBlock, TargetRay, cast_ray, place_point};
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
fn random_numbers_know_no_order() {
    let block =
        FineBlock { seed: [3, 4], coarse_count: 64, importance_count: 16, depth_count: 16, ..FineBlock::default() };
    let forwards: Vec<_> = (0..40).flat_map(|pixel| (0..32).map(move |i| random_draw(pixel, i, &block))).collect();
    let mut backwards: Vec<_> =
        (0..40).rev().flat_map(|pixel| (0..32).rev().map(move |i| random_draw(pixel, i, &block))).collect();
    backwards.reverse();
    assert_eq!(forwards, backwards);
    // Neither are they those of the first pass, nor of another pixel or seed.
    let coarse: Vec<f32> = (0..64).map(|sample| uniform_from(block.seed, 5, sample)).collect();
    assert!((16..32).all(|index| !coarse.contains(&random_draw(5, index, &block)[0])));
    assert_ne!(random_draw(5, 3, &block), random_draw(6, 3, &block));
    assert_ne!(random_draw(5, 3, &block), random_draw(5, 3, &FineBlock { seed: [4, 3], ..block }));
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

#[test]
fn rays_go_through_their_pixels() {
    let mut random = Random::new(61);
    for _ in 0..5_000 {
        let camera = ray_inputs::camera(&mut random);
        let pixel_centre = [0.5, 0.0, 0.3][random.below(3)];
        let block = CastBlock { camera, near: 0.5, far: 2.0, pixel_centre, along_axis: 0 };
        let pixel = random.below((camera.width * camera.height) as usize) as u32;
        let ray = cast_ray(&block, pixel);
        let length: f64 = ray.direction.iter().map(|d| f64::from(*d).powi(2)).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() <= 3.0e-7, "{length}");
        assert_eq!((ray.origin, ray.near, ray.far), (camera.centre_world().to_array(), 0.5, 2.0));
        let seen = camera.project(camera.centre_world() + viewfuse_core::Vec3::from_array(ray.direction) * 2.0);
        let (column, row) = (pixel % camera.width, pixel / camera.width);
        // What a unit is in pixels of a camera of up to 205 pixels focal length.
        assert!((seen.x - column as f32 - pixel_centre).abs() <= 5.0e-4, "{seen:?}");
        assert!((seen.y - row as f32 - pixel_centre).abs() <= 5.0e-4, "{seen:?}");
    }
}

#[test]
fn points_share_out_the_ray() {
    let ray = TargetRay { origin: [1.0, 2.0, 3.0], near: 1.0, direction: [0.0, 0.6, 0.8], far: 4.0 };
    let depths = [9.0, 9.0, 9.0, 1.0, 1.5, 3.0];
    let points = [3, 4, 5].map(|sample| place_point(&[ray, ray], &depths, 3, sample));
    assert_eq!(points.map(|point| point.length), [0.5, 1.5, 1.0]);
    assert_eq!(points.map(|point| point.sample), [3, 4, 5]);
    assert_eq!(points[2].position, [1.0, 2.0 + 0.6 * 3.0, 3.0 + 0.8 * 3.0]);
    assert!(points.iter().all(|point| point.direction == ray.direction));
    // A sample at or behind the end stands for nothing.
    assert_eq!(place_point(&[ray], &[4.0], 1, 0).length, 0.0);
    assert_eq!(place_point(&[ray], &[5.0], 1, 0).length, 0.0);
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
fn importance_samples_lie_in_the_parts_that_were_seen() {
    let ray = TargetRay { near: 1.0, far: 3.0, ..TargetRay::default() };
    let block = FineBlock { seed: [1, 2], coarse_count: 8, importance_count: 64, ..FineBlock::default() };
    let width = 2.0 / 8.0;
    for part in 0..8_usize {
        let seen: Vec<[f32; 2]> = (0..8).map(|other| [f32::from(u8::from(other == part)), 1.0]).collect();
        let inside = (0..64).filter(|index| {
            let depth = fine_depth(&seen[..], &ray, 2.0, 1.0, random_draw(3, *index, &block), *index, &block);
            let from = 1.0 + part as f32 * width;
            (from..=from + width).contains(&depth)
        });
        // The others have a hundred-thousandth each.
        assert!(inside.count() >= 63);
    }
    // Where nothing was seen, they are spread evenly; the same part as that of the inverted distribution.
    let nothing = [[0.0, 1.0]; 8];
    for index in 0..64 {
        let draw = random_draw(3, index, &block);
        let depth = fine_depth(&nothing, &ray, 2.0, 0.0, draw, index, &block);
        let part = ((inverse_cdf(1.0, 3.0, &[0.0; 8], draw[0]) - 1.0) / width) as u32;
        assert_eq!(depth, stratified_depth(1.0, 3.0, part.min(7), 8, draw[1]));
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
fn coarse_depths_increase() {
    let mut random = Random::new(63);
    for _ in 0..2_000 {
        let ray = ray_inputs::ray(&mut random);
        let sample_count = 1 + random.below(128) as u32;
        let seed = [random.below(1 << 30) as u32, 5];
        for jitter in [0.0, 0.3, 1.0] {
            let block = CoarseBlock { seed, sample_count, jitter };
            let depths: Vec<f32> = (0..sample_count).map(|sample| coarse_depth(&ray, 11, sample, &block)).collect();
            assert!(depths.is_sorted() && ray.near <= depths[0] && depths[depths.len() - 1] <= ray.far);
            if jitter == 0.0 {
                assert_eq!(depths[0], stratified_depth(ray.near, ray.far, 0, sample_count, 0.5));
            }
        }
    }
}

#[test]
fn merging_sorts() {
    let mut random = Random::new(64);
    for _ in 0..2_000 {
        let (coarse_count, fine_count) = (1 + random.below(40), random.below(40));
        // Many are equal, within a pass and between the two.
        let mut depth = || (random.range(0.0, 2.0) * 8.0).round() as f32 / 8.0;
        let coarse: Vec<f32> = (0..coarse_count).map(|_| depth()).collect();
        let fine: Vec<f32> = (0..fine_count).map(|_| depth()).collect();
        let mut expected: Vec<(f32, usize)> = coarse.iter().chain(&fine).copied().zip(0..).collect();
        // Stable.
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut merged = vec![None; coarse_count + fine_count];
        for index in 0..merged.len() {
            let (depth, place) =
                merged_depth(&coarse[..], &fine[..], coarse_count as u32, fine_count as u32, index as u32);
            assert!(merged[place as usize].is_none(), "each place once");
            merged[place as usize] = Some((depth, index));
        }
        assert_eq!(merged.into_iter().flatten().collect::<Vec<_>>(), expected);
    }
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

#[test]
fn neighbours_of_what_was_seen_are_wanted() {
    let block = SampleMaskBlock { least_share: 0.5, termination: 0.01, ..EVERYTHING };
    let occupied = |part: usize| weighed((0..8).map(|other| if other == part { 1.0 } else { 0.0 }));
    for part in 0..8_usize {
        let expected: Vec<bool> = (0..8_usize).map(|other| other.abs_diff(part) <= 1).collect();
        assert_eq!(wanted_parts(&occupied(part), &block), expected, "{part}");
    }
    // A wall in part 2 hides everything from part 4 on; part 3 may hold its other half.
    let wall = weighed([0.0, 0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]);
    assert_eq!(wanted_parts(&wall, &block), [false, true, true, true, false, false, false, false]);
    // A ray that hardly meets anything is left out where so much is asked for.
    let thin = weighed([0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let opaque = SampleMaskBlock { least_share: 1.0e-3, least_opacity: 0.1, ..block };
    assert_eq!(wanted_parts(&thin, &opaque), [false; 8]);
    assert!(wanted_parts(&thin, &SampleMaskBlock { least_opacity: 1.0e-3, ..opaque })[2]);
}

#[test]
fn higher_thresholds_want_less() {
    let mut random = Random::new(67);
    let mut fewer = 0;
    for _ in 0..20_000 {
        let seen =
            weighed((0..8).map(|_| if random.below(2) == 0 { 0.0 } else { random.log_range(1.0e-3, 3.0) as f32 }));
        let mut unit = |high| random.range(0.0, high) as f32;
        let low =
            SampleMaskBlock { least_share: unit(0.5), termination: unit(0.5), least_opacity: unit(1.0), ..EVERYTHING };
        let high = SampleMaskBlock {
            least_share: low.least_share + unit(0.3),
            termination: low.termination + unit(0.3),
            least_opacity: low.least_opacity + unit(0.3),
            ..low
        };
        for (low, high) in wanted_parts(&seen, &low).into_iter().zip(wanted_parts(&seen, &high)) {
            assert!(low || !high);
            fewer += u32::from(low && !high);
        }
    }
    assert!(fewer > 1_000, "{fewer}");
}

#[test]
fn rays_around_speak_for_a_pixel() {
    // A picture of 7 times 5 pixels, seen at every third column and row: 3 times 2 rays, one of which met something.
    let block = SampleMaskBlock {
        least_share: 0.5,
        termination: 0.0,
        step: 3,
        seen_columns: 3,
        seen_rows: 2,
        width: 7,
        ..EVERYTHING
    };
    let full = weighed([1.0; 8]);
    let empty = weighed([0.0; 8]);
    for node in 0..6_u32 {
        let seen: Vec<[f32; 2]> =
            (0..6).flat_map(|ray| if ray == node { full.clone() } else { empty.clone() }).collect();
        for pixel in 0..35 {
            let (column, row) = (pixel % 7, pixel / 7);
            let near = |at: u32, node: u32, last: u32| at / 3 == node || (at / 3 + 1).min(last) == node;
            let expected = near(column, node % 3, 2) && near(row, node / 3, 1);
            assert_eq!(is_sampled(&seen[..], &RAY, 2.0, 0, pixel, &block), expected, "node {node}, pixel {pixel}");
        }
    }
}
