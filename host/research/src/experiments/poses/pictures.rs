//! What pictures lose by poses that were found.
//!
//! `cargo run --release -p viewfuse-research -- posed_pictures FILE SOLVER SCENE...`
//!
//! As `poses`, on other sets. Of the accepted photographs two or three are left out and rendered from the other accepted ones with
//! the weighting `auto` at 208 pixels, over the whole photographs: once at the scene's own poses, once at those that were found.
//! Both have the same photographs and the points that were found with the poses, moved to the scene's own poses by the similarity
//! of the cameras, and no bounds of depth beside them: a person who has poses has their points, but the files of some scenes state
//! bounds in place of points, or nothing.
//!
//! ```text
//! accepted   photographs with an accepted pose, of those in the set
//! rotation   median over pairs of the angle between relative rotations found and known, degrees
//! centres    root mean square distance of the camera centres, aligned, in percent of their spread
//! PSNR       mean over the pictures at the known poses, at those found, and the difference, decibels
//! pictures   photographs that were left out
//! ```

use super::rows::{Rows, numbers};
use super::sets::{PICTURE_SETS, Set, neighbours};
use super::truth::{errors, similarity};
use super::{found_or_few, head, solver_of, view_of};
use anyhow::{Context, bail};
use viewfuse_device::cpu::Cpu;
use viewfuse_field::On;
use viewfuse_field::auto;
use viewfuse_field::render::{RenderError, RenderOptions};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_job::progress::Silent;
use viewfuse_pose::{Found, Options, Solver, Verdict};
use viewfuse_scene::few_shot::Selection;
use viewfuse_scene::photographs::{BackgroundChoice, scaled_size};
use viewfuse_scene::{Scene, ScenePoint};

/// Longest side of the pictures.
const SIDE: u32 = 208;

/// Of at most so many photographs the ones that are left out are so one at a time: the others are few.
const FEW: usize = 5;

const TITLE: &str =
    "scene              photographs  seed  focal  accepted  rotation  centres  PSNR known  found   loss  pictures";

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [file, solver, scenes @ ..] = arguments else { bail!("usage: posed_pictures FILE SOLVER SCENE...") };
    let solver = solver_of(solver);
    let mut rows = Rows::open(file, TITLE)?;
    for folder in scenes {
        let scene = Scene::open(folder)?;
        for set in PICTURE_SETS.iter().filter(|set| set.count <= scene.views.len()) {
            rows.row(&head(&scene.name(), set), || {
                one(&scene, set, solver.as_ref()).with_context(|| format!("{folder}: {set:?}"))
            })?;
        }
    }
    // The loss stands before the last column.
    let loss = |row: &String| numbers(row).iter().rev().nth(1).copied();
    let mut losses: Vec<f64> = rows.all().iter().filter(|row| !row.ends_with("refused")).filter_map(loss).collect();
    losses.sort_by(f64::total_cmp);
    let at = |place: usize| losses.get(place).copied().unwrap_or_default();
    let (median, greatest) = (at(losses.len() / 2), at(losses.len().saturating_sub(1)));
    rows.finish(&format!("{} accepted sets: loss {median:.2} dB in the median, at most {greatest:.2} dB", losses.len()))
}

/// The rest of a set's row.
fn one(scene: &Scene, set: &Set, solver: &dyn Solver) -> anyhow::Result<String> {
    let views = neighbours(scene, set);
    let Some((found, _copies)) = found_or_few(scene, set, &views, solver, Options::default().refine)? else {
        return Ok("refused".to_owned());
    };
    let Ok(verdict) = &found.verdict else { return Ok("refused".to_owned()) };
    let own = errors(scene, &verdict.solution, &verdict.photos, |photo| view_of(&found, &views, photo));
    let known = known_scene(scene, &found, verdict, &views);
    let [(psnr_known, count), (psnr_found, _)] = [pictures(&known)?, pictures(&verdict.scene)?];
    Ok(format!(
        "{:>8} {:>9.2} {:>8.1} {psnr_known:>11.2} {psnr_found:>6.2} {:>6.2} {count:>9}",
        own.count,
        own.rotation,
        own.centres,
        psnr_known - psnr_found
    ))
}

/// The accepted scene with its photographs, without masks and bounds of depth, at their known poses.
fn known_scene(scene: &Scene, found: &Found, verdict: &Verdict, views: &[usize]) -> Scene {
    let taken: Vec<usize> = verdict.photos.iter().map(|photo| view_of(found, views, *photo)).collect();
    let own = |(view, found): (&usize, &viewfuse_scene::View)| viewfuse_scene::View {
        name: found.name.clone(),
        image: found.image.clone(),
        mask: None,
        near_far: None,
        ..scene.views[*view].clone()
    };
    let mut known =
        Scene { views: taken.iter().zip(&verdict.scene.views).map(own).collect(), points: Vec::new(), ..scene.clone() };
    let poses = |scene: &Scene| scene.views.iter().map(|view| view.camera.pose).collect::<Vec<_>>();
    let moved = similarity(&poses(&verdict.scene), &poses(&known));
    let point = |point: &ScenePoint| ScenePoint { position_world: moved(point.position_world), ..point.clone() };
    known.points = verdict.scene.points.iter().map(point).collect();
    known
}

/// Mean PSNR of photographs that are left out, and how many these are.
fn pictures(scene: &Scene) -> anyhow::Result<(f64, usize)> {
    let count = scene.views.len();
    let targets = if count == 4 || count == FEW { 2 } else { 3 };
    // In the middle of equal parts.
    let names: Vec<String> =
        (0..targets).map(|target| scene.views[(2 * target + 1) * count / (2 * targets)].name.clone()).collect();
    let at_once = if count <= FEW { 1 } else { targets };
    let mut scores = Vec::new();
    for names in names.chunks(at_once) {
        scores.extend(scores_of(scene, names)?);
    }
    Ok((scores.iter().sum::<f64>() / scores.len().max(1) as f64, scores.len()))
}

/// The PSNR of each of these photographs, rendered from all others.
fn scores_of(scene: &Scene, names: &[String]) -> anyhow::Result<Vec<f64>> {
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
    Ok(scores)
}
