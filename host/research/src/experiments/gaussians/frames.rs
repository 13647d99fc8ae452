//! Time of a picture of Gaussians by its stages, beside its arithmetic alone.
//!
//! `cargo run --release -p viewfuse-research -- gaussian_frames SCENE FILE ROUNDS WIDTHxHEIGHT...`
//!
//! Of each stage the CPU time of a round, over all threads, and behind it the least wall time of a round: the projection of all
//! Gaussians, the lists of tiles (on one thread), the blending, and a whole frame of the render loop. `rows of splats` are those parts
//! of a tile's row of eight pixels that blending looks at; those that it composites are `composited`. The limit is the CPU time of
//! blending as many with splats that stay in the processor's cache and none that a row skips; bytes are those that the stages read
//! and write once.

use crate::stamp::own_cpu_seconds;
use anyhow::{Context, bail};
use std::fmt;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::choice::AnyDevice;
use viewfuse_device::cpu::Cpu;
use viewfuse_device::{Device, Memory};
use viewfuse_field::AnyField;
use viewfuse_field::gaussians::{GivenGaussians, Tiles};
use viewfuse_field::render::{RenderOptions, Stage};
use viewfuse_job::progress::Silent;
use viewfuse_kernels::gaussians::blend::BlendedLanes;
use viewfuse_kernels::gaussians::{MIN_TRANSMITTANCE, SPLAT_TILE, SplatBlock, TileBlock};
use viewfuse_kernels::rows::{GaussianBlock, ProjectedGaussian};
use viewfuse_scene::Scene;
use viewfuse_scene::gaussians::GaussianScene;
use viewfuse_scene::photographs::Album;
use viewfuse_weighting::Weighting;

/// Most sources that are read.
const MAX_SOURCES: usize = 9;
/// Splats of the limit: they stay in the first cache.
const CACHED: usize = 64;

/// Time of a round.
#[derive(Clone, Copy)]
struct Time {
    /// Over all threads, milliseconds: the mean.
    cpu: f64,
    /// Wall time, milliseconds: the least.
    least: f64,
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2}, {:.2}", self.cpu, self.least)
    }
}

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [folder, file, rounds, sizes @ ..] = arguments else {
        bail!("usage: gaussian_frames SCENE FILE ROUNDS WIDTHxHEIGHT...");
    };
    let rounds = rounds.parse()?;
    let scene = Scene::open(Path::new(folder))?;
    let given = GaussianScene::read(Path::new(file), &scene.frame)?;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "{} Gaussians of {}, {threads} threads, {rounds} rounds; CPU ms, least wall ms\n",
        given.gaussians.len(),
        scene.name()
    );
    println!("| size | projecting | lists | blending | whole frame |\n|---|---|---|---|---|");
    let mut counts = Vec::new();
    for size in sizes {
        let (width, height) = size.split_once('x').context("a size is WIDTHxHEIGHT")?;
        let size = [width.parse()?, height.parse()?];
        counts.push(row(&scene, &given, size, rounds)?);
    }
    println!(
        "\n| size | drawn | entries of tiles | rows of splats | composited | MB | limit of blending, CPU ms | share |"
    );
    println!("|---|---|---|---|---|---|---|---|\n{}", counts.join("\n"));
    Ok(())
}

/// Prints the times, and returns what is counted.
fn row(scene: &Scene, given: &GaussianScene, [width, height]: [u32; 2], rounds: usize) -> anyhow::Result<String> {
    let own = scene.views[0].camera;
    let camera = Camera { pinhole: own.pinhole.resized(width, height)?, ..own };
    let block = camera.block(0);
    let blocks = given.blocks(camera.pose.centre_world());
    let whole = whole(scene, given, &camera, rounds)?;
    let splat_block =
        SplatBlock { camera: block, near: near(&blocks, &block), gaussian_count: blocks.len() as u32, padding: [0; 2] };
    let tiles = TileBlock::new(width, height, [0.5; 3]);
    let gaussians = Cpu.upload(&blocks)?;
    let mut splats = Cpu.zeros::<ProjectedGaussian>(blocks.len())?;
    let projecting = timed(rounds, || Ok(Cpu.project_gaussians(&splat_block, &gaussians, &mut splats)?))?;
    let projected = Cpu.download(&splats)?;
    let mut lists = Tiles::default();
    let listing = timed(rounds, || {
        lists = Tiles::of(&tiles, &projected);
        Ok(())
    })?;
    let (starts, entries) = (Cpu.upload(&lists.starts)?, Cpu.upload(&lists.entries)?);
    let pixels = (width * height) as usize;
    let (mut colours, mut depths) = (Cpu.zeros(pixels)?, Cpu.zeros(pixels)?);
    let blending =
        timed(rounds, || Ok(Cpu.blend_splats(&tiles, &starts, &entries, &splats, &mut colours, &mut depths)?))?;
    println!("| {width}x{height} | {projecting} | {listing} | {blending} | {whole} |");
    let drawn = projected.iter().filter(|splat| splat.opacity > 0.0).count();
    let (rows, composited) = counted(&tiles, &lists, &projected);
    let limit = limit(&tiles, composited, rounds)?;
    let bytes = size_of::<GaussianBlock>() * blocks.len()
        + 2 * size_of::<ProjectedGaussian>() * blocks.len()
        + lists.entries.len() * 4
        + lists.entries.len() * size_of::<ProjectedGaussian>()
        + 20 * pixels;
    Ok(format!(
        "| {width}x{height} | {drawn} | {} | {rows} | {composited} | {:.1} | {:.2} | {:.0} % |",
        lists.entries.len(),
        bytes as f64 / 1.0e6,
        limit.cpu,
        100.0 * limit.cpu / blending.cpu
    ))
}

