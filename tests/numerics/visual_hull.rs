//! What the kernels of the training-free field are made of, against `f64`: functions that are no kernels themselves.
//!
//! Every element has its own tolerance: the oracle counts the roundings on the way to it (two for each operation) and
//! multiplies them by what follows; an image coordinate's error counts as far as the image changes over it. Elements
//! whose bound is larger than the tolerance stated here, or that hang on a threshold, are left out and must be few.

use viewfuse::check::agreement::{Disagreement, Limits, measure};
use viewfuse::check::bounded::Bounded;
use viewfuse::check::world::{Numbers, World};
use viewfuse::check::{camera_oracle, hull_oracle as oracle};
use viewfuse_kernels::visual_hull::NO_SURFACE;
use viewfuse_kernels::visual_hull::hull::{hull_alpha, hull_entry};
use viewfuse_kernels::visual_hull::shade::{EMPTY, JUMP, depth_at, sample};

const SEEDS: std::ops::Range<u64> = 1..5;

/// What a function computed and what was expected.
#[derive(Default)]
struct Results {
    actual: Vec<f32>,
    expected: Vec<Option<Bounded>>,
}

impl Results {
    fn push(&mut self, actual: f32, expected: Option<Bounded>) {
        self.actual.push(actual);
        self.expected.push(expected);
    }
}

/// Runs a function on one world and the oracle on another.
type Case = fn(&World, &World, &mut Results);

/// An input by name, and how to put it off by 1 %.
type NegativeControl = (&'static str, fn(&mut World));

/// Compares on several worlds, prints the figures, and makes sure that each changed input shows.
fn check(function: &str, tolerance: f64, case: Case, controls: &[NegativeControl]) {
    let run = |change: fn(&mut World)| {
        let mut results = Results::default();
        for seed in SEEDS {
            let world = World::new(seed);
            let mut changed = world.clone();
            change(&mut changed);
            case(&changed, &world, &mut results);
        }
        measure(&results.actual, &results.expected, Limits { tolerance, least: 1.0e-2 })
    };
    let agreement = run(|_| {});
    assert_eq!(agreement.disagreement, None, "{function}: {agreement:?}");
    println!(
        "{function}: {} elements, {:.2} % undecided, worst error {:.1e} ({:.0} % of its bound), tolerance {tolerance:.0e}",
        agreement.compared,
        100.0 * agreement.undecided,
        agreement.worst.absolute,
        100.0 * agreement.worst_of_bound,
    );
    for (input, change) in controls {
        let outcome = run(*change).disagreement;
        assert!(matches!(outcome, Some(Disagreement::Mismatch { .. })), "{function}, {input} off by 1 %: {outcome:?}");
    }
}

// Ten roundings on the way to an image coordinate of at most 40, times an alpha's slope of at most 0.5 a pixel.
#[test]
fn hull_alpha_agrees() {
    let case: Case = |actual, expected, results| {
        for point in expected.points(2000) {
            for least in [0.02, 0.3] {
                let found = hull_alpha(&actual.object, &actual.views[..], &actual.texels[..], point, least);
                results.push(found, oracle::hull_alpha(&expected.scene(), camera_oracle::point(point.into()), least));
            }
        }
    };
    check("hull_alpha", 1.0e-4, case, &[("focal length", World::change_focal), ("texels", World::change_texels)]);
}

/// A point beyond the right border of the first image, inside the others.
#[test]
fn beyond_an_image_its_border_goes_on() {
    let mut world = World::new(1);
    let middle = world.object.middle();
    world.texels.fill([1.0; 4]);
    // Every pixel's surface is as far away as the point.
    for view in &world.views {
        let first = view.first_texel as usize;
        world.depths[first..first + (view.width * view.height) as usize].fill(view.project(middle).depth);
    }
    let first = world.views[0];
    world.views[0].intrinsics[2] += 2.0 * first.width as f32;
    let alpha = |world: &World| hull_alpha(&world.object, &world.views[..], &world.texels[..], middle, 0.3);
    let shade = |world: &World| {
        sample(
            &world.object,
            &world.views[..],
            &world.footprints,
            &world.texels[..],
            &world.depths[..],
            &world.weights,
            middle,
        )
    };
    assert!(!world.views[0].project(middle).in_image && world.views[0].project(middle).in_front);
    // The border shows the object: the image cuts it off, and says nothing of what is beyond.
    assert_eq!(alpha(&world), 1.0);
    assert!(shade(&world) != EMPTY);
    let own = first.first_texel as usize..(first.first_texel + first.width * first.height) as usize;
    let last_column = own.skip(first.width as usize - 1).step_by(first.width as usize);
    last_column.for_each(|texel| world.texels[texel] = [0.0; 4]);
    // The border shows background: the object ends inside the image.
    assert_eq!(alpha(&world), 0.0);
    assert_eq!(shade(&world), EMPTY);
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
    check("depth_at", 1.0e-4, case, &[("depths", World::change_depths)]);
}

// Depths in footprints are good to 1e-4, and the logistic step has a slope of 1 / (4 SURFACE_WIDTH); colours as a
// look-up divided by an alpha of at least 0.02.
#[test]
fn sample_agrees() {
    let case: Case = |actual, expected, results| {
        for point in expected.points(4000) {
            let World { object, views, footprints, texels, depths, weights, .. } = actual;
            let found = sample(object, &views[..], footprints, &texels[..], &depths[..], weights, point);
            let World { footprints, depths, weights, .. } = expected;
            let place = camera_oracle::point(point.into());
            let wanted = oracle::sample(&expected.scene(), footprints, depths, weights, place);
            results.push(found.occupancy, wanted.map(|sample| sample.0));
            (0..3).for_each(|c| results.push(found.colour[c], wanted.map(|sample| sample.1[c])));
        }
    };
    let controls: [NegativeControl; 4] = [
        ("focal length", World::change_focal),
        ("texels", World::change_texels),
        ("depths", World::change_depths),
        ("weight", |world| world.weights[1] *= 1.01),
    ];
    check("sample", 1.0e-3, case, &controls);
}

#[test]
fn hull_entry_ends_at_any_focal_length() {
    let mut world = World::new(1);
    world.views.iter_mut().for_each(|view| view.intrinsics[0] = 1.0e9);
    // Enough for a pixel to ask, too little for any point to belong to the hull.
    world.texels.iter_mut().for_each(|texel| texel[3] = 0.15);
    let World { object, views, texels, .. } = &world;
    let pixel = views[0].width * views[0].height / 2;
    assert_eq!(hull_entry(object, &views[..], &texels[..], 0, pixel), NO_SURFACE);
}

/// Cameras a million units away, where depths are an eighth apart, with such a lens that steps are shorter.
#[test]
fn hull_entry_ends_at_any_distance() {
    let mut world = World::new(1);
    for view in &mut world.views {
        let back = 5.0e5;
        for axis in [&mut view.pose.right, &mut view.pose.down, &mut view.pose.forward] {
            axis[3] *= back;
        }
        view.intrinsics[0] = (50.0 * view.intrinsics[0] * back).min(1.0e9);
        view.intrinsics[1] = (50.0 * view.intrinsics[1] * back).min(1.0e9);
    }
    world.texels.iter_mut().for_each(|texel| texel[3] = 0.15);
    let World { object, views, texels, .. } = &world;
    for pixel in 0..views[0].width * views[0].height {
        assert_eq!(hull_entry(object, &views[..], &texels[..], 0, pixel), NO_SURFACE);
    }
}
