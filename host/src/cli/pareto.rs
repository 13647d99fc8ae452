//! `viewfuse pareto`.

use super::model::{AnyField, NetworkOptions};
use super::options::{PictureOptions, SourceOptions};
use super::table::table;
use super::{on_threads, say};
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse::device::Device;
use viewfuse::device::choice::{AnyDevice, DeviceChoice, Several, open_several};
use viewfuse::field::{Field, LeftOut};
use viewfuse::field::pixelnerf::Omissions;
use viewfuse::files::{check_writable, write_whole};
use viewfuse::interrupt::Interrupted;
use viewfuse::pareto::difference::Difference;
use viewfuse::pareto::front::{LARGEST_LOSS, SAME_LOOK};
use viewfuse::pareto::record::{DeviceRecord, DifferenceRecord, ParetoRecord, PointRecord, csv_of};
use viewfuse::pareto::settings::{of_photo, of_pixelnerf};
use viewfuse::pareto::{Measured, Setting, Subject, plot};
use viewfuse::photographs::Album;
use viewfuse::progress::Progress;
use viewfuse::record::source_names;
use viewfuse::render::{RenderError, RenderOptions};
use viewfuse::scene::Scene;
use viewfuse::weighting::Weighting;
use viewfuse_vulkan::GpuOptions;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse pareto car/ --targets 5 --sources all/3 --model body:64 --size 64x64 -o out\n      each omission alone, all together, and fewer samples, on every device\n  \
    viewfuse pareto dino/ --targets 1,7 --size 160x120 --device cpu --repeat 5 -o out\n      the field that needs no network, on the CPU\n\n\
    Writes pareto.csv, pareto.svg and pareto.json. The first setting, exact, leaves nothing out; the others are compared\n\
    with its pictures before rounding. Times are medians; a round goes through all settings, but what else a shared\n\
    machine does still shows in them. A * marks settings that are the best for their time: none is as fast and as near.\n\
    Exit code 1 if a device fails.")]
pub(crate) struct Arguments {
    /// The scene's folder, or its transforms.json or *_par.txt
    scene: PathBuf,
    /// Views to render, as for --sources; left out of the sources [default: the scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    sources: SourceOptions,
    /// Weighting scheme, as for render
    #[arg(long, value_name = "SCHEME", default_value = "error:alpha=1")]
    weights: String,
    /// What --leave-out and --settled say is what the setting `all` leaves out
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    network: NetworkOptions,
    /// Seed of every random number (the field that needs no network draws none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Measure on this device: cpu, vulkan, vulkan:NUMBER or vulkan:NAME; may be given several times [default: all]
    #[arg(long, value_name = "DEVICE")]
    device: Vec<DeviceChoice>,
    /// Take the time of every setting this many times, after a round that is not timed
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: u32,
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting: Weighting = arguments.weights.parse()?;
    let scene = Scene::open(&arguments.scene)?;
    let field = arguments.network.open(arguments.seed, Omissions::default())?;
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), None);
    let job = selection.resolve(&scene, field.least_sources())?;
    let options = arguments.picture.to_render_options(false);
    let [csv, svg, json] = ["pareto.csv", "pareto.svg", "pareto.json"].map(|name| arguments.output.join(name));
    [&csv, &svg, &json].into_iter().try_for_each(|path| check_writable(path))?;
    let Several { devices, notes, failures } = open_several(&arguments.device, &GpuOptions::default())?;

    let progress = Progress::new("measuring");
    let truths = job.targets.iter().filter_map(|target| target.truth);
    let album = Album::open(&scene, job.sources.iter().copied().chain(truths), &progress)?;
    let subject = Subject { scene: &scene, album: &album, job: &job, weighting: &weighting };
    let mut sweep = Sweep { arguments, subject, options: &options, progress: &progress, first: None };
    let mut record = ParetoRecord {
        viewfuse: env!("CARGO_PKG_VERSION"),
        scene: arguments.scene.display().to_string(),
        field: field.name(),
        model: arguments.network.label(),
        weighting: weighting.to_string(),
        seed: arguments.seed,
        size: [0, 0],
        sources: source_names(&scene, &job),
        targets: job.targets.iter().map(|target| target.name.clone()).collect(),
        round_count: arguments.repeat,
        devices: Vec::new(),
        failures,
    };
    Ok(ExitCode::SUCCESS)
}
