//! The field of Gaussians alone and as a part of other pictures, on the CPU.

use std::sync::Arc;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::auto;
use viewfuse::field::budget::Bound;
use viewfuse::field::gaussians::{GivenGaussians, Recipe};
use viewfuse::field::render::{Frame, RenderOptions, Stage};
use viewfuse::field::training_free::{Gaussians, TrainingFree};
use viewfuse::field::{AnyField, Renderer};
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::FewShot;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene};
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse::weighting::Weighting;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_tests::fields::{job, on_scene, rms, sample};

const DEVICE: AnyDevice = AnyDevice::Cpu(Cpu);

/// Calls `visit` with the views of the sample scene, prepared by a field.
fn with_stage<T>(
    field: AnyField,
    sources: &str,
    options: &RenderOptions,
    visit: impl FnOnce(&mut Stage<'_>, &FewShot, &dyn Renderer) -> T,
) -> T {
    let scene = sample("toy");
    let (job, renderer) = (job(&scene, sources, "21"), field.on(&DEVICE));
    on_scene(&scene, &job, renderer.as_ref(), options, |stage| visit(stage, &job, renderer.as_ref()))
}

/// Two frames of one target under a bound on the error.
fn bounded(most: f32) -> [Frame; 2] {
    let weighting = Weighting::open("distance:power=2").expect("a scheme");
    let options = RenderOptions { bound: Some(Bound::Error(most)), ..RenderOptions::default() };
    with_stage(AnyField::new(Gaussians::default()), "0..19/2", &options, |stage, job, _| {
        stage.weigh(&weighting, &Silent).expect("weights");
        [(); 2].map(|()| stage.frame(&weighting, &job.targets[0], &Silent).expect("a frame"))
    })
}

#[test]
fn cheaper_efforts_are_farther_from_the_exact_picture() {
    let weighting = Weighting::open("distance:power=2").expect("a scheme");
    with_stage(AnyField::new(Gaussians::default()), "0..19/2", &RenderOptions::default(), |stage, job, _| {
        let efforts = stage.efforts();
        assert_eq!(efforts.last().map(|effort| effort.typical_error), Some(0.0));
        assert!(efforts.len() > 2 && efforts.is_sorted_by(|a, b| a.typical_share < b.typical_share));
        assert!(efforts.is_sorted_by(|a, b| a.typical_error > b.typical_error));
        let frame = |stage: &mut Stage<'_>, effort: usize| {
            stage.set_effort(effort, &Silent).expect("an effort");
            stage.weigh(&weighting, &Silent).expect("weights");
            stage.frame(&weighting, &job.targets[0], &Silent).expect("a frame")
        };
        let last = efforts.len() - 1;
        let exact = frame(stage, last);
        let errors: Vec<f64> = (0..last).map(|effort| rms(&frame(stage, effort).colours, &exact.colours)).collect();
        assert!(errors.iter().all(|error| *error > 1.0e-3), "an effort leaves nothing out: {errors:?}");
        assert!(errors[0] > errors[last - 1], "the cheapest is no farther than the dearest: {errors:?}");
        assert_eq!(frame(stage, last).colours, exact.colours, "the exact picture after others");
        // Efforts are listed with what they do.
        let label = &efforts[0].label;
        assert!(label.contains("100 iterations") && label.contains("32 pixels"), "{label}");
    });
}

/// A cheaper picture is compared with one that goes on from it: neither is made for nothing.
#[test]
fn a_bound_on_the_error_is_kept_with_fewer_iterations() {
    let [exact, _] = bounded(1.0e-5);
    assert_eq!(exact.kept.as_ref().map(|kept| (kept.effort.as_str(), kept.is_kept)), Some(("exact", true)));
    for most in [0.05, 0.15] {
        for frame in bounded(most) {
            let kept = frame.kept.as_ref().expect("a record of the bound");
            let error = rms(&frame.colours, &exact.colours);
            assert!(kept.effort.contains("iterations") && kept.is_kept, "{kept:?}");
            assert!(error > 1.0e-4 && error <= f64::from(most), "{error} of {most}: {kept:?}");
        }
    }
}

/// Held-out sources of an object are better with Gaussians, from few photographs and from many; with Gaussians that have
/// hardly learnt anything the hull alone is, and schemes are tried only then.
#[test]
fn the_hull_is_mixed_with_gaussians_where_held_out_sources_gain() {
    let options =
        RenderOptions { background: viewfuse::scene::photographs::BackgroundChoice::Auto, ..RenderOptions::default() };
    let mixture = |sources: &str, recipe: Recipe| {
        let field = TrainingFree { recipe, ..TrainingFree::default() };
        with_stage(AnyField::new(field), sources, &options, |stage, _, renderer| {
            assert!(stage.images.has_silhouettes);
            let chosen = auto::choose(stage, renderer, &options, &Silent).expect("a choice");
            let (mixed, single): (Vec<_>, Vec<_>) = chosen.candidates.iter().partition(|one| one.mixture.is_some());
            assert!((single.len() > 1) == chosen.mixture.is_none(), "{:?}", chosen.candidates);
            // None is tried further where the hull alone is better at the source that is nearest to the others.
            let Some(last) = mixed.last() else {
                assert!(chosen.mixture.is_none());
                return None;
            };
            let score = |one: &&auto::Candidate| one.psnr.expect("a mixture is not given up");
            let best = mixed.iter().map(score).fold(f64::MIN, f64::max);
            assert!(score(last) > best - 0.1, "{last:?} of {best}: the best mixture is the last");
            let label = last.mixture.clone();
            chosen.mixture.and(label)
        })
    };
    let carved = "many small Gaussians, the hull filled and carved by them";
    let hasty = Recipe { iterations: [0, 0, 0, 2], ..Recipe::default() };
    for sources in ["0..19/5", "0..19"] {
        assert_eq!(mixture(sources, Recipe::default()).as_deref(), Some(carved), "large ones fall behind: {sources}");
        assert_eq!(mixture(sources, hasty), None, "the source nearest to the others loses: {sources}");
    }
}

