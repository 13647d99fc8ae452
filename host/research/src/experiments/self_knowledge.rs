//! How well `auto` knows itself: its choice beside the best fixed one in hindsight, and the scores that it expects beside the
//! true ones.
//!
//! `cargo run --release -p viewfuse-research -- self_knowledge SIDE MAX_TARGETS grid|chosen FOLDER=PROTOCOL...`
//!
//! Pictures have a longest side of `SIDE`. Of each protocol at most `MAX_TARGETS` jobs (sets of sources) are rendered, with as
//! many targets each. With `grid`, all that `auto` tried is rendered at the targets as well, which is what takes the time. Each
//! line of output is a JSON object, one a job. The last lines are the summary: how well the built-in constants of the
//! expected score do, and constants that are fitted to these targets, with their errors when each scene in turn is left out of
//! the fit.

mod fit;

use anyhow::{Context, bail};
use fit::{Row, fit};
use serde_json::json;
use std::path::Path;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::protocol::{Draws, Protocol};
use viewfuse_evaluate::without_masks;
use viewfuse_field::On;
use viewfuse_field::auto::{Chosen, choose};
use viewfuse_field::render::{RenderOptions, Stage};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_job::progress::Silent;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::target_of;
use viewfuse_scene::photographs::{Album, BackgroundChoice, scaled_size};
use viewfuse_weighting::Weighting;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [side, most_targets, mode, jobs @ ..] = arguments else {
        bail!("usage: self_knowledge SIDE MAX_TARGETS grid|chosen FOLDER=PROTOCOL...");
    };
    let (side, most_targets): (u32, usize) = (side.parse()?, most_targets.parse()?);
    let mut summary = Summary::default();
    for job in jobs {
        let (folder, protocol) = job.split_once('=').context("a job is FOLDER=PROTOCOL")?;
        let protocol = protocol.parse()?;
        if let Err(error) = measure(Path::new(folder), &protocol, side, most_targets, mode == "grid", &mut summary) {
            eprintln!("{job}: {error}");
        }
    }
    summary.print();
    Ok(())
}

/// What all jobs say together.
#[derive(Default)]
struct Summary {
    /// Expected and true score of each target, and whether the true one is in the interval.
    targets: Vec<(f64, f64, bool)>,
    /// The same targets for the fit.
    rows: Vec<Row>,
    /// Mean score of a job: as chosen, of the best candidate in hindsight, of the first one.
    jobs: Vec<[f64; 3]>,
}

