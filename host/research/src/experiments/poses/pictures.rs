//! What pictures lose by poses that were found.
//!
//! `cargo run --release -p viewfuse-research -- posed_pictures PROGRAM SCENE...`
//!
//! As `poses`, on other sets. Of the accepted photographs, one (of nine two, of fifteen three) are left out and rendered from the
//! other accepted ones with the weighting `auto` at 208 pixels, over the whole photographs: once at the scene's own poses, once at
//! those that were found.
//!
//! ```text
//! accepted   photographs with an accepted pose, of those in the set
//! rotation   median over pairs of the angle between relative rotations found and known, degrees
//! centres    root mean square distance of the camera centres, aligned, in percent of their spread
//! PSNR       mean over the pictures at the known poses, at those found, and the difference, decibels
//! ```

use super::sets::{PICTURE_SETS, Set, neighbours};
use super::truth::errors;
use super::{found_or_few, view_of};
use anyhow::{Context, bail};
use std::path::PathBuf;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::On;
use viewfuse_field::auto;
use viewfuse_field::render::{RenderError, RenderOptions};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_job::progress::Silent;
use viewfuse_pose::{Found, OpenMvg, Options, Verdict};
use viewfuse_scene::few_shot::Selection;
use viewfuse_scene::photographs::{BackgroundChoice, scaled_size};
use viewfuse_scene::{Scene, ScenePoint};

/// Longest side of the pictures.
const SIDE: u32 = 208;

/// Of so many photographs one is left out.
const PER_TARGET: usize = 5;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [program, scenes @ ..] = arguments else { bail!("usage: posed_pictures PROGRAM SCENE...") };
    let solver = OpenMvg { program: PathBuf::from(program) };
    println!("scene         photographs  seed focal   accepted  rotation  centres  PSNR known  found   loss");
    let mut losses = Vec::new();
    for folder in scenes {
        let scene = Scene::open(folder)?;
        for set in PICTURE_SETS.iter().filter(|set| set.count <= scene.views.len()) {
            let loss = one(&scene, set, &solver).with_context(|| format!("{folder}: {set:?}"))?;
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
fn one(scene: &Scene, set: &Set, solver: &OpenMvg) -> anyhow::Result<Option<f64>> {
    let views = neighbours(scene, set);
    let head = format!("{:<15} {:>9} {:>5} {:<7}", scene.name(), views.len(), set.seed, set.focal.name());
    let Some((found, _copies)) = found_or_few(scene, set, &views, solver, Options::default().refine)? else {
        println!("{head}  refused");
        return Ok(None);
    };
    let Ok(verdict) = &found.verdict else {
        println!("{head}  refused");
        return Ok(None);
    };
    let own = errors(scene, &verdict.solution, &verdict.photos, |photo| view_of(&found, &views, photo));
    let known = known_scene(scene, &found, verdict, &views);
    let [psnr_known, psnr_found] = [pictures(&known)?, pictures(&verdict.scene)?];
    let loss = psnr_known - psnr_found;
    println!(
        "{head} {:>9} {:>9.2} {:>8.1} {psnr_known:>11.2} {psnr_found:>6.2} {loss:>6.2}",
        own.count, own.rotation, own.centres
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
    let targets = count.div_ceil(PER_TARGET);
    // In the middle of equal parts.
    let name = |target: usize| scene.views[(2 * target + 1) * count / (2 * targets)].name.clone();
    let names: Vec<String> = (0..targets).map(name).collect();
    let (width, height) = scaled_size(&scene.views[0].camera, SIDE);
    let selection = Selection { targets: Some(names.join(",")), ..Selection::default() };
    let job = selection.resolve(scene, 2)?;
    let options =
        RenderOptions { size: Some([width, height]), background: BackgroundChoice::None, ..RenderOptions::default() };
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    let mut scores = Vec::new();
    auto::render(scene, &job, &renderer, &options, &Silent, |_, frame, _| {
        scores.extend(frame.truth.map(|truth| truth.psnr));
        Ok::<(), RenderError>(())
    })?;
    Ok(scores.iter().sum::<f64>() / scores.len().max(1) as f64)
}
