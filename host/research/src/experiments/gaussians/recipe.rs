//! What matters in the recipe of Gaussians: each row changes one thing.
//!
//! `cargo run --release -p viewfuse-research -- gaussian_recipe SIDE MAX_TARGETS SCENE=PROTOCOL...`
//!
//! Columns: PSNR in decibels, means over at most `MAX_TARGETS` targets of a scene, of the Gaussians alone and of pictures half and half
//! with the field's (`distance:power=2`); CPU seconds of the optimisation, and how many Gaussians there are at the end. The first
//! row of a scene is the recipe as it is.

use super::{Job, visit};
use crate::stamp::own_cpu_seconds;
use anyhow::{Context, bail};
use viewfuse_device::cpu::Cpu;
use viewfuse_field::gaussians::{Optimiser, Recipe};
use viewfuse_job::progress::Silent;

/// A change of the recipe.
type Change = fn(&mut Recipe);

const CHANGES: [(&str, Change); 24] = [
    ("the recipe", |_| {}),
    ("start: none at random", |recipe| recipe.random_count = 0),
    ("start: 8000 at random, no points", |recipe| (recipe.random_count, recipe.least_points) = (8000, u32::MAX)),
    ("start: cubes of 3 footprints", |recipe| recipe.cell = 3.0),
    ("start: cubes of 12", |recipe| recipe.cell = 12.0),
    ("start: opacity 0.1", |recipe| recipe.opacities = [0.1; 2]),
    ("start: opacity 0.8", |recipe| recipe.opacities[0] = 0.8),
    ("number: 0.4 a pixel", |recipe| recipe.max_per_pixel = 0.4),
    ("number: 0.75", |recipe| recipe.max_per_pixel = 0.75),
    ("pyramid: none, 120 iterations", |recipe| recipe.iterations = [0, 0, 0, 120]),
    ("pyramid: from an eighth", |recipe| recipe.iterations = [60, 60, 60, 60]),
    ("stop: half of the iterations", |recipe| recipe.iterations = [0, 50, 40, 30]),
    ("stop: twice", |recipe| recipe.iterations = [0, 200, 160, 120]),
    ("balls", |recipe| recipe.flatness = 1.0),
    ("balls, none at random", |recipe| (recipe.flatness, recipe.random_count) = (1.0, 0)),
    ("flat: a tenth", |recipe| recipe.flatness = 0.1),
    ("loss: no SSIM", |recipe| recipe.structure_share = 0.0),
    ("loss: half SSIM", |recipe| recipe.structure_share = 0.5),
    ("penalty on opacity: none", |recipe| recipe.opacity_penalty = 0.0),
    ("penalty on opacity: five times", |recipe| recipe.opacity_penalty *= 5.0),
    ("gains: none", |recipe| recipe.rates[5] = 0.0),
    ("no pruning", |recipe| recipe.prune_opacity = 0.0),
    ("no splitting", |recipe| recipe.split_scale = f32::INFINITY),
    ("silhouettes do not count", |recipe| recipe.silhouette_share = 0.0),
];

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [side, most_targets, jobs @ ..] = arguments else {
        bail!("usage: gaussian_recipe SIDE MAX_TARGETS SCENE=PROTOCOL...");
    };
    let (side, most_targets) = (side.parse()?, most_targets.parse()?);
    println!("| scene | change | Gaussians | half | CPU s | number |\n|---|---|---|---|---|---|");
    for job in jobs {
        visit(job, side, most_targets, rows).with_context(|| job.clone())?;
    }
    Ok(())
}

/// The rows of a scene.
fn rows(job: &Job<'_>) -> anyhow::Result<()> {
    let [width, height] = job.options.size.unwrap_or_default();
    let name = job.name;
    println!("| {name}, {width}x{height} | the field | | {:.2} | | |", job.field_score());
    for (words, change) in CHANGES {
        if words.starts_with("silhouettes") && !job.images.has_silhouettes {
            continue;
        }
        let mut recipe = Recipe::default();
        change(&mut recipe);
        row(job, words, job.points, recipe)?;
    }
    if job.images.has_silhouettes {
        row(job, "as mixed with the field's pictures", job.points, Recipe::default().mixed_with(job.images))?;
    }
    row(job, "start: points of one view", job.all_points, Recipe::default())
}

fn row(
    job: &Job<'_>,
    words: &str,
    points: &[viewfuse_field::point_cloud::CloudPoint],
    recipe: Recipe,
) -> anyhow::Result<()> {
    let name = job.name;
    let before = own_cpu_seconds();
    let Some(mut optimiser) = Optimiser::new(&Cpu, job.images, points, recipe)? else {
        println!("| {name} | {words} | too few points | | | |");
        return Ok(());
    };
    optimiser.run(&Silent)?;
    let (seconds, count) = (own_cpu_seconds() - before, optimiser.optimised().gaussians.len());
    let score = job.score(&optimiser)?;
    println!("| {name} | {words} | {:.2} | {:.2} | {seconds:.1} | {count} |", score.alone, score.half);
    Ok(())
}
