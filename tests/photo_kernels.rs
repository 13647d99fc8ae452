//! The kernels of the weight-free field against their `f64` evaluation.
//!
//! Every element has its own tolerance: the oracle counts the roundings on the way to it (two for each operation) and
//! multiplies them by what follows; an image coordinate's error counts as far as the image changes over it. Elements
//! whose bound is larger than the tolerance stated here, or that hang on a threshold, are left out and must be few.

#[path = "photo_kernels/world.rs"]
mod world;

use viewfuse_core::camera::CameraBlock;
use viewfuse_core::photo::NO_SURFACE;
use viewfuse_core::photo::hull::{hull_alpha, hull_entry};
use viewfuse_core::photo::march::{MarchBlock, march};
use viewfuse_core::photo::shade::{JUMP, depth_at, sample};
use viewfuse_core::photo::sweep::{match_cost, mean_column, pick_depth, sum_row};
use viewfuse_tests::bounded::{Bounded, Disagreement, compare};
use viewfuse_tests::photo_oracle as oracle;
use world::{Numbers, Results, World};

const SEEDS: std::ops::Range<u64> = 1..5;

/// Runs a kernel on one world and the oracle on another.
type Case = fn(&World, &World, &mut Results);

/// An input by name, and how to put it off by 1 %.
type Spoiler = (&'static str, fn(&mut World));

/// Compares on several worlds, prints the figures, and makes sure that each spoilt input shows.
fn check(kernel: &str, tolerance: f64, case: Case, spoilers: &[Spoiler]) {
    let run = |spoil: fn(&mut World)| {
        let mut results = Results::default();
        for seed in SEEDS {
            let world = World::new(seed);
            let mut spoilt = world.clone();
            spoil(&mut spoilt);
            case(&spoilt, &world, &mut results);
        }
        compare(&results.actual, &results.expected, tolerance)
    };
    let agreement = run(|_| {}).unwrap_or_else(|error| panic!("{kernel}: {error:?}"));
    println!(
        "{kernel}: {} elements, {:.2} % undecided, worst error {:.1e} ({:.0} % of its bound), tolerance {tolerance:.0e}",
        agreement.compared,
        100.0 * agreement.undecided,
        agreement.worst,
        100.0 * agreement.worst_of_bound,
    );
    for (input, spoil) in spoilers {
        let outcome = run(*spoil);
        assert!(matches!(outcome, Err(Disagreement::Mismatch { .. })), "{kernel}, {input} off by 1 %: {outcome:?}");
    }
}

fn spoil_focal(world: &mut World) {
    world.views[1].intrinsics[0] *= 1.01;
}

fn spoil_texels(world: &mut World) {
    let first = world.views[1].first_texel as usize;
    for texel in &mut world.texels[first..] {
        *texel = texel.map(|value| value * 0.99);
    }
}

fn spoil_weight(world: &mut World) {
    world.weights[1] *= 1.01;
    world.pair_weights[1] *= 1.01;
}

fn spoil_depths(world: &mut World) {
    world.depths.iter_mut().filter(|depth| **depth < NO_SURFACE).for_each(|depth| *depth *= 1.01);
}

fn spoil_box(world: &mut World) {
    world.object.high[0] *= 1.01;
}

// Ten roundings on the way to an image coordinate of at most 40, times an alpha's slope of at most 0.5 a pixel.
#[test]
fn hull_alpha_agrees() {
    let case: Case = |actual, expected, results| {
        for point in expected.points(2000) {
            for least in [0.02, 0.3] {
                let found = hull_alpha(&actual.object, &actual.views, &actual.texels[..], point, least);
                results.push(found, oracle::hull_alpha(&expected.scene(), oracle::point(point.into()), least));
            }
        }
    };
    check("hull_alpha", 1.0e-4, case, &[("focal length", spoil_focal), ("texels", spoil_texels)]);
}

// Up to 60 additions of a step to a depth of 3.
#[test]
fn hull_entry_agrees() {
    let case: Case = |actual, expected, results| {
        for (view, camera) in (0..).zip(&expected.views) {
            for pixel in 0..camera.width * camera.height {
                let found = hull_entry(&actual.object, &actual.views, &actual.texels[..], view, pixel);
                results.push(found, oracle::hull_entry(&expected.scene(), view, pixel));
            }
        }
    };
    check("hull_entry", 1.0e-4, case, &[("box", spoil_box), ("focal length", spoil_focal)]);
}

// Colours are as good as a look-up divided by an alpha of at least 0.3; shares multiply them by at most 1 / NO_WITNESS.
#[test]
fn match_cost_agrees() {
    let case: Case = |actual, expected, results| {
        let sweep = expected.sweep(0);
        let width = expected.views[0].width;
        for pixel in sweep.first_row * width..(sweep.first_row + sweep.row_count) * width {
            for plane in 0..sweep.plane_count {
                let World { object, views, texels, entries, pair_weights, .. } = actual;
                let found = match_cost(object, &sweep, views, &texels[..], &entries[..], pair_weights, pixel, plane);
                let World { entries, pair_weights, .. } = expected;
                let scene = expected.scene();
                results.push(found, oracle::match_cost(&scene, &sweep, entries, pair_weights, pixel, plane));
            }
        }
    };
    let spoilers: [Spoiler; 3] = [("focal length", spoil_focal), ("texels", spoil_texels), ("weight", spoil_weight)];
    check("match_cost", 1.0e-4, case, &spoilers);
}

/// Costs as [`match_cost`] could give: smooth with a valley, a quarter of them outside.
fn costs(numbers: &mut Numbers, pixel_count: u32, plane_count: u32, scale: f32) -> Vec<f32> {
    let mut costs = Vec::new();
    for _ in 0..pixel_count {
        let valley = numbers.between(0.0, plane_count as f32);
        for plane in 0..plane_count {
            let away = (plane as f32 - valley) / plane_count as f32;
            let cost = 0.02 + 0.15 * away.abs() + numbers.between(0.0, 0.01);
            costs.push(if numbers.between(0.0, 1.0) < 0.25 { -1.0 } else { cost * scale });
        }
    }
    costs
}

fn band_costs(world: &World, scale: f32) -> (viewfuse_core::photo::sweep::SweepBlock, u32, Vec<f32>) {
    let (sweep, width) = (world.sweep(0), world.views[0].width);
    let costs = costs(&mut Numbers::new(5), sweep.row_count * width, sweep.plane_count, scale);
    (sweep, width, costs)
}

/// A spoilt world has other footprints; costs have no field of their own.
fn cost_scale(actual: &World, expected: &World) -> f32 {
    actual.footprints[0] / expected.footprints[0]
}

fn spoil_costs(world: &mut World) {
    world.footprints[0] *= 1.01;
}

// Sums of at most five costs of at most 0.2.
#[test]
fn sum_row_agrees() {
    let case: Case = |actual, expected, results| {
        let (sweep, width, given) = band_costs(expected, cost_scale(actual, expected));
        let (_, _, costs) = band_costs(expected, 1.0);
        for pixel in 0..sweep.row_count * width {
            for plane in 0..sweep.plane_count {
                let found = sum_row(&sweep, &given, pixel, plane);
                let wanted = oracle::sum_row(&sweep, width, &costs, pixel, plane);
                (0..2).for_each(|part| results.push(found[part], wanted[part]));
            }
        }
    };
    check("sum_row", 1.0e-6, case, &[("costs", spoil_costs)]);
}

// Sums of at most 25 costs of at most 0.2, divided by at most as many.
#[test]
fn mean_column_agrees() {
    let case: Case = |actual, expected, results| {
        let (sweep, width, given) = band_costs(expected, cost_scale(actual, expected));
        let (_, _, costs) = band_costs(expected, 1.0);
        let elements =
            || (0..sweep.row_count * width).flat_map(|pixel| (0..sweep.plane_count).map(move |p| (pixel, p)));
        let rows: Vec<[f32; 2]> = elements().map(|(pixel, plane)| sum_row(&sweep, &given, pixel, plane)).collect();
        for (pixel, plane) in elements() {
            let found = mean_column(&sweep, &given, &rows, pixel, plane);
            results.push(found, oracle::mean_column(&sweep, width, &costs, pixel, plane));
        }
    };
    check("mean_column", 1.0e-6, case, &[("costs", spoil_costs)]);
}

// Costs are good to 1e-7, and the parabola divides them by curvatures that are mostly above 1e-3: 1e-4 of a plane's
// distance of 0.2.
#[test]
fn pick_depth_agrees() {
    let case: Case = |actual, expected, results| {
        let (sweep, width, given) = band_costs(expected, cost_scale(actual, expected));
        let (_, _, means) = band_costs(expected, 1.0);
        let first = (sweep.first_row * width) as usize;
        let none = vec![NO_SURFACE; expected.depths.len()];
        for guess in [&expected.depths[first..], &none[..]] {
            for pixel in 0..sweep.row_count * width {
                let (found_entries, entries) = (&actual.entries[first..], &expected.entries[first..]);
                let found = pick_depth(&actual.object, &sweep, &given, found_entries, guess, pixel);
                let wanted = oracle::pick_depth(&expected.object, &sweep, width, &means, entries, guess, pixel);
                results.push(found, wanted);
            }
        }
    };
    check("pick_depth", 1.0e-4, case, &[("costs", spoil_costs)]);
}

// A coordinate's error times the change of depth over a pixel, at most a jump of 0.4.
#[test]
fn depth_at_agrees() {
    let case: Case = |actual, expected, results| {
        let numbers = &mut Numbers::new(8);
        for (view, camera) in expected.views.iter().enumerate() {
            let jump = JUMP * expected.footprints[view];
            for _ in 0..1000 {
                let x = numbers.between(0.0, camera.width as f32);
                let y = numbers.between(0.0, camera.height as f32);
                let found = depth_at(camera, &actual.depths[..], x, y, jump);
                let at = [x, y, jump].map(Bounded::from);
                results.push(found, oracle::depth_at(camera, &expected.depths, at[0], at[1], at[2]));
            }
        }
    };
    check("depth_at", 1.0e-4, case, &[("depths", spoil_depths)]);
}

// Depths in footprints are good to 1e-4, and the logistic step has a slope of 1 / (4 SURFACE_WIDTH); colours as a
// look-up divided by an alpha of at least 0.02.
#[test]
fn sample_agrees() {
    let case: Case = |actual, expected, results| {
        for point in expected.points(4000) {
            let World { object, views, footprints, texels, depths, weights, .. } = actual;
            let found = sample(object, views, footprints, &texels[..], &depths[..], weights, point);
            let World { footprints, depths, weights, .. } = expected;
            let place = oracle::point(point.into());
            let wanted = oracle::sample(&expected.scene(), footprints, depths, weights, place);
            results.push(found.occupancy, wanted.map(|sample| sample.0));
            (0..3).for_each(|c| results.push(found.colour[c], wanted.map(|sample| sample.1[c])));
        }
    };
    let spoilers: [Spoiler; 4] =
        [("focal length", spoil_focal), ("texels", spoil_texels), ("depths", spoil_depths), ("weight", spoil_weight)];
    check("sample", 1.0e-3, case, &spoilers);
}

fn march_one(world: &World, target: &CameraBlock, at: [f32; 2], settled: f32) -> [f32; 5] {
    let World { object, views, footprints, texels, depths, weights, .. } = world;
    let background = [1.0, 0.5, 0.25];
    let block = MarchBlock { target: *target, background, settled };
    let seen = march(object, views, footprints, &texels[..], &depths[..], weights, &block, at);
    [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity, seen.depth]
}

// As a sample: the transmittance is the least of theirs, and each level of it is used once.
#[test]
fn march_agrees() {
    let case: Case = |actual, expected, results| {
        for row in 0..2 * expected.target.height {
            for column in 0..2 * expected.target.width {
                let at = [0.5 * column as f32 + 0.3, 0.5 * row as f32 + 0.3];
                let settled = if row % 2 == 0 { 0.0 } else { 0.1 };
                let found = march_one(actual, &actual.target, at, settled);
                let World { footprints, depths, weights, target, .. } = expected;
                let background = [1.0, 0.5, 0.25];
                let wanted =
                    oracle::march(&expected.scene(), footprints, depths, weights, target, at, background, settled);
                (0..3).for_each(|c| results.push(found[c], wanted.map(|pixel| pixel.colour[c])));
                results.push(found[3], wanted.map(|pixel| pixel.opacity));
                results.push(found[4], wanted.and_then(|pixel| pixel.depth));
            }
        }
    };
    let spoilers: [Spoiler; 4] = [
        ("target's focal length", |world| world.target.intrinsics[0] *= 1.01),
        ("texels", spoil_texels),
        ("depths", spoil_depths),
        ("weight", spoil_weight),
    ];
    check("march", 2.0e-3, case, &spoilers);
}

#[test]
fn hull_entry_ends_at_any_focal_length() {
    let mut world = World::new(1);
    world.views.iter_mut().for_each(|view| view.intrinsics[0] = 1.0e9);
    // Enough for a pixel to ask, too little for any point to belong to the hull.
    world.texels.iter_mut().for_each(|texel| texel[3] = 0.15);
    let World { object, views, texels, .. } = &world;
    let pixel = views[0].width * views[0].height / 2;
    assert_eq!(hull_entry(object, views, &texels[..], 0, pixel), NO_SURFACE);
}

#[test]
fn the_comparison_rejects_what_it_must() {
    let expected = [Some(Bounded::ONE), Some(Bounded::ZERO)];
    assert!(compare(&[1.0, 0.0], &expected, 1.0).is_ok());
    assert_eq!(compare(&[1.0], &expected, 1.0), Err(Disagreement::Length));
    assert!(matches!(compare(&[1.0, f32::NAN], &expected, 1.0), Err(Disagreement::Mismatch { index: 1, .. })));
    assert!(matches!(compare(&[f32::NAN, 1.0], &[None, None], 1.0), Err(Disagreement::Mismatch { index: 0, .. })));
    assert!(matches!(compare(&[1.0, 1.0e-6], &expected, 1.0), Err(Disagreement::Mismatch { index: 1, .. })));
    assert!(matches!(compare(&[1.0, 0.0], &[None, None], 1.0), Err(Disagreement::Undecided { .. })));
    assert_eq!(compare(&[1.0, 1.0], &[Some(Bounded::ONE); 2], 1.0), Err(Disagreement::Constant));
    let vague = Some(Bounded { value: 0.0, error: 2.0 });
    assert!(matches!(compare(&[1.0, 0.0], &[vague; 2], 1.0), Err(Disagreement::Undecided { .. })));
}
