//! Bounds on the error and on the time, over all fields.

use std::time::Duration;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::budget::{Bound, Kept};
use viewfuse::field::options::Given;
use viewfuse::field::render::{Frame, RenderOptions};
use viewfuse::field::rows::{self, ROWS};
use viewfuse::field::{AnyField, Renderer};
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::FewShot;
use viewfuse::weighting::Weighting;
use viewfuse_tests::fields::{job, model, on_scene, rms, sample};

/// The most pictures whose error exceeds its bound, as a share.
const MAX_MISSED: f64 = 0.05;
/// The most that one of them exceeds it, as a factor: 1.08 was measured, and 1.6 where a corner of a small picture was
/// lost.
const MAX_EXCESS: f64 = 1.25;

/// A test network of width 16.
fn small(name: &str, seed: u64) -> AnyField {
    let networks = ROWS.into_iter().flat_map(|row| row.test_networks());
    let network = networks.into_iter().find(|network| network.name == name).expect("a test network");
    rows::open((network.checkpoint)(Some(16)), &Given { seed, ..Given::default() }).expect("a network")
}

/// A field with its subject.
struct Case {
    name: String,
    field: AnyField,
    scene: Scene,
    job: FewShot,
    side: u32,
    /// Bounds on the error in decibels.
    bounds: &'static [f32],
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut case = |name: &str, field: AnyField, folder: &str, sources: &str, targets: &str, side, bounds| {
        let scene = sample(folder);
        let job = job(&scene, sources, targets);
        cases.push(Case { name: name.to_owned(), field, scene, job, side, bounds });
    };
    for (seed, sources, targets) in [(1, "16,72,136", "48,104,160,200"), (2, "48,160,200", "16,88,136")] {
        let (car, bounds) = ("car", &[30.0, 35.0, 40.0, 45.0][..]);
        case("pixelnerf, cars", model("pixelnerf_cars.safetensors", seed), car, sources, targets, 48, bounds);
        case("pixelnerf, body", small("body", seed), car, sources, targets, 32, bounds);
        case("pixelnerf, mist", small("formula", seed), car, sources, targets, 24, bounds);
        let bounds = &[28.0, 34.0, 40.0];
        case("genvs, cars", model("genvs_cars.safetensors", seed), car, "16,72,136", "48,160", 32, bounds);
    }
    // A single pixel may have all of such an error.
    case("pixelnerf, tight", small("body", 1), "toy", "0..19/7", "20,21", 32, &[48.0, 50.0]);
    let bounds = &[22.0, 25.0, 28.0, 31.0];
    case("sweep", AnyField::default(), "room", "all/2", "1,3,5,7", 96, bounds);
    case("sweep", AnyField::default(), "room", "0,2,3,5", "1,4", 96, bounds);
    // Small sources with silhouettes have one effort: these pictures are exact.
    case("hull", AnyField::default(), "toy", "0..19/3", "20..23", 64, &[31.0]);
    cases
}

/// All targets of a case under a bound; without one, exact.
fn frames(case: &Case, renderer: &dyn Renderer, bound: Option<Bound>) -> Vec<Frame> {
    let aspect =
        f64::from(case.scene.views[0].camera.pinhole.height()) / f64::from(case.scene.views[0].camera.pinhole.width());
    let size = Some([case.side, (f64::from(case.side) * aspect).round() as u32]);
    // Of the exact picture nothing is omitted; a bound may choose to.
    let early_termination = if bound.is_some() && case.field.about().ends_rays { 1.0 / 256.0 } else { 0.0 };
    let leave_out = if bound.is_some() { 0.01 } else { 0.0 };
    let options = RenderOptions { size, bound, early_termination, leave_out, ..RenderOptions::default() };
    let weighting = Weighting::open("error:alpha=1").expect("a scheme");
    on_scene(&case.scene, &case.job, renderer, &options, |stage| {
        if bound.is_none() && !stage.efforts().is_empty() {
            stage.set_effort(stage.efforts().len() - 1, &Silent).expect("an effort");
        }
        stage.weigh(&weighting, &Silent).expect("weighed");
        let frame = |target| stage.frame(&weighting, target, &Silent).expect("a frame");
        case.job.targets.iter().map(frame).collect()
    })
}

