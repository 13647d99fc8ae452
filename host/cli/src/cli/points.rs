//! `viewfuse points`.

use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::outputs::{keep_file_apart, keep_others};
use super::printing::{say, warn_of};
use super::terminal::Terminal;
use super::threads::on_threads;
use super::weighting::scheme_help;
use anyhow::bail;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_device::choice::Chosen;
use viewfuse_field::AnyField;
use viewfuse_field::point_cloud::{CloudOptions, CloudPoint, point_cloud};
use viewfuse_field::render::Stage;
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::{Part, Progress};
use viewfuse_output::ply::write_ply;
use viewfuse_scene::photographs::Album;
use viewfuse_weighting::WeightingSpec;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse points photos/ -o photos.ply\n  \
    viewfuse points dino/ --size 320x240 --agree 3 -o dino.ply\n\n\
    The depths of all sources, by the training-free field. A point is kept where enough views agree on it, and is \
    their mean by the scheme's weights; it has a normal, and a colour without the background. Coordinates are those of \
    the scene's files.")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", default_value_t = WeightingSpec::default(), help = scheme_help())]
    weights: WeightingSpec,
    /// Keep points on which this many views agree, their own included
    #[arg(long, value_name = "N", default_value_t = CloudOptions::default().least_views,
        value_parser = clap::value_parser!(u32).range(1..=256))]
    agree: u32,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// The .ply file
    #[arg(short, long, value_name = "FILE", value_parser = PathBufValueParser::new().try_map(ply_file))]
    output: PathBuf,
}

/// A file of the one format that is written.
fn ply_file(path: PathBuf) -> Result<PathBuf, &'static str> {
    match path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply")) {
        true => Ok(path),
        false => Err("point clouds are written as .ply, which MeshLab, CloudCompare and Blender read"),
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = arguments.picture.masks.open(&arguments.scene)?;
    warn_of(&scene);
    let field = AnyField::default();
    let about = field.about();
    let sources = arguments.sources.to_selection(None, None).sources_without(&scene, &[], about.least_sources)?;
    let options = arguments.picture.to_render_options();
    check_writable(&arguments.output)?;
    keep_file_apart([&scene], &arguments.output)?;
    keep_others(&arguments.output)?;
    let Chosen { device, reason } = arguments.device.open()?;
    let renderer = field.on(&device);
    let progress = Terminal::new("points");
    let points = on_threads(arguments.picture.threads, || -> anyhow::Result<Vec<CloudPoint>> {
        progress.stage("reading the photographs", 0..1, 10);
        let album = Album::open(&scene, sources.iter().copied(), &progress)?;
        let mut stage = Stage::prepare(&scene, &album, &sources, renderer.as_ref(), &options, &progress)?;
        let options = CloudOptions { least_views: arguments.agree };
        Ok(point_cloud(&mut stage, &weighting, options, &Part::begin(&progress, "", 1..10, 10))?)
    })??;
    drop(progress);
    if points.is_empty() {
        bail!("{}: no {} of {} views agree on any point", scene.path.display(), arguments.agree, sources.len());
    }
    write_ply(&arguments.output, &points, &scene.frame)?;
    say(format_args!("{}: {} points of {} views", arguments.output.display(), points.len(), sources.len()))?;
    say(format_args!("device: {}, {reason}", device.name()))?;
    Ok(ExitCode::SUCCESS)
}
