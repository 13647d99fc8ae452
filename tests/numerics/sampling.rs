//! Random numbers, depth samples and look-ups: known answers, distributions, and what degenerate input gives.

use viewfuse::check::poses::Random;
use viewfuse_core::depths::{inverse_cdf, stratified_depth};
use viewfuse_core::lookup::bilinear;
use viewfuse_core::random::{threefry_2x32, uniform};

#[test]
fn threefry_known_answers() {
    // Random123's kat_vectors, threefry2x32 with 20 rounds.
    assert_eq!(threefry_2x32([0; 2], [0; 2]), [0x6b20_0159, 0x99ba_4efe]);
    assert_eq!(threefry_2x32([u32::MAX; 2], [u32::MAX; 2]), [0x1cb9_96fc, 0xbb00_2be7]);
    let key = [0x1319_8a2e, 0x0370_7344];
    assert_eq!(threefry_2x32(key, [0x243f_6a88, 0x85a3_08d3]), [0xc492_3a9c, 0x483d_f7a0]);
}

#[test]
fn uniform_is_uniform() {
    const COUNT: u32 = 1 << 20;
    for seed in [0, 1, u64::MAX, 1 << 40] {
        let (mut sum, mut squares, mut cells, mut lag) = (0.0, 0.0, [0_u32; 256], 0.0);
        let mut previous = 0.5;
        for i in 0..COUNT {
            let u = uniform(seed, i / 64, i % 64);
            assert!((0.0..1.0).contains(&u) && (u * 16_777_216.0).fract() == 0.0);
            let u = f64::from(u);
            sum += u;
            squares += u * u;
            lag += (u - 0.5) * (previous - 0.5);
            previous = u;
            cells[(u * 256.0) as usize] += 1;
        }
        let count = f64::from(COUNT);
        let (mean, expected) = (sum / count, count / 256.0);
        let variance = squares / count - mean * mean;
        let chi_square: f64 = cells.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
        // Four to five standard deviations each: 0.289 / sqrt N, 0.0745 / sqrt N, 255 +- sqrt(2 * 255), 0.0833 / sqrt
        // N.
        assert!((mean - 0.5).abs() < 5.0 * 0.289 / count.sqrt(), "mean {mean}");
        assert!((variance - 1.0 / 12.0).abs() < 5.0 * 0.0745 / count.sqrt(), "variance {variance}");
        assert!((155.0..360.0).contains(&chi_square), "chi-square {chi_square}");
        assert!((lag / count).abs() < 5.0 * 0.0833 / count.sqrt(), "neighbours {lag}");
    }
    assert_ne!(uniform(1, 2, 3), uniform(1 << 32, 2, 3), "both halves of the seed count");
}

#[test]
fn stratified_depths_at_their_ends() {
    assert_eq!(stratified_depth(1.0, 3.0, 0, 0, 0.5), 2.0);
    assert_eq!(stratified_depth(1.0, 3.0, 9, 4, 0.5), 3.0);
    assert_eq!(stratified_depth(1.0, 3.0, 0, 4, f32::NAN), 1.0);
}

#[test]
fn degenerate_distributions() {
    for nothing in [[0.0_f32; 16], [f32::NAN; 16], [-1.0; 16]] {
        for i in 0..=16 {
            let u = i as f32 / 16.0;
            assert!((inverse_cdf(1.0, 3.0, &nothing, u) - (1.0 + 2.0 * u)).abs() <= 1.0e-6, "uniform at {u}");
        }
    }
    let one_hot: [f32; 16] = std::array::from_fn(|part| (part == 5) as u8 as f32);
    for i in 1..100 {
        let depth = inverse_cdf(0.0, 16.0, &one_hot, i as f32 / 100.0);
        assert!((4.99..=6.01).contains(&depth), "{depth}");
    }
    for weights in [one_hot, [0.3; 16], [1.0e-9; 16]] {
        assert_eq!(inverse_cdf(0.1, 0.7, &weights, 0.0), 0.1);
        assert_eq!(inverse_cdf(0.1, 0.7, &weights, -1.0), 0.1);
        assert_eq!(inverse_cdf(0.1, 0.7, &weights, f32::NAN), 0.1);
        assert_eq!(inverse_cdf(0.1, 0.7, &weights, 1.0), 0.7);
        assert_eq!(inverse_cdf(0.1, 0.7, &weights, 9.0), 0.7);
    }
    assert_eq!(inverse_cdf(1.0, 3.0, &[0.7], 0.5), 2.0);
}

const SIZE: [usize; 2] = [7, 5];

#[test]
fn lookups_at_nodes_borders_and_nan() {
    let random = &mut Random::new(24);
    let grid: Vec<[f32; 2]> =
        (0..SIZE[0] * SIZE[1]).map(|_| [random.normal() as f32, random.normal() as f32]).collect();
    let [width, height] = SIZE.map(|count| count as u32);
    let node = |x: usize, y: usize| grid[y * SIZE[0] + x];
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            assert_eq!(bilinear(&grid[..], width, height, x as f32 + 0.5, y as f32 + 0.5), node(x, y));
        }
    }
    for far in [7.0, 6.5, 1.0e9, f32::INFINITY] {
        assert_eq!(bilinear(&grid[..], width, height, far, 2.5), node(6, 2));
    }
    for low in [0.5, 0.0, -3.0, -1.0e30, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(bilinear(&grid[..], width, height, low, 2.5), node(0, 2));
        assert_eq!(bilinear(&grid[..], width, height, low, low), node(0, 0));
    }
    for coordinate in [-1.0, 0.5, 0.7, 9.0, f32::NAN] {
        assert_eq!(bilinear(&grid[..], 1, 1, coordinate, coordinate), node(0, 0));
    }
}
