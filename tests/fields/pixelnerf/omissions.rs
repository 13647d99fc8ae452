//! Each thing that can be omitted, alone: what it saves and what it costs, against the exact picture.

use super::{body, exact, largest_difference, mist, omitting, picture, picture_with, recorded, sources, target};
use viewfuse::field::pixelnerf::{Omissions, PixelNerfOptions};
use viewfuse::field::{LeftOut, Rendered};
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{line, rms, weights};

/// Transmittance at which rays end.
const EARLY_TERMINATION: f32 = 1.0 / 256.0;

#[test]
fn nothing_is_omitted_where_nothing_may() {
    let (_, record) = recorded(&body(exact()), &sources(3), &Weights::mean(3), &target(16), EARLY_TERMINATION);
    assert_eq!(record.left_out.len(), 6);
    for line in &record.left_out {
        assert!(!line.switch && line.left_out == 0 && line.of > 0, "{line:?}");
    }
}

#[test]
fn views_that_no_target_uses_are_not_encoded() {
    let (sources, target) = (sources(4), target(16));
    let weights = weights([0.0, 0.25, 0.0, 0.75], 4);
    let reference = picture_with(&body(exact()), &sources, &weights, &target, 0.0);
    let field = body(omitting(Omissions { unused_views: true, ..Omissions::NONE }));
    let (picture, record) = recorded(&field, &sources, &weights, &target, 0.0);
    assert_eq!(picture, reference, "zeros are added exactly");
    let LeftOut { left_out, of, .. } = line(&record, "encoded views");
    assert_eq!((left_out, of), (2, 4));
}

#[test]
fn latent_layers_on_the_grid_are_only_rounding() {
    // Mist, so that every sample counts.
    let (sources, target) = (sources(3), target(24));
    let reference = picture(&mist(exact()), &sources, &target);
    let field = mist(omitting(Omissions { latent_layers: true, ..Omissions::NONE }));
    let (picture, record) = recorded(&field, &sources, &Weights::mean(3), &target, EARLY_TERMINATION);
    let difference = largest_difference(&picture.colours, &reference.colours);
    println!("latent layers on the grid: {difference:.1e}");
    assert!(difference > 0.0, "the same bits: the layers were not moved");
    // A fine sample may fall into the next part where two sums round apart.
    assert!(difference < 2.0e-3, "{difference}");
    let LeftOut { left_out, of, .. } = line(&record, "latent layers at points");
    assert!(left_out == of && of > 0);
}

#[test]
fn each_omission_saves_samples_and_costs_little() {
    let (sources, target, none) = (sources(3), target(32), Omissions::NONE);
    let reference = picture(&body(exact()), &sources, &target);
    for (omissions, what, least_share, largest) in [
        (Omissions { empty_space: 2, ..none }, "first-pass samples", 0.55, 0.02),
        (Omissions { empty_space: 4, ..none }, "first-pass samples", 0.7, 0.02),
        (Omissions { empty_space: 8, ..none }, "first-pass samples", 0.55, 0.2),
        (Omissions { empty_rays: true, ..none }, "second-pass samples", 0.5, 0.02),
        (Omissions { empty_parts: true, ..none }, "second-pass samples", 0.5, 0.02),
        (Omissions { hidden_samples: true, ..none }, "second-pass samples", 0.05, 0.02),
    ] {
        let field = body(omitting(omissions));
        let (picture, record) = recorded(&field, &sources, &Weights::mean(3), &target, EARLY_TERMINATION);
        let difference = largest_difference(&picture.colours, &reference.colours);
        let LeftOut { left_out, of, switch, .. } = line(&record, what);
        let share = left_out as f64 / of as f64;
        println!("{omissions:?}: {share:.3} of the {what} omitted, largest difference {difference:.1e}");
        assert!(switch && share > least_share && difference < largest, "{omissions:?}: {share}, {difference}");
    }
}