#[test]
fn errors_stay_below_their_bounds() {
    let device = AnyDevice::Cpu(Cpu);
    let (mut pictures, mut missed) = (0, 0);
    // How far below the bound errors are, decibels; exact pictures not counted.
    let mut overshoot = Vec::new();
    for case in cases() {
        let renderer = case.field.on(&device);
        let exact = frames(&case, renderer.as_ref(), None);
        for &decibels in case.bounds {
            let most = 10.0_f32.powf(-decibels / 20.0);
            for (picture, exact) in frames(&case, renderer.as_ref(), Some(Bound::Error(most))).iter().zip(&exact) {
                let error = rms(&picture.colours, &exact.colours);
                let kept = picture.kept.as_ref().expect("a bound");
                assert_eq!((kept.most_error, kept.is_kept), (Some(most), true), "{kept:?}");
                assert!(error < MAX_EXCESS * f64::from(most), "{}, {decibels} dB: {error}, {kept:?}", case.name);
                assert!(kept.effort != "exact" || error == 0.0, "{}: {error}", case.name);
                pictures += 1;
                missed += usize::from(error > f64::from(most));
                if error > 0.0 {
                    overshoot.push(-20.0 * error.log10() - f64::from(decibels));
                }
            }
        }
    }
    let mean = overshoot.iter().sum::<f64>() / overshoot.len() as f64;
    assert!(pictures >= 100, "{pictures}");
    assert!(missed as f64 <= MAX_MISSED * pictures as f64, "{missed} of {pictures} exceed their bound");
    assert!(mean < 10.0, "bounds are not used: {mean} dB");
}

/// In a picture of few pixels a single one counts: rays between others see nothing of a corner that lies between them.
#[test]
fn no_corner_of_a_small_picture_is_lost() {
    let device = AnyDevice::Cpu(Cpu);
    let (scene, bound) = (sample("car"), 1.0e-2);
    let job = job(&scene, "16,72,136", "8,24,32,40,48,56,64,80,88,96,104,112,120,128");
    let field = model("pixelnerf_cars.safetensors", 1);
    let case = Case { name: "pixelnerf, cars".to_owned(), field, scene, job, side: 24, bounds: &[] };
    let renderer = case.field.on(&device);
    let exact = frames(&case, renderer.as_ref(), None);
    let pictures = frames(&case, renderer.as_ref(), Some(Bound::Error(bound)));
    let errors: Vec<f64> = pictures.iter().zip(&exact).map(|(a, b)| rms(&a.colours, &b.colours)).collect();
    assert!(errors.iter().all(|error| *error < MAX_EXCESS * f64::from(bound)), "{errors:?}");
}

/// In this mist empty space is not empty in the second pass, and its pictures are a third of the exact one's work: few
/// pixels tell that. A check after the picture would have 73.
#[test]
fn what_is_dear_is_tried_on_few_pixels_before_its_picture() {
    let device = AnyDevice::Cpu(Cpu);
    let (scene, field) = (sample("car"), small("formula", 0));
    let job = job(&scene, "16,72,136", "48");
    let case = Case { name: "pixelnerf, mist".to_owned(), field, scene, job, side: 48, bounds: &[] };
    let renderer = case.field.on(&device);
    let pictures = frames(&case, renderer.as_ref(), Some(Bound::Error(0.0056)));
    let kept = pictures[0].kept.as_ref().expect("a bound");
    let last = kept.tried.last().expect("what was tried");
    let pixels = last.error.map(|error| error.pixels);
    assert_eq!((last.effort.as_str(), pixels), ("both passes, empty space omitted", Some(32)), "{kept:?}");
    assert_eq!(kept.effort, "exact", "{kept:?}");
}

#[test]
fn a_time_is_kept_where_it_can_be() {
    let device = AnyDevice::Cpu(Cpu);
    for case in cases().into_iter().filter(|case| case.name == "pixelnerf, cars" || case.name == "sweep").take(2) {
        let renderer = case.field.on(&device);
        let kept = |most: Duration| -> Vec<Kept> {
            frames(&case, renderer.as_ref(), Some(Bound::Time(most)))
                .into_iter()
                .filter_map(|frame| frame.kept)
                .collect()
        };
        let generous = kept(Duration::from_secs(600));
        assert!(generous.iter().all(|kept| kept.is_kept && kept.effort == "exact"), "{generous:?}");
        let none = kept(Duration::from_micros(1));
        assert!(none.iter().all(|kept| !kept.is_kept && kept.effort != "exact" && kept.error.is_none()), "{none:?}");
    }
}
