//! `viewfuse-lab scenes`.

use crate::scenes::collection::{MAX_OBJECT_COUNT, ObjectCounts, Settings, make};
use crate::scenes::{generate, photograph, render, toy, write_scene, write_shoot};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_cli::shared::{Terminal, on_threads, parse_size as parse_picture_size, say};
use viewfuse_job::progress::Progress;

#[derive(Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Generate and render objects of one kind: training, validation and test scenes in SRN's layout.
    Make(MakeArguments),
    /// Generate and photograph a scene with a background: one scene in NeRF's layout.
    Photograph(PhotographArguments),
    /// Make the sample scene: a toy lorry from 20 views to build on and 4 to test on, in SRN's layout.
    Toy {
        /// The output folder, which must not exist
        #[arg(value_name = "OUT_FOLDER")]
        out: PathBuf,
    },
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse-lab scenes photograph room scene/ --seed 3\n      scene/transforms.json and scene/images, 12 views of 320 \
    x 240 pixels\n\n\
    The same settings give the same pictures.")]
struct PhotographArguments {
    /// What is photographed: a table in a furnished room
    #[arg(value_parser = ["room"])]
    place: String,
    /// The output folder, which must not exist
    #[arg(value_name = "OUT_FOLDER")]
    out: PathBuf,
    /// Number of views
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = view_count())]
    views: u32,
    /// Size of the photographs
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = parse_picture_size)]
    size: [u32; 2],
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse-lab scenes make cars learn/ --train 400 --val 10 --test 20 --size 64\n      learn/cars_train, \
    learn/cars_val and learn/cars_test, one folder for each object\n\n\
    Training cameras are random points on a sphere, nine of ten on its upper half; validation and test cameras are on \
    the\n\
    spiral of SRN's test scenes. The same settings give the same pictures. After an interruption the same command\n\
    continues, and with a larger number of objects it adds the missing ones.")]
struct MakeArguments {
    /// Kind of objects
    #[arg(value_parser = ["cars"])]
    kind: String,
    /// The output folder, with KIND_train, KIND_val and KIND_test
    #[arg(value_name = "OUT_FOLDER")]
    out: PathBuf,
    /// Training objects
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = object_count())]
    train: u32,
    /// Validation objects
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = object_count())]
    val: u32,
    /// Test objects
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = object_count())]
    test: u32,
    /// Views of a training object
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = view_count())]
    views: u32,
    /// Views of the other objects
    #[arg(long, value_name = "N", default_value_t = 251, value_parser = view_count())]
    test_views: u32,
    /// Pixels of a picture along each side: 64 or 128
    #[arg(long, value_name = "N", default_value = "128", value_parser = parse_size)]
    size: u32,
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

fn object_count() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(0..=i64::from(MAX_OBJECT_COUNT))
}

fn view_count() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=10_000)
}

fn parse_size(text: &str) -> Result<u32, String> {
    match text {
        "64" => Ok(64),
        "128" => Ok(128),
        _ => Err("the size must be 64 or 128".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    match &arguments.command {
        Command::Make(arguments) => run_make(arguments),
        Command::Photograph(arguments) => run_photograph(arguments),
        Command::Toy { out } => run_toy(out),
    }
}

fn run_make(arguments: &MakeArguments) -> anyhow::Result<ExitCode> {
    let MakeArguments { kind: _, out, train, val, test, views, test_views, size, seed, threads } = arguments;
    let settings = Settings::new(*seed, *size, *views, *test_views);
    let counts = ObjectCounts { train: *train, validation: *val, test: *test };
    let progress = Terminal::new("making scenes");
    let made = on_threads(*threads, || make(out, &settings, counts, &progress))??;
    drop(progress);
    let more = match made.more_count {
        0 => String::new(),
        count => format!("; {count} more than were asked for stay there, and are part of the data set"),
    };
    say(format_args!("{}: {} new scenes, {} existing{more}", out.display(), made.new_count, made.kept_count))?;
    Ok(ExitCode::SUCCESS)
}

fn run_photograph(arguments: &PhotographArguments) -> anyhow::Result<ExitCode> {
    let PhotographArguments { place: _, out, views, size, seed, threads } = arguments;
    let shoot = generate(*seed, *size, *views)?;
    let progress = Terminal::new("photographing");
    on_threads(*threads, || write_shoot(out, &shoot, photograph::RAYS_PER_SIDE, &progress))??;
    drop(progress);
    say(format_args!("{}: {views} views", out.display()))?;
    Ok(ExitCode::SUCCESS)
}

fn run_toy(out: &Path) -> anyhow::Result<ExitCode> {
    let cameras = [toy::training_cameras()?, toy::test_cameras()?].concat();
    let progress = Terminal::new("making the scene");
    progress.expect(cameras.len());
    write_scene(out, &toy::lorry(), &cameras, render::RAYS_PER_SIDE, &progress)?;
    drop(progress);
    say(format_args!("{}: {} views", out.display(), cameras.len()))?;
    Ok(ExitCode::SUCCESS)
}
