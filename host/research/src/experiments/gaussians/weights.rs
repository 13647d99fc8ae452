//! The paper's question for Gaussians: is a scene better for a target if the loss of each source is weighted by its relevance to it?
//!
//! `cargo run --release -p viewfuse-research -- gaussian_weights SIDE MAX_TARGETS ITERATIONS SCENE=PROTOCOL...`
//!
//! A scene is optimised for all views. For each target it goes on from there for `ITERATIONS` more, with the weights of a scheme, or
//! with equal ones. Differences of PSNR in decibels from the scene that went on with equal weights, at the same iterations in the same
//! order of sources; means with 95 % intervals over the targets of a scene, and over all targets. The last column has the
//! differences of the pictures half and half with the field's.

use super::{Job, Score, visit};
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_field::gaussians::{Optimiser, Recipe};
use viewfuse_job::progress::Silent;
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

/// What is compared with equal weights.
const SCHEMES: [&str; 5] = ["distance:power=1", "distance:power=2", "error:alpha=1", "gaussian:beta=1", "frobenius"];

/// Differences alone and half and half, by scheme and scene.
type Differences = BTreeMap<(usize, String), Vec<[f64; 2]>>;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [side, most_targets, iterations, jobs @ ..] = arguments else {
        bail!("usage: gaussian_weights SIDE MAX_TARGETS ITERATIONS SCENE=PROTOCOL...");
    };
    let (side, most_targets, iterations) = (side.parse()?, most_targets.parse()?, iterations.parse()?);
    let mut differences = Differences::new();
    println!("| scene | targets | before | with equal weights | half |\n|---|---|---|---|---|");
    for job in jobs {
        visit(job, side, most_targets, |job| compare(job, iterations, &mut differences))
            .with_context(|| job.clone())?;
    }
    println!("\n| scene | weights | alone | half |\n|---|---|---|---|");
    for (index, scheme) in SCHEMES.into_iter().enumerate() {
        let mut all = Vec::new();
        for ((_, scene), own) in differences.iter().filter(|((scheme, _), _)| *scheme == index) {
            println!("| {scene} | {scheme} | {} |", shown(own));
            all.extend(own);
        }
        println!("| all targets | {scheme} | {} |", shown(&all));
    }
    Ok(())
}

/// Both differences with their intervals.
fn shown(differences: &[[f64; 2]]) -> String {
    let of = |part: usize| {
        let own: Vec<f64> = differences.iter().map(|both| both[part]).collect();
        Interval::of(&own).map_or_else(String::new, |interval| format!("{interval:+.3}"))
    };
    format!("{} | {}", of(0), of(1))
}

fn compare(job: &Job<'_>, iterations: u32, differences: &mut Differences) -> anyhow::Result<()> {
    let mut base = Optimiser::new(&Cpu, job.images, job.points, Recipe::default())?
        .context("too few views agree on any surface")?;
    base.run(&Silent)?;
    let before = job.score(&base)?;
    base.extend(iterations);
    let gone_on = |weights: Option<&[f32]>| -> anyhow::Result<Optimiser<'_, Cpu>> {
        let mut own = base.clone();
        if let Some(weights) = weights {
            own.weigh(weights);
        }
        own.run(&Silent)?;
        Ok(own)
    };
    let equal = gone_on(None)?;
    let after = job.score(&equal)?;
    let count = job.targets.len();
    println!("| {} | {count} | {:.2} | {:.2} | {:.2} |", job.name, before.alone, after.alone, after.half);
    let unit = RigUnit::of_scene(job.scene);
    let poses: Vec<_> = job.sources.iter().map(|view| unit.pose(&job.scene.views[*view].camera.pose)).collect();
    let sources = SourcePoses::new(&poses)?;
    for at in 0..count {
        let single = Job { targets: &job.targets[at..=at], frames: &job.frames[at..=at], ..*job };
        let plain = single.score(&equal)?;
        let target = unit.pose(&job.scene.views[job.targets[at]].camera.pose);
        for (index, scheme) in SCHEMES.into_iter().enumerate() {
            let weights = Weighting::open(scheme)?.weigh(&sources, &target);
            let weighted = gone_on(Some(&weights.values()[..poses.len()]))?;
            let Score { alone, half } = single.score(&weighted)?;
            let own = differences.entry((index, job.name.to_owned())).or_default();
            own.push([alone - plain.alone, half - plain.half]);
        }
    }
    Ok(())
}
