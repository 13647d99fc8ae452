//! The scheme and the settings that are chosen for a scene, and the score that is expected: on generated scenes.

use std::error::Error;
use std::path::Path;
use std::sync::LazyLock;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::auto::{self, Chosen, HOLD_OUT, choose, schemes};
use viewfuse::field::pixelnerf::{Architecture, PixelNerf, PixelNerfOptions, test_networks};
use viewfuse::field::render::{Frame, RenderError, RenderOptions, RenderRun, Stage, render_all};
use viewfuse::field::training_free::{Cache, TrainingFree};
use viewfuse::field::{AnyOptions, Field, On};
use viewfuse::job::progress::{Interrupted, Progress, Silent};
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::{FewShot, Selection};
use viewfuse::scene::photographs::Album;
use viewfuse_lab::scenes::{generate, write_shoot};
use viewfuse_tests::listener::Listener;

const SIZE: [u32; 2] = [64, 48];

/// A room from an arc, views 0 to `count` - 1.
fn room(folder: &Path, count: u32) -> Scene {
    let shoot = generate(17, SIZE, count).expect("a room");
    let folder = folder.join("room");
    write_shoot(&folder, &shoot, 1, &Silent).expect("photographs");
    Scene::open(&folder).expect("a scene")
}

/// The middle view from the others.
fn middle(scene: &Scene) -> FewShot {
    let targets = Some(scene.views[scene.views.len() / 2].name.clone());
    Selection { targets, ..Selection::default() }.resolve(scene, 2).expect("a job")
}

fn options() -> RenderOptions {
    RenderOptions { size: Some(SIZE), ..RenderOptions::default() }
}