impl Summary {
    fn print(&self) {
        let (count, jobs) = (self.targets.len() as f64, self.jobs.len() as f64);
        let mean = |value: &dyn Fn(&(f64, f64, bool)) -> f64| self.targets.iter().map(value).sum::<f64>() / count;
        let (expected, truth) = (mean(&|target| target.0), mean(&|target| target.1));
        let product = mean(&|target| (target.0 - expected) * (target.1 - truth));
        let spreads = mean(&|target| (target.0 - expected).powi(2)) * mean(&|target| (target.1 - truth).powi(2));
        let near = mean(&|target| f64::from((target.0 - target.1).abs() < 1.5));
        let inside = mean(&|target| f64::from(target.2));
        println!(
            "{count} targets: correlation {:.2}, within 1.5 dB {near:.2}, within the interval {inside:.2}",
            product / spreads.sqrt()
        );
        let (constants, errors) = fit(&self.rows);
        let deviation = (errors.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
        let near = errors.iter().filter(|error| error.abs() < 1.5).count() as f64 / count;
        println!("fitted {constants:.3?}; scenes left out: deviation {deviation:.2} dB, within 1.5 dB {near:.2}");
        if !self.jobs.is_empty() {
            let [chosen, best, first] =
                [0, 1, 2].map(|column| self.jobs.iter().map(|job| job[column]).sum::<f64>() / jobs);
            println!("{jobs} jobs: chosen {chosen:.2} dB, best in hindsight {best:.2}, first scheme {first:.2}");
        }
    }
}

fn measure(
    folder: &Path,
    protocol: &Protocol,
    side: u32,
    most_targets: usize,
    grid: bool,
    summary: &mut Summary,
) -> anyhow::Result<()> {
    let mut scene = Scene::open(folder)?;
    let mut options = RenderOptions::default();
    if protocol.hides_masks() {
        scene = without_masks(&scene);
        options.background = BackgroundChoice::None;
    }
    let size = scaled_size(&scene.views[0].camera, side);
    options.size = Some(size.into());
    let scenes = [scene];
    let plan = protocol.plan(&scenes, Draws { seed: 0, trial_count: 1, target_count: most_targets }, 3)?;
    let scene = &scenes[0];
    let every = plan.jobs.len().div_ceil(most_targets).max(1);
    for job in plan.jobs.iter().step_by(every) {
        let step = job.targets.len().div_ceil(most_targets).max(1);
        let targets: Vec<usize> = job.targets.iter().copied().step_by(step).collect();
        let album = Album::open(scene, job.sources.iter().chain(&targets).copied(), &Silent)?;
        let field = TrainingFree::default();
        let renderer = On { device: &Cpu, field: &field };
        let mut stage = Stage::prepare(scene, &album, &job.sources, &renderer, &options, &Silent)?;
        let start = std::time::Instant::now();
        let chosen = choose(&stage, &renderer, &options, &Silent)?;
        let seconds = start.elapsed().as_secs_f64();
        let mut true_scores = Vec::new();
        if grid {
            for candidate in &chosen.candidates {
                stage.tune(&candidate.settings, None);
                let weighting = Weighting::open(&candidate.weighting)?;
                stage.weigh(&weighting, &Silent)?;
                let mut scores = Vec::new();
                for &target in &targets {
                    let frame = stage.frame(&weighting, &target_of(scene, target), &Silent)?;
                    scores.push(frame.truth.map_or(f64::NAN, |truth| truth.psnr));
                }
                true_scores.push(scores);
            }
        }
        let start = std::time::Instant::now();
        let views = rendered(&mut stage, scene, &chosen, &targets, summary)?;
        if grid {
            let means: Vec<f64> =
                true_scores.iter().map(|scores| scores.iter().sum::<f64>() / scores.len() as f64).collect();
            let own: f64 = summary.targets[summary.targets.len() - views.len()..].iter().map(|target| target.1).sum();
            let best = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            summary.jobs.extend(means.first().map(|first| [own / views.len() as f64, best, *first]));
        }
        let render_seconds = start.elapsed().as_secs_f64();
        let line = json!({
            "scene": folder, "protocol": protocol.to_string(), "sources": job.sources.len(),
            "weighting": chosen.weighting.to_string(), "settings": chosen.settings, "candidates": chosen.candidates,
            "left_out": chosen.left_out, "detail": chosen.basis.map(|basis| basis.detail), "views": views,
            "true_scores": true_scores, "seconds": seconds, "render_seconds": render_seconds,
        });
        println!("{line}");
    }
    Ok(())
}

/// The targets with what was chosen.
fn rendered(
    stage: &mut Stage<'_>,
    scene: &Scene,
    chosen: &Chosen,
    targets: &[usize],
    summary: &mut Summary,
) -> anyhow::Result<Vec<serde_json::Value>> {
    stage.tune(&chosen.settings, chosen.mixture.as_ref());
    stage.weigh(&chosen.weighting, &Silent)?;
    let mut views = Vec::new();
    for &target in targets {
        let frame = stage.frame(&chosen.weighting, &target_of(scene, target), &Silent)?;
        let confidence = frame.confidences.iter().sum::<f32>() / frame.confidences.len().max(1) as f32;
        let (Some(expected), Some(truth)) = (chosen.expected(&frame), &frame.truth) else { continue };
        let is_inside = (expected.interval[0]..=expected.interval[1]).contains(&truth.psnr);
        summary.targets.push((expected.psnr, truth.psnr, is_inside));
        if let Some(basis) = &chosen.basis {
            let terms = basis.terms(chosen.standing(&frame), chosen.calibrated(&frame), frame.seen);
            summary.rows.push(Row { scene: scene.path.display().to_string(), terms, above: truth.psnr - basis.psnr });
        }
        let calibrated = chosen.calibrated(&frame);
        let terms = chosen.basis.map(|basis| basis.terms(chosen.standing(&frame), calibrated, frame.seen));
        views.push(json!({
            "terms": terms, "target": frame.target.name, "standing": chosen.standing(&frame), "confidence": confidence,
            "expected": expected, "psnr": truth.psnr, "seen_by": frame.seen,
        }));
    }
    Ok(views)
}