#[test]
fn probes_stand_at_the_last_row_and_column_too() {
    let (sources, camera) = (sources(3), target(31));
    // The body in the last corner, cut by the picture's border.
    let pinhole = Pinhole::new(camera.pinhole.focal(), [28.0, 28.0], 31, 31).expect("sound intrinsics");
    let camera = Camera { pinhole, ..camera };
    let reference = picture(&body(exact()), &sources, &camera);
    let opaque = |picture: &Rendered| picture.colours.iter().filter(|colour| colour[3] > 0.5).count();
    assert!(reference.colours[31 * 31 - 1][3] > 0.9 && opaque(&reference) > 60, "cut by the border");
    // From 16 pixels on, only the probe in the last corner can meet it.
    for (step, share) in [(4, 1.0), (16, 0.5), (64, 0.5)] {
        let field = body(omitting(Omissions { empty_space: step, ..Omissions::NONE }));
        let seen = opaque(&picture(&field, &sources, &camera));
        assert!(seen as f64 >= share * opaque(&reference) as f64, "step {step}: {seen} of {}", opaque(&reference));
    }
}

#[test]
fn samples_between_nodes_converge_to_the_exact_picture() {
    let (sources, target) = (sources(3), target(32));
    for (name, field) in [("body", body as fn(PixelNerfOptions) -> _), ("mist", mist)] {
        let reference = picture(&field(exact()), &sources, &target);
        let costs = |nodes: u32| {
            let field = field(omitting(Omissions { nodes, ..Omissions::NONE }));
            let (picture, record) = recorded(&field, &sources, &Weights::mean(3), &target, EARLY_TERMINATION);
            let LeftOut { left_out, of, .. } = line(&record, "second-pass samples");
            (rms(&picture.colours, &reference.colours), left_out as f64 / of as f64)
        };
        let found = [8, 16, 32, 64, 128].map(costs);
        // The mist has a network of its own for the first pass, which places the exact picture's samples.
        assert!(found[1].0 < found[0].0 && found[4].0 < 0.6 * found[1].0, "{name}");
        assert!(found[4].0 < 0.012, "{name}");
        assert!(found[2].1 > 0.6, "{name}");
    }
}

#[test]
fn all_together_save_most_and_cost_little() {
    let (sources, target) = (sources(3), target(32));
    let reference = picture(&body(exact()), &sources, &target);
    let field = body(PixelNerfOptions::default());
    let (default, record) = recorded(&field, &sources, &Weights::mean(3), &target, EARLY_TERMINATION);
    let psnr = -20.0 * rms(&default.colours, &reference.colours).log10();
    assert!(psnr > 50.0, "{psnr} dB");
    let [first, second] = ["first-pass samples", "second-pass samples"].map(|what| line(&record, what));
    let (unasked, all) = (first.left_out + second.left_out, first.of + second.of);
    assert!(unasked as f64 > 0.8 * all as f64, "{unasked} of {all}");
}

#[test]
fn a_higher_limit_of_early_termination_saves_more_and_costs_more() {
    let (sources, target) = (sources(3), target(24));
    let reference = picture(&body(exact()), &sources, &target);
    let weights = Weights::mean(3);
    let with = |early_termination| {
        let field = body(omitting(Omissions { hidden_samples: true, ..Omissions::NONE }));
        let (picture, record) = recorded(&field, &sources, &weights, &target, early_termination);
        (largest_difference(&picture.colours, &reference.colours), line(&record, "second-pass samples").left_out)
    };
    let (strict, loose) = (with(1.0e-4), with(0.5));
    println!(
        "early termination at 1e-4: {:.1e}, {} left out; at 0.5: {:.1e}, {} left out",
        strict.0, strict.1, loose.0, loose.1
    );
    assert!(strict.1 < loose.1 && strict.0 <= loose.0);
    assert!(strict.0 < 5.0e-3);
}