/// What is chosen for these sources.
fn chosen(
    scene: &Scene,
    sources: &[usize],
    field: &(impl Field + Sync),
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Chosen, RenderError> {
    let renderer = On { device: &Cpu, field };
    let album = Album::open(scene, sources.iter().copied(), &Silent)?;
    let stage = Stage::prepare(scene, &album, sources, &renderer, options, &Silent)?;
    choose(&stage, &renderer, options, progress)
}

/// A run with what is chosen.
fn automatic(scene: &Scene) -> Result<(Vec<Frame>, Chosen), Box<dyn Error>> {
    let field = TrainingFree::default();
    let (renderer, mut frames) = (On { device: &Cpu, field: &field }, Vec::new());
    let (job, options) = (middle(scene), options());
    let run = RenderRun { scene, job: &job, renderer: &renderer, options: &options, progress: &Silent };
    let (_, chosen) = auto::render(&run, None, |_, frame, _| {
        frames.push(frame);
        Ok::<(), RenderError>(())
    })?;
    Ok((frames, chosen.ok_or("nothing was given")?))
}

/// A room of six photographs, and what is chosen and rendered for its middle view: several tests look at it.
struct Six {
    scene: Scene,
    frames: Vec<Frame>,
    chosen: Chosen,
}

static SIX: LazyLock<Six> = LazyLock::new(|| {
    // Nothing of a static is removed at the end.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("auto");
    std::fs::remove_dir_all(&folder).ok();
    std::fs::create_dir_all(&folder).expect("a folder");
    let scene = room(&folder, 6);
    let (frames, chosen) = automatic(&scene).expect("a picture");
    Six { scene, frames, chosen }
});

#[test]
fn what_is_chosen_is_what_is_rendered() -> Result<(), Box<dyn Error>> {
    let Six { scene, frames, chosen } = &*SIX;
    let field = TrainingFree::default();
    let renderer = On { device: &Cpu, field: &field };
    let given = RenderOptions { field: Some(chosen.options.clone()), mixture: chosen.mixture.clone(), ..options() };
    let same = render_all(scene, &middle(scene), &chosen.weighting, &renderer, &given)?;
    assert_eq!((frames.len(), same.len()), (1, 1));
    assert_eq!(frames[0].colours, same[0].colours);
    assert_eq!(frames[0].confidences, same[0].confidences);
    assert_eq!(frames[0].shares, same[0].shares);
    assert_eq!(frames[0].confidences.len(), frames[0].colours.len());
    assert!(frames[0].confidences.iter().all(|confidence| (0.0..=1.0).contains(confidence)));
    Ok(())
}

#[test]
fn the_choice_is_the_best_that_was_tried_or_the_default() -> Result<(), Box<dyn Error>> {
    let Six { frames, chosen, .. } = &*SIX;
    let Chosen { candidates, held_out, weighting, options, .. } = chosen;
    assert_eq!(held_out.len(), 5.min(HOLD_OUT.max_views));
    assert!(candidates.len() > schemes().len(), "the field's scalars are tried as well");
    assert!(candidates.iter().all(|candidate| candidate.scores.iter().all(|score| *score > 5.0)));
    let given_up = |candidate: &&auto::Candidate| candidate.scores.len() < held_out.len();
    assert!(candidates.iter().filter(given_up).all(|candidate| candidate.psnr.is_none()), "{candidates:?}");
    let score = |candidate: &auto::Candidate| candidate.psnr;
    let tried = candidates
        .iter()
        .find(|one| one.weighting == weighting.to_string() && one.options.settings() == options.settings());
    let psnr = tried.map(score).ok_or("the choice was tried")?;
    assert!(psnr >= score(&candidates[0]), "{psnr:?} is below the default");
    let expected = chosen.expected(&frames[0]).ok_or("a score to expect")?;
    let truth = frames[0].truth.as_ref().ok_or("a truth")?.psnr;
    println!("expected {expected:?}, true {truth:.2} dB");
    assert!(expected.interval[0] < expected.psnr && expected.psnr < expected.interval[1]);
    assert!((expected.psnr - truth).abs() < 4.0, "{expected:?} instead of {truth:.2} dB");
    Ok(())
}

#[test]
fn pictures_are_mixed_where_that_is_not_worse() -> Result<(), Box<dyn Error>> {
    let Six { scene, frames, chosen } = &*SIX;
    let tried = chosen.candidates.last().ok_or("candidates")?;
    let last = tried.options.settings().last().map(|setting| setting.name);
    assert_eq!(last, Some("mixed pictures"), "a mixture is tried last");
    let mixed = tried.psnr.ok_or("a mixture is not given up")?;
    let best = |candidates: &[auto::Candidate]| candidates.iter().filter_map(|one| one.psnr).fold(f64::MIN, f64::max);
    let single = best(&chosen.candidates[..chosen.candidates.len() - 1]);
    println!("mixed {mixed:.2} dB, one picture {single:.2} dB, shares {:?}", frames[0].shares);
    match &chosen.mixture {
        // The best of all that was tried is not always what was chosen before: gains within the noise do not count.
        None => assert!(mixed < single, "{mixed} against {single}"),
        Some(mixture) => {
            // Three of the plane sweep, and the Gaussians.
            assert_eq!((mixture.parts.len(), mixture.constants.len(), frames[0].shares.len()), (4, 3, 4));
            let settings = mixture.parts.iter().flat_map(AnyOptions::settings);
            let of_gaussians = settings.filter(|setting| setting.name == "gaussians" && setting.value > 0.0);
            assert_eq!(of_gaussians.count(), 1, "{:?}", mixture.parts);
            assert!(mixed > single - 0.2, "{mixed} against {single}");
            assert!((frames[0].shares.iter().sum::<f32>() - 1.0).abs() < 1.0e-4, "{:?}", frames[0].shares);
            // What is mixed is the pictures under the settings of the parts.
            let field = TrainingFree::default();
            let renderer = On { device: &Cpu, field: &field };
            let mut levels: Vec<Vec<f32>> = Vec::new();
            for part in &mixture.parts {
                let given = RenderOptions { field: Some(part.clone()), ..options() };
                let frames = render_all(scene, &middle(scene), &chosen.weighting, &renderer, &given)?;
                levels.push(frames[0].colours.iter().map(|colour| colour[1]).collect());
            }
            for (pixel, colour) in frames[0].colours.iter().enumerate() {
                let (low, high) = levels
                    .iter()
                    .fold((f32::MAX, f32::MIN), |(low, high), part| (low.min(part[pixel]), high.max(part[pixel])));
                let is_between = (low - 1.0e-5..high + 1.0e-5).contains(&colour[1]);
                assert!(is_between, "{pixel}: {colour:?} in {low} to {high}");
            }
        }
    }
    Ok(())
}

#[test]
fn two_sources_give_the_default_and_no_expectation() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = room(folder.path(), 3);
    let (frames, chosen) = automatic(&scene)?;
    assert!(chosen.mixture.is_none() && frames[0].shares.is_empty());
    assert!(chosen.candidates.is_empty() && chosen.options.settings().is_empty() && chosen.held_out.is_empty());
    assert_eq!(chosen.expected(&frames[0]), None);
    Ok(())
}