/// Cameras in a row that look along z, with opaque photographs: a dark one and bright ones.
fn row_of_cameras() -> SourceImages {
    let pinhole = Pinhole::new([32.0; 2], [16.0; 2], 32, 32).expect("a pinhole");
    let image = |index: u32| {
        let centre = Vec3::new(0.05 * index as f32, 0.0, 0.0);
        let camera = Camera { pose: Pose::look_at(centre, centre + Vec3::Z, -Vec3::Y).expect("a pose"), pinhole };
        let level = if index == 0 { 0.0 } else { 0.75 };
        // The border is darker than the rest.
        let texel = |pixel: u32| [if pixel < 64 { 0.5 * level } else { level }, level, level, 1.0];
        SourceImage { camera, texels: (0..32 * 32).map(texel).collect() }
    };
    SourceImages {
        images: (0..4).map(image).collect(),
        background: [0.25; 3],
        has_silhouettes: false,
        points: Vec::new(),
        near_far: None,
        focus: None,
        warnings: Vec::new(),
    }
}

fn ball(position: [f32; 3], size: f32, f_dc: [f32; 3]) -> Gaussian {
    Gaussian { position, log_scales: [size.ln(); 3], rotation: [1.0, 0.0, 0.0, 0.0], opacity: 6.0, f_dc }
}

/// Most of a scene is far away, some of it near: a file's Gaussians are drawn wherever a camera sees them, up to 0.2 in
/// front of it.
#[test]
fn given_gaussians_are_drawn_where_they_are_near() {
    let hill = (0..400).map(|index| {
        let [x, y] = [index % 20, index / 20].map(|place| 4.0 * (place as f32 - 9.5));
        ball([x, y, 60.0], 3.0, [-1.0, -1.0, 1.0])
    });
    let object = (0..20).map(|index| ball([0.01 * index as f32, 0.0, 3.0], 0.3, [1.5, -1.5, -1.5]));
    let scene = GaussianScene { gaussians: hill.chain(object).collect(), ..GaussianScene::default() };
    let field = AnyField::new(GivenGaussians { scene, notes: Vec::new(), unit: 1.0 });
    let (renderer, options) = (field.on(&DEVICE), RenderOptions::default());
    let sources = row_of_cameras();
    let camera = sources.images[1].camera;
    let mut stage = Stage::of_sources(Arc::new(sources), renderer.as_ref(), &options, &Silent).expect("a field");
    let weighting = Weighting::open("mean").expect("a scheme");
    for (ahead, what) in [(0.0, "a twentieth of the median depth"), (2.7, "0.3 in front of the camera")] {
        let centre = camera.pose.centre_world() + ahead * Vec3::Z;
        let pose = Pose::look_at(centre, centre + Vec3::Z, -Vec3::Y).expect("a pose");
        let frame = stage.frame_of_size(&weighting, &Camera { pose, ..camera }, [32, 32], &Silent).expect("a frame");
        let [red, _, blue, alpha] = frame.colours[16 * 32 + 16];
        assert!(alpha > 0.9 && red > 0.8 && blue < 0.2, "{what}: {:?}", frame.colours[16 * 32 + 16]);
    }
}

/// What is behind given Gaussians is what their frame says: of opaque photographs their mean, not what a background of
/// theirs would be.
#[test]
fn a_frame_says_what_is_behind_given_gaussians() {
    let scene = GaussianScene { gaussians: vec![ball([0.0, 0.0, 3.0], 0.1, [1.0; 3])], ..GaussianScene::default() };
    let field = AnyField::new(GivenGaussians { scene, notes: Vec::new(), unit: 1.0 });
    let (renderer, options) = (field.on(&DEVICE), RenderOptions::default());
    let sources = Arc::new(row_of_cameras());
    let camera = sources.images[1].camera;
    let mut stage = Stage::of_sources(sources, renderer.as_ref(), &options, &Silent).expect("a field");
    let weighting = Weighting::open("mean").expect("a scheme");
    let frame = stage.frame_of_size(&weighting, &camera, [32, 32], &Silent).expect("a frame");
    let [red, green, blue, alpha] = frame.colours[0];
    assert!(alpha < 1.0e-3, "a corner shows nothing");
    for (seen, said) in [red, green, blue].into_iter().zip(frame.background) {
        assert!((seen - said).abs() < 1.0e-3, "{:?} over {:?}", frame.colours[0], frame.background);
    }
    assert!((green - 0.75 * 0.75).abs() < 1.0e-3, "the mean of four photographs");
}
