//! Run time of the plane sweep over planes, pixels and sources, and its look-ups beside those that the machine can do.
//!
//! `cargo run --release -p viewfuse-research -- sweep_time FOLDER`
//!
//! A row is the best of several rounds: encoding the sources and rendering one target, from photographs in memory. Planes,
//! pixels or sources are doubled against the row above; the look-ups are those of comparing the views: planes times pixels
//! times views, for each frustum. The limit is the same number of bilinear look-ups alone, from one photograph, along rays
//! as a sweep makes them, on as many threads.

use anyhow::Context;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};
use viewfuse_core::lookup::bilinear_from;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::On;
use viewfuse_field::render::{RenderOptions, Stage};
use viewfuse_field::training_free::{Sweep, TrainingFree};
use viewfuse_job::progress::Silent;
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Target, target_of};
use viewfuse_scene::photographs::{Album, BackgroundChoice, scaled_size};
use viewfuse_weighting::Weighting;

const ROUNDS: usize = 5;
/// Other sources that a source is compared with, and itself.
const VIEWS_OF_A_SOURCE: usize = 3;
/// Most views that a target's frustum is compared with.
const MAX_MATCHED: usize = 8;

/// Planes, longest side, sources.
#[derive(Clone, Copy)]
struct Work(u32, u32, usize);

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let folder = arguments.first().context("usage: sweep_time FOLDER")?;
    let scene = Scene::open(Path::new(folder))?;
    let base = Work(32, 128, 3);
    let rows = [
        ("base", base),
        ("planes x 2", Work(64, 128, 3)),
        ("planes x 4", Work(128, 128, 3)),
        ("pixels x 2", Work(32, 181, 3)),
        ("pixels x 4", Work(32, 256, 3)),
        ("sources x 2", Work(32, 128, 6)),
        ("sources x 3", Work(32, 128, 9)),
        ("default", Work(64, 256, 3)),
    ];
    println!("| | planes | pixels | sources | look-ups, millions | time, ms | of base | share of the limit |");
    println!("|---|---|---|---|---|---|---|---|");
    let mut first = None;
    for (name, work) in rows {
        let (time, pixels) = measured(&scene, work)?;
        let Work(planes, side, sources) = work;
        let views = sources * sources.min(VIEWS_OF_A_SOURCE) + sources.min(MAX_MATCHED);
        let lookups = planes as usize * pixels as usize * views;
        let limit = limit(lookups, side);
        let base = *first.get_or_insert(time);
        println!(
            "| {name} | {planes} | {pixels} | {sources} | {:.1} | {:.0} | {:.2} | {:.0} % |",
            lookups as f64 / 1.0e6,
            1.0e3 * time.as_secs_f64(),
            time.as_secs_f64() / base.as_secs_f64(),
            100.0 * limit.as_secs_f64() / time.as_secs_f64()
        );
    }
    Ok(())
}

/// The least time of the rounds, and the pixels of the target.
fn measured(scene: &Scene, Work(plane_count, side, source_count): Work) -> anyhow::Result<(Duration, u32)> {
    // The middle view from its neighbours.
    let target = scene.views.len() / 2;
    let mut sources: Vec<usize> = (0..scene.views.len()).filter(|view| *view != target).collect();
    sources.sort_by_key(|view| view.abs_diff(target));
    sources.truncate(source_count);
    let (width, height) = scaled_size(&scene.views[target].camera, side);
    let options = RenderOptions {
        size: Some([width, height]),
        background: BackgroundChoice::None,
        leave_out: 0.0,
        ..RenderOptions::default()
    };
    let sweep = Sweep { plane_count, match_side: side, ..Sweep::default() };
    let field = TrainingFree { sweep, ..TrainingFree::default() };
    let renderer = On { device: &Cpu, field: &field };
    let album = Album::open(scene, sources.iter().copied(), &Silent)?;
    let mut stage = Stage::prepare(scene, &album, &sources, &renderer, &options, &Silent)?;
    let target = Target { truth: None, ..target_of(scene, target) };
    let mut least = Duration::MAX;
    for _ in 0..ROUNDS {
        stage.weigh(&Weighting::open("mean")?, &Silent)?;
        let frame = stage.frame(&Weighting::open("mean")?, &target, &Silent)?;
        least = least.min(frame.time);
        black_box(&frame.colours);
    }
    Ok((least, width * height))
}

/// The least time of so many bilinear look-ups alone, in a picture of this side.
fn limit(lookups: usize, side: u32) -> Duration {
    let texels = vec![[0.5_f32, 0.25, 0.125, 1.0]; (side * side) as usize];
    let thread_count = std::thread::available_parallelism().map_or(1, usize::from);
    let runs = lookups / PLANES / thread_count;
    let part = &|first: usize| {
        let mut sum = 0.0;
        for run in first..first + runs {
            // Along a ray: a fraction of a pixel from one plane to the next.
            let (x, y) = ((run % side as usize) as f32, (run / side as usize % side as usize) as f32);
            for plane in 0..PLANES {
                let texel = bilinear_from(&texels[..], 0, side, side, x + 0.3 * plane as f32, y);
                sum += texel[0] + texel[1] + texel[2] + texel[3];
            }
        }
        black_box(sum);
    };
    let once = || {
        let start = Instant::now();
        std::thread::scope(|scope| (0..thread_count).for_each(|thread| drop(scope.spawn(move || part(thread * runs)))));
        start.elapsed()
    };
    (0..ROUNDS).map(|_| once()).min().unwrap_or_default()
}
