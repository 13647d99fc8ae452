//! Error and time of each effort that a bound chooses from, against the exact picture.
//!
//! `cargo run --release -p viewfuse-research -- efforts FOLDER SOURCES TARGETS [MODEL]`
//!
//! SOURCES and TARGETS are lists of views as the command takes them, MODEL is a checkpoint, or the name of a training-free field or of a test network. Errors are root mean squares over the targets, times
//! the least of three rounds, sources' encodings included.

use anyhow::Context;
use std::path::Path;
use std::time::Instant;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::AnyField;
use viewfuse_field::options::FieldOptions;
use viewfuse_field::render::{RenderOptions, Stage, open_album};
use viewfuse_field::row::{Origin, Row};
use viewfuse_field::rows::{self, ROWS};
use viewfuse_job::progress::Silent;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::Selection;
use viewfuse_weighting::Weighting;

const ROUNDS: usize = 3;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [folder, sources, targets, model @ ..] = arguments else {
        anyhow::bail!("usage: efforts FOLDER SOURCES TARGETS [MODEL]");
    };
    let scene = Scene::open(Path::new(folder))?;
    let field = match model.first() {
        Some(name) => match rows::named(name).map(|row| row.origin) {
            Some(Origin::TrainingFree { open }) => open(&FieldOptions::default())?,
            _ => rows::open(checkpoint(name)?, &FieldOptions::default())?,
        },
        None => AnyField::default(),
    };
    let selection =
        Selection { targets: Some(targets.clone()), sources: Some(sources.clone()), ..Selection::default() };
    let job = selection.resolve(&scene, field.about().least_sources)?;
    let device = viewfuse_device::choice::AnyDevice::Cpu(Cpu);
    let renderer = field.on(&device);
    let options = RenderOptions { leave_out: 0.0, early_termination: 0.0, ..RenderOptions::default() };
    let weighting = Weighting::open("error:alpha=1")?;
    let shown = job.sources.iter().copied().chain(job.targets.iter().filter_map(|target| target.truth));
    let album = open_album(&scene, shown, renderer.as_ref(), &options, &Silent)?;
    let pictures = |effort: usize| -> anyhow::Result<(Vec<[f32; 4]>, f64, f64)> {
        let mut stage = Stage::prepare(&scene, &album, &job.sources, renderer.as_ref(), &options, &Silent)?;
        let start = Instant::now();
        stage.set_effort(effort, &Silent)?;
        stage.weigh(&weighting, &Silent)?;
        let (mut colours, mut psnr) = (Vec::new(), 0.0);
        for target in &job.targets {
            let frame = stage.frame(&weighting, target, &Silent)?;
            psnr += frame.truth.map_or(f64::NAN, |truth| truth.psnr);
            colours.extend(frame.colours);
        }
        Ok((colours, psnr / job.targets.len() as f64, start.elapsed().as_secs_f64()))
    };
    let stage = Stage::prepare(&scene, &album, &job.sources, renderer.as_ref(), &options, &Silent)?;
    let efforts = stage.efforts();
    let last = efforts.len().checked_sub(1).context("the field has one way to render")?;
    let least = |effort: usize| -> anyhow::Result<_> {
        let mut best = pictures(effort)?;
        for _ in 1..ROUNDS {
            let again = pictures(effort)?;
            if again.2 < best.2 {
                best = again;
            }
        }
        Ok(best)
    };
    let (exact, _, exact_seconds) = least(last)?;
    println!("| effort | error | dB | typical | to the one before | PSNR | seconds | of exact | typical |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut before: Option<Vec<[f32; 4]>> = None;
    for (index, effort) in efforts.iter().enumerate() {
        let (colours, psnr, seconds) = least(index)?;
        let error = difference(&colours, &exact);
        let step = before.as_ref().map_or(f64::NAN, |before| difference(&colours, before));
        println!(
            "| {} | {error:.5} | {:.1} | {:.5} | {step:.5} | {psnr:.2} | {seconds:.3} | {:.3} | {:.3} |",
            effort.name,
            -20.0 * error.log10(),
            effort.typical_error,
            seconds / exact_seconds,
            effort.typical_share,
        );
        before = Some(colours);
    }
    Ok(())
}

/// A file, or a test network of its published size.
fn checkpoint(name: &str) -> anyhow::Result<Checkpoint> {
    let networks = ROWS.into_iter().flat_map(Row::test_networks);
    match networks.into_iter().find(|network| network.name == name) {
        Some(network) => Ok((network.checkpoint)(None)),
        None => Ok(Checkpoint::open(Path::new(name))?),
    }
}

/// Root mean square over pixels and channels.
fn difference(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    let square = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    (a.iter().zip(b).map(square).sum::<f64>() / (3 * a.len()) as f64).sqrt()
}
