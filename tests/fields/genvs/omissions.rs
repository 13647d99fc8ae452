//! Each thing that can be omitted, alone: what it saves and what it costs, against the exact picture.

use super::{
    assert_sound, exact, largest_difference, made, omitting, picture_with, recorded, sources, target, without_denoiser,
};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::LeftOut;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::genvs::{GenvsOptions, Omissions};
use viewfuse::job::progress::Silent;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{line, on_sources, weights};

fn in_18_calls() -> Plan {
    let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count: 18 };
    Plan { steps, ..Plan::fast(0) }
}

#[test]
fn nothing_is_omitted_where_nothing_may() {
    let (_, record) = recorded(&made(exact()), &sources(3), &Weights::mean(3), &target(16));
    assert_eq!(record.left_out.len(), 4);
    for line in &record.left_out {
        assert!(!line.switch && line.left_out == 0 && line.of > 0, "{line:?}");
    }
    assert_eq!(line(&record, "encoded views").of, 3);
    assert_eq!(line(&record, "volume rows").of, 3 * 32);
    assert_eq!(line(&record, "denoiser calls").of, 3);
}

#[test]
fn views_that_no_target_uses_are_not_encoded() {
    let (sources, target, weights) = (sources(4), target(16), weights([0.0, 0.25, 0.0, 0.75], 4));
    let reference = picture_with(&made(exact()), &sources, &weights, &target);
    let field = made(omitting(Omissions { unused_views: true, ..Omissions::NONE }));
    let (picture, record) = recorded(&field, &sources, &weights, &target);
    assert_eq!(picture, reference, "zeros are added exactly");
    let LeftOut { left_out, of, switch, .. } = line(&record, "encoded views");
    assert_eq!((left_out, of, switch), (2, 4, true));
}

#[test]
fn rows_that_no_ray_reaches_are_not_computed() {
    let sources = sources(3);
    // It sees the upper part of what a camera of its place would see whole, then the lower part, then all.
    let camera = target(32);
    let part = |principal_y: f32, height: u32| {
        let pinhole = Pinhole::new(camera.pinhole.focal(), [16.0, principal_y], 32, height).expect("sound intrinsics");
        Camera { pinhole, ..camera }
    };
    let targets = [part(16.0, 8), part(-12.0, 4), part(16.0, 32)];
    let with = |omissions| {
        let field = without_denoiser(omitting(omissions));
        on_sources(&sources, &field, &Silent, |stage| {
            let render = |target: &Camera| {
                let picture = stage.picture(target, &Weights::mean(3), 0.0, &Silent);
                (picture.expect("a picture"), line(&stage.record(), "volume rows").left_out)
            };
            targets.iter().map(render).collect::<Vec<_>>()
        })
    };
    let exact = with(Omissions::NONE);
    let few = with(Omissions { unseen_rows: true, ..Omissions::NONE });
    for ((exact, none), (few, omitted)) in exact.iter().zip(&few) {
        assert_eq!(few, exact, "rows that nobody sees");
        println!("{omitted} of {} rows omitted", 3 * 32);
        assert_eq!(*none, 0);
    }
    assert!(few[0].1 > 20 && few[1].1 < few[0].1 && few[2].1 <= few[1].1, "what was there is not computed again");
}

#[test]
fn an_earlier_frame_saves_calls() {
    let sources = sources(2);
    let cameras = [
        target(16),
        Camera {
            pinhole: target(16).pinhole,
            ..viewfuse_tests::lorry::orbit(16).camera(2.02, 0.35).expect("a camera")
        },
    ];
    let frames = |reuse| {
        let options = GenvsOptions { omissions: Omissions { reuse, ..Omissions::NONE }, ..exact() };
        let field = made(GenvsOptions { plan: Plan { early_termination: None, ..in_18_calls() }, ..options });
        on_sources(&sources, &field, &Silent, |stage| {
            let mut render = |camera| stage.picture(camera, &Weights::mean(2), 0.0, &Silent).expect("a picture");
            let frames = cameras.each_ref().map(&mut render);
            // A frame of another size begins anew.
            assert_sound(&render(&target(8)));
            (frames, line(&stage.record(), "denoiser calls"))
        })
    };
    let (whole, all) = frames(None);
    assert_eq!((all.left_out, all.of, all.switch), (0, 3 * 18, false));
    let (with, some) = frames(Some(1.0));
    assert!(some.switch && some.of == all.of && (5..18).contains(&some.left_out), "{some:?}");
    assert_eq!(with[0], whole[0], "the first frame has none before it");
    assert!(with[1] != whole[1], "the second one started elsewhere");
    assert_sound(&with[1]);
    // Above the largest level nothing is omitted.
    let (_, none) = frames(Some(1.0e6));
    assert_eq!(none.left_out, 0);
}

#[test]
fn a_picture_that_no_longer_changes_ends_early() {
    let (sources, target) = (sources(2), target(16));
    let with = |early_termination| {
        let field = made(GenvsOptions { plan: Plan { early_termination, ..in_18_calls() }, ..exact() });
        let (picture, record) = recorded(&field, &sources, &Weights::mean(2), &target);
        (picture, line(&record, "denoiser calls"))
    };
    let ((whole, _), (early, calls)) = (with(None), with(Plan::fast(0).early_termination));
    let difference = largest_difference(&whole.colours, &early.colours);
    println!("{} of {} calls omitted, largest difference {difference:.1e}", calls.left_out, calls.of);
    assert!(calls.left_out > 0 && calls.of == 18);
    assert!(difference <= 0.5 / 255.0 + 1.0e-6, "half a level: {difference}");
}

#[test]
fn without_denoiser_the_first_features_are_the_picture() {
    let (sources, target) = (sources(2), target(32));
    let mut options = exact();
    (options.rays.near_far, options.rays.length) = (Some([0.8, 1.8]), Some(0.5));
    let field = without_denoiser(options);
    let (picture, record) = recorded(&field, &sources, &Weights::mean(2), &target);
    assert_sound(&picture);
    assert_eq!(record.denoising, None);
    let mut reference = Reference::new(&field, &Cpu, &sources, &Silent).expect("sources on the device");
    let features = reference.features(&[0.5, 0.5], &target.block(0), [0.8, 1.8], 0.5).expect("features");
    for (colour, features) in picture.colours.iter().zip(features.chunks_exact(16)) {
        let expected = [0, 1, 2].map(|channel| (0.5 * (features[channel] + 1.0)).clamp(0.0, 1.0));
        assert_eq!(colour[..3], expected);
    }
    let calls = line(&record, "denoiser calls");
    assert_eq!((calls.left_out, calls.of), (0, 0));
}
