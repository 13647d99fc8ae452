//! What a mixture of two fields' pictures gains: the training-free field is sharp, a small network knows the kind of object.
//!
//! `cargo run --release -p viewfuse-research -- mixture MODEL PROTOCOL SIDE SCENE...`
//!
//! The scenes of one folder of `scenes make`, each with four drawn targets (the draws of `evaluate`, seed 0). A row is the mean of both
//! pictures by a share of the training-free one (`error:alpha=1`; the network has equal weights); PSNR with a 95 % interval over
//! scenes, and the sharpness: the mean magnitude of the differences of neighbouring pixels over the photograph's. In the last row
//! each window of 8x8 pixels is that of the two which is nearer to the photograph, a bound from above.

use anyhow::bail;
use image::RgbImage;
use std::path::Path;
use viewfuse_device::choice::AnyDevice;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_evaluate::protocol::{Draws, Job, Protocol};
use viewfuse_field::options::FieldOptions;
use viewfuse_field::render::{Frame, RenderOptions, Stage, open_album};
use viewfuse_field::{AnyField, rows};
use viewfuse_job::progress::Silent;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::target_of;
use viewfuse_weighting::Weighting;

const SHARES: [f64; 7] = [0.0, 0.25, 0.5, 0.6, 0.7, 0.8, 1.0];
const TARGETS: usize = 4;
const WINDOW: u32 = 8;

/// A picture's score.
#[derive(Clone, Copy)]
struct Score {
    psnr: f64,
    sharpness: f64,
}

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [model, protocol, side, folders @ ..] = arguments else {
        bail!("usage: mixture MODEL PROTOCOL SIDE SCENE...");
    };
    let (protocol, side): (Protocol, u32) = (protocol.parse()?, side.parse()?);
    let scenes = folders.iter().map(|folder| Scene::open(Path::new(folder))).collect::<Result<Vec<_>, _>>()?;
    let network = rows::open(Checkpoint::open(Path::new(model))?, &FieldOptions::default())?;
    let plan = protocol.plan(&scenes, Draws { seed: 0, trial_count: 1, target_count: TARGETS }, 2)?;
    // `[share, then the choice by windows][job]`: means over the targets.
    let mut rows = vec![Vec::new(); SHARES.len() + 1];
    for job in &plan.jobs {
        let scene = &scenes[job.scene];
        let sharp = frames(scene, job, &AnyField::default(), "error:alpha=1", side)?;
        let learned = frames(scene, job, &network, "mean", side)?;
        let mut scores = vec![Vec::new(); rows.len()];
        for (sharp, learned) in sharp.iter().zip(&learned) {
            let Some(truth) = &sharp.truth else { continue };
            let (a, b, truth) = (values(&sharp.picture), values(&learned.picture), values(&truth.picture));
            let pictures = SHARES.map(|share| a.iter().zip(&b).map(|(a, b)| share * a + (1.0 - share) * b).collect());
            let all = pictures.into_iter().chain([nearer(&a, &b, &truth, side)]);
            for (scores, picture) in scores.iter_mut().zip(all) {
                scores.push(score(&picture, &truth, side));
            }
        }
        for (row, scores) in rows.iter_mut().zip(scores) {
            let mean = |of: fn(&Score) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
            row.push(Score { psnr: mean(|score| score.psnr), sharpness: mean(|score| score.sharpness) });
        }
    }
    println!("| share of the training-free picture | PSNR dB | above the network's | sharpness |\n|---|---|---|---|");
    let names = SHARES.iter().map(f64::to_string).chain(["the nearer one of each window".to_owned()]);
    for (name, row) in names.zip(&rows) {
        let interval =
            |values: Vec<f64>| Interval::of(&values).map_or(String::new(), |interval| format!("{interval:.2}"));
        let sharpness = row.iter().map(|score| score.sharpness).sum::<f64>() / row.len() as f64;
        println!(
            "| {name} | {} | {} | {sharpness:.3} |",
            interval(row.iter().map(|score| score.psnr).collect()),
            interval(row.iter().zip(&rows[0]).map(|(score, network)| score.psnr - network.psnr).collect()),
        );
    }
    Ok(())
}

/// The frames of a job with a field.
fn frames(scene: &Scene, job: &Job, field: &AnyField, scheme: &str, side: u32) -> anyhow::Result<Vec<Frame>> {
    let device = AnyDevice::Cpu(Cpu);
    let renderer = field.on(&device);
    let options = RenderOptions { size: Some([side; 2]), ..RenderOptions::default() };
    let weighting = Weighting::open(scheme)?;
    let shown = job.sources.iter().chain(&job.targets).copied();
    let album = open_album(scene, shown, renderer.as_ref(), &options, &Silent)?;
    let mut stage = Stage::prepare(scene, &album, &job.sources, renderer.as_ref(), &options, &Silent)?;
    stage.weigh(&weighting, &Silent)?;
    let frame = |view: &usize| {
        let target = target_of(scene, *view);
        Ok(stage.frame(&weighting, &target, &Silent)?)
    };
    job.targets.iter().map(frame).collect()
}

/// From 0 to 1, `[row][column][channel]`.
fn values(picture: &RgbImage) -> Vec<f64> {
    picture.as_raw().iter().map(|value| f64::from(*value) / 255.0).collect()
}

fn score(picture: &[f64], truth: &[f64], side: u32) -> Score {
    let square: f64 = picture.iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum();
    let psnr = -10.0 * (square / picture.len() as f64).log10();
    Score { psnr, sharpness: contrast(picture, side) / contrast(truth, side) }
}

/// The sum of the magnitudes of the differences of neighbours.
fn contrast(picture: &[f64], side: u32) -> f64 {
    let row = 3 * side as usize;
    let down: f64 = picture.iter().zip(&picture[row..]).map(|(a, b)| (a - b).abs()).sum();
    let along = |row: &[f64]| row.iter().zip(&row[3..]).map(|(a, b)| (a - b).abs()).sum::<f64>();
    down + picture.chunks_exact(row).map(along).sum::<f64>()
}

/// Each window of the one that is nearer to the truth.
fn nearer(a: &[f64], b: &[f64], truth: &[f64], side: u32) -> Vec<f64> {
    let window = |index: usize| {
        let (column, row) = (index as u32 / 3 % side, index as u32 / 3 / side);
        (row / WINDOW * side.div_ceil(WINDOW) + column / WINDOW) as usize
    };
    let mut excess = vec![0.0; side.div_ceil(WINDOW).pow(2) as usize];
    for (index, truth) in truth.iter().enumerate() {
        excess[window(index)] += (a[index] - truth).powi(2) - (b[index] - truth).powi(2);
    }
    (0..a.len()).map(|index| if excess[window(index)] < 0.0 { a[index] } else { b[index] }).collect()
}
