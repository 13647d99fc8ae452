//! What pictures lose by poses that were found, and what refining the poses gains.
//!
//! `cargo run --release -p viewfuse-research -- posed_pictures PROGRAM [--unrefined] SCENE...`
//!
//! As `poses`, on other sets. The accepted photographs are left out, at most three of each set, and rendered from the other accepted
//! ones with the weighting `auto` at 208 pixels, over the whole photographs: once at the scene's own poses, once at those that were found.
//!
//! ```text
//! accepted        photographs with an accepted pose, of those in the set
//! rotation        median over pairs of the angle between relative rotations found and known, degrees: by the solver, and refined
//! centres         root mean square distance of the camera centres, aligned, in percent of their spread: the same
//! left-out score  of the verdict, mean over the photographs, decibels: the same; without a refinement, refined is as by the solver
//! PSNR            mean over the pictures at the known poses, at those found, and the difference
//! ```

use super::sets::{PICTURE_SETS, Set, neighbours};
use super::truth::errors;
use super::{found, view_of};
use anyhow::{Context, bail};
use std::path::PathBuf;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::On;
use viewfuse_field::auto;
use viewfuse_field::render::{RenderError, RenderOptions};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_job::progress::Silent;
use viewfuse_pose::{Found, OpenMvg, PoseError, Verdict};
use viewfuse_scene::few_shot::Selection;
use viewfuse_scene::photographs::{BackgroundChoice, scaled_size};
use viewfuse_scene::{Scene, ScenePoint};

/// Longest side of the pictures.
const SIDE: u32 = 208;

/// Most photographs of a set that are left out.
const MAX_TARGETS: usize = 3;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [program, rest @ ..] = arguments else { bail!("usage: posed_pictures PROGRAM [--unrefined] SCENE...") };
    let refine = rest.first().is_none_or(|first| first != "--unrefined");
    let scenes = &rest[usize::from(!refine)..];
    let solver = OpenMvg { program: PathBuf::from(program) };
    println!("                                                 rotation       centres    left-out score       PSNR");
    println!(
        "scene         photographs  seed focal   accepted solver refined solver refined solver refined  known  found   loss"
    );
    let mut losses = Vec::new();
    for folder in scenes {
        let scene = Scene::open(folder)?;
        for set in PICTURE_SETS.iter().filter(|set| set.count <= scene.views.len()) {
            let loss = one(&scene, set, &solver, refine).with_context(|| format!("{folder}: {set:?}"))?;
            losses.extend(loss);
        }
    }
    losses.sort_by(f64::total_cmp);
    let at = |place: usize| losses.get(place).copied().unwrap_or_default();
    let (median, greatest) = (at(losses.len() / 2), at(losses.len().saturating_sub(1)));
    println!("\n{} accepted sets: loss {median:.2} dB in the median, at most {greatest:.2} dB", losses.len());
    Ok(())
}

/// Prints a set's line; the loss in decibels, if poses were accepted.
fn one(scene: &Scene, set: &Set, solver: &OpenMvg, refine: bool) -> anyhow::Result<Option<f64>> {
    let views = neighbours(scene, set);
    let head = format!("{:<15} {:>9} {:>5} {:<7}", scene.name(), views.len(), set.seed, set.focal.name());
    let (found, _copies) = match found(scene, set, &views, solver, refine) {
        Err(error) if matches!(error.downcast_ref(), Some(PoseError::Few { .. })) => {
            println!("{head}  refused");
            return Ok(None);
        }
        found => found?,
    };
    let Ok(verdict) = &found.verdict else {
        println!("{head}  refused");
        return Ok(None);
    };
    let by_solver = found.attempts[verdict.attempt].solution.as_ref().context("a solution")?;
    let [before, after] = [by_solver, &verdict.solution]
        .map(|solution| errors(scene, solution, &verdict.photos, |photo| view_of(&found, &views, photo)));
    let score = verdict.verified.iter().map(|own| own.left_out.score).sum::<f64>() / verdict.verified.len() as f64;
    let [score_before, score_after] = verdict.refinement.map_or([score; 2], |own| [own.before, own.after]);
    let known = known_scene(scene, &found, verdict, &views);
    let [psnr_known, psnr_found] = [pictures(&known)?, pictures(&verdict.scene)?];
    let loss = psnr_known - psnr_found;
    println!(
        "{head} {:>9} {:>6.2} {:>7.2} {:>6.1} {:>7.1} {score_before:>6.2} {score_after:>7.2} {psnr_known:>6.2} {psnr_found:>6.2} {loss:>6.2}",
        after.count, before.rotation, after.rotation, before.centres, after.centres
    );
    Ok(Some(loss))
}

/// The accepted photographs at their known poses, without masks: whole photographs are compared.
fn known_scene(scene: &Scene, found: &Found, verdict: &Verdict, views: &[usize]) -> Scene {
    let taken: Vec<usize> = verdict.photos.iter().map(|photo| view_of(found, views, *photo)).collect();
    let point = |point: &ScenePoint| {
        let place = |view: &u32| Some(taken.iter().position(|own| own == &(*view as usize))? as u32);
        let seen: Vec<u32> = point.views.iter().filter_map(place).collect();
        (seen.len() > 1).then(|| ScenePoint { views: seen, ..point.clone() })
    };
    let mut known = Scene {
        views: taken.iter().map(|view| scene.views[*view].clone()).collect(),
        points: scene.points.iter().filter_map(point).collect(),
        ..scene.clone()
    };
    known.views.iter_mut().for_each(|view| view.mask = None);
    known
}

/// Mean PSNR of photographs that are left out.
fn pictures(scene: &Scene) -> anyhow::Result<f64> {
    let count = scene.views.len();
    let targets = count.min(MAX_TARGETS);
    let mut scores = Vec::new();
    for target in 0..targets {
        let view = target * (count - 1) / (targets - 1).max(1);
        let (width, height) = scaled_size(&scene.views[view].camera, SIDE);
        let selection = Selection { targets: Some(scene.views[view].name.clone()), ..Selection::default() };
        let job = selection.resolve(scene, 2)?;
        let options = RenderOptions {
            size: Some([width, height]),
            background: BackgroundChoice::None,
            ..RenderOptions::default()
        };
        let renderer = On { device: &Cpu, field: &TrainingFree::default() };
        auto::render(scene, &job, &renderer, &options, &Silent, |_, frame, _| {
            scores.extend(frame.truth.map(|truth| truth.psnr));
            Ok::<(), RenderError>(())
        })?;
    }
    Ok(scores.iter().sum::<f64>() / scores.len().max(1) as f64)
}