/// A tenth of the median depth, as the field has it.
fn near(blocks: &[GaussianBlock], camera: &CameraBlock) -> f32 {
    let seen = blocks.iter().map(|own| camera.project(own.position.into()));
    let mut depths: Vec<f32> = seen.filter(|seen| seen.in_image).map(|seen| seen.depth).collect();
    depths.sort_by(f32::total_cmp);
    0.1 * depths.get(depths.len() / 2).copied().unwrap_or(1.0)
}

/// A frame of the render loop, as the viewer and `render` make it.
fn whole(scene: &Scene, given: &GaussianScene, camera: &Camera, rounds: usize) -> anyhow::Result<Time> {
    let (device, field) = (AnyDevice::Cpu(Cpu), AnyField::new(GivenGaussians { scene: given.clone() }));
    let renderer = field.on(&device);
    let size = [camera.pinhole.width(), camera.pinhole.height()];
    let options = RenderOptions { size: Some(size), ..RenderOptions::default() };
    let sources: Vec<usize> = (0..scene.views.len().min(MAX_SOURCES)).collect();
    let album = Album::open(scene, sources.iter().copied(), &Silent)?;
    let mut stage = Stage::prepare(scene, &album, &sources, renderer.as_ref(), &options, &Silent)?;
    let weighting = Weighting::default_scheme();
    timed(rounds, || {
        black_box(stage.frame_of_size(&weighting, camera, size, &Silent)?);
        Ok(())
    })
}

/// The time of a round of some.
fn timed(rounds: usize, mut work: impl FnMut() -> anyhow::Result<()>) -> anyhow::Result<Time> {
    let (mut least, before) = (f64::INFINITY, own_cpu_seconds());
    for _ in 0..rounds {
        let start = Instant::now();
        work()?;
        least = least.min(1.0e3 * start.elapsed().as_secs_f64());
    }
    Ok(Time { cpu: 1.0e3 * (own_cpu_seconds() - before) / rounds as f64, least })
}

/// How many splats the rows of tiles look at, and how many they composite: until no pixel of a row needs more.
fn counted(tiles: &TileBlock, lists: &Tiles, splats: &[ProjectedGaussian]) -> (u64, u64) {
    let (mut rows, mut composited) = (0, 0);
    for part in 0..tiles.part_count() {
        let (row, column) = (part / tiles.tile_columns, part % tiles.tile_columns);
        let at = [column * SPLAT_TILE as u32, row];
        let tile = tiles.tile_of(at[0], at[1]) as usize;
        let (start, end) = (lists.starts[tile] as usize, lists.starts[tile + 1] as usize);
        let y = row as f32 + 0.5;
        let reaches = |entry: &&u32| (y - splats[**entry as usize].mean[1]).abs() <= splats[**entry as usize].extent[1];
        let needed = needed(tiles, lists, splats, part, end - start);
        rows += needed as u64;
        composited += lists.entries[start..start + needed].iter().filter(reaches).count() as u64;
    }
    (rows, composited)
}

/// The number of a row's entries after which less than [`MIN_TRANSMITTANCE`] is left everywhere: by halving, for what is left
/// falls with each.
fn needed(tiles: &TileBlock, lists: &Tiles, splats: &[ProjectedGaussian], part: u32, count: usize) -> usize {
    let is_done = |entries: usize| {
        let (row, column) = (part / tiles.tile_columns, part % tiles.tile_columns);
        let at = [column * SPLAT_TILE as u32, row];
        let tile = tiles.tile_of(at[0], at[1]) as usize;
        let mut starts = lists.starts.clone();
        starts[tile + 1] = starts[tile] + entries as u32;
        let row = BlendedLanes::<SPLAT_TILE>::of(tiles, &starts, &lists.entries, splats, at);
        row.transmittance.into_iter().fold(0.0, f32::max) < MIN_TRANSMITTANCE
    };
    if !is_done(count) {
        return count;
    }
    let (mut low, mut high) = (0, count);
    while low + 1 < high {
        let middle = low.midpoint(high);
        if is_done(middle) { high = middle } else { low = middle }
    }
    high
}

/// The time of blending as many rows of splats in a picture of this size with splats that stay in the cache, of which every row
/// composites every one.
fn limit(tiles: &TileBlock, composited: u64, rounds: usize) -> anyhow::Result<Time> {
    // Wider than the picture, and so faint that all are seen.
    let splat = ProjectedGaussian { extent: [1.0e6; 2], opacity: 0.005, ..ProjectedGaussian::default() };
    let each = (composited / u64::from(tiles.part_count())) as u32;
    let starts: Vec<u32> = (0..=tiles.tile_count()).map(|tile| tile * each).collect();
    let entries: Vec<u32> = (0..tiles.tile_count() * each).map(|entry| entry % CACHED as u32).collect();
    let (splats, starts, entries) = (Cpu.upload(&[splat; CACHED])?, Cpu.upload(&starts)?, Cpu.upload(&entries)?);
    let pixels = (tiles.width * tiles.height) as usize;
    let (mut colours, mut depths) = (Cpu.zeros(pixels)?, Cpu.zeros(pixels)?);
    timed(rounds, || Ok(Cpu.blend_splats(tiles, &starts, &entries, &splats, &mut colours, &mut depths)?))
}
