//! The field of Gaussians alone and as a part of other pictures, on the CPU.

use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::auto;
use viewfuse::field::budget::Bound;
use viewfuse::field::gaussians::Recipe;
use viewfuse::field::render::{Frame, RenderOptions, Stage};
use viewfuse::field::training_free::{Gaussians, TrainingFree};
use viewfuse::field::{AnyField, Renderer};
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::FewShot;
use viewfuse::weighting::Weighting;
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