#[test]
fn a_scene_on_which_copies_are_better_is_told() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = room(folder.path(), 5);
    let listener = Listener::default();
    let chosen_here = chosen(&scene, &[0, 1, 2, 3, 4], &TrainingFree::default(), &options(), &listener)?;
    assert!(chosen_here.held_out.iter().all(|source| source.copy_psnr > 5.0));
    assert_eq!(listener.warnings(), [""; 0]);
    // The same photograph for each camera: the camera poses are wrong, and a copy is perfect.
    let mut wrong = scene.clone();
    for view in &mut wrong.views {
        view.image.clone_from(&scene.views[0].image);
    }
    chosen(&wrong, &[0, 1, 2, 3, 4], &TrainingFree::default(), &options(), &listener)?;
    let warnings = listener.warnings();
    assert!(warnings.iter().any(|warning| warning.contains("pictures may be worse than a copy")), "{warnings:?}");
    // Each camera has the photograph of the next one.
    for view in 0..5 {
        wrong.views[view].image.clone_from(&scene.views[(view + 1) % 5].image);
    }
    let listener = Listener::default();
    chosen(&wrong, &[0, 1, 2, 3, 4], &TrainingFree::default(), &options(), &listener)?;
    let warnings = listener.warnings();
    assert!(warnings.iter().any(|warning| warning.contains("camera poses")), "{warnings:?}");
    Ok(())
}

#[test]
fn a_field_without_scalars_has_its_scheme_chosen() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = room(folder.path(), 3);
    let network = test_networks::body(&Architecture::small(16));
    let field = PixelNerf::new(&network, PixelNerfOptions::default())?;
    let chosen = chosen(&scene, &[0, 1, 2], &field, &options(), &Silent)?;
    assert_eq!((chosen.candidates.len(), chosen.options.settings().len()), (schemes().len(), 0));
    Ok(())
}

#[test]
fn a_choice_is_kept_for_the_same_sources_and_options_alone() -> Result<(), Box<dyn Error>> {
    const SMALL: [u32; 2] = [36, 27];
    let scene = &SIX.scene;
    let folder = tempfile::tempdir()?;
    let field = TrainingFree { cache: Some(Cache::open(folder.path())?), ..TrainingFree::default() };
    let sources = middle(scene).sources;
    // The choice, how much work it took, and the warnings.
    let choose = |sources: &[usize], size: [u32; 2], leave_out: f32| -> Result<(Chosen, [usize; 2]), RenderError> {
        let options = RenderOptions { size: Some(size), leave_out, ..RenderOptions::default() };
        let listener = Listener::default();
        let chosen = chosen(scene, sources, &field, &options, &listener)?;
        Ok((chosen, [listener.asked(), listener.warnings().len()]))
    };
    let (first, [work, warnings]) = choose(&sources, SMALL, 0.01)?;
    let is_first = |other: &Chosen| {
        assert_eq!((&other.candidates, &other.held_out), (&first.candidates, &first.held_out));
        assert_eq!((&other.mixture, &other.options, other.basis), (&first.mixture, &first.options, first.basis));
        assert_eq!(other.weighting.to_string(), first.weighting.to_string());
        assert_eq!(other.calibration, first.calibration);
    };
    let (second, [less, _]) = choose(&sources, SMALL, 0.01)?;
    is_first(&second);
    assert!(10 * less < work, "{less} of {work}");
    for (sources, size, leave_out) in
        [(&sources[1..], SMALL, 0.01), (&sources, SMALL.map(|side| side * 4 / 3), 0.01), (&sources, SMALL, 0.0)]
    {
        let (_, [anew, _]) = choose(sources, size, leave_out)?;
        assert!(4 * anew > work, "{anew} of {work} with {sources:?}, {size:?}, {leave_out}");
    }
    // What is damaged is not used.
    for file in std::fs::read_dir(folder.path())? {
        let path = file?.path();
        let mut bytes = std::fs::read(&path)?;
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(path, bytes)?;
    }
    let (third, [again, told]) = choose(&sources, SMALL, 0.01)?;
    is_first(&third);
    assert!(4 * again > work && told > warnings, "{again} of {work}, {told} warnings");
    Ok(())
}

#[test]
fn it_can_be_stopped() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = room(folder.path(), 4);
    for looks in [0, 5, 40] {
        let patience = Listener::stops_after(looks);
        let Err(error) = chosen(&scene, &[0, 1, 2, 3], &TrainingFree::default(), &options(), &patience) else {
            panic!("{looks} looks are not enough");
        };
        let mut cause: Option<&(dyn Error + 'static)> = Some(&error);
        while let Some(inner) = cause.filter(|cause| !cause.is::<Interrupted>()) {
            cause = inner.source();
        }
        assert!(cause.is_some(), "{error}");
    }
    Ok(())
}
