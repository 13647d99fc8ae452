//! `viewfuse pareto`.

use super::environment::device_options;
use super::model::NetworkOptions;
use super::options::{OmissionOptions, PictureOptions, SourceOptions};
use super::outputs::{keep_folder_apart, keep_others, keep_others_than};
use super::parse::parse_seconds;
use super::printing::{complain, say, warn_of};
use super::table::table;
use super::terminal::Terminal;
use super::threads::on_threads;
use super::wrong::wrong;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_device::choice::{AnyDevice, DeviceChoice, Several, open_several};
use viewfuse_evaluate::pareto::front::{MAX_LOSS, SAME_LOOK};
use viewfuse_evaluate::pareto::record::{DeviceRecord, DifferenceRecord, ParetoRecord, PointRecord, csv_of};
use viewfuse_evaluate::pareto::{Measured, Subject, plot, settings};
use viewfuse_field::pixelnerf::PixelNerf;
use viewfuse_field::render::RenderOptions;
use viewfuse_field::row::Drawn;
use viewfuse_field::variant::EXACT;
use viewfuse_field::{AnyField, LeftOut};
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_job::progress::{Part, Progress};
use viewfuse_output::record::view_names;
use viewfuse_scene::photographs::Album;
use viewfuse_vulkan::GpuOptions;
use viewfuse_weighting::WeightingSpec;

/// How many times as long as reading the photographs a device is taken to need.
const READINGS: usize = 20;

/// How its table and its picture begin, which do not say who wrote them.
const CSV_BEGIN: &str = "device,setting,best,";
const SVG_BEGIN: &str = "<svg width=\"1100\" height=\"720\"";

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse pareto car/ --targets 5 --sources all/3 --model body:64 --size 64x64 -o out\n      each omission alone, \
    all together, and fewer samples, on every device\n  viewfuse pareto car/ --targets 5 --sources all/3 --model \
    genvs:small --size 32x32 --only all -o out\n      only settings whose words begin with all\n  viewfuse pareto \
    dino/ --targets '#1,#7' --size 160x120 --device cpu --repeat 5 -o out\n      the training-free field, on the CPU\n\n\
    Writes pareto.csv, pareto.svg and pareto.json. The first setting, exact, leaves nothing out; the others are \
    compared with its pictures before rounding. The setting `all` has --leave-out, --early-termination and every \
    omission of the network. Times are medians over rounds through all settings; other load on the machine still \
    affects them. A * marks the best settings: no other is both as fast and as near. Exit code 1 if a \
    device fails.")]
pub(crate) struct Arguments {
    /// The scene's folder, or its transforms.json or *_par.txt
    scene: PathBuf,
    /// Views to render, as for --sources; they are no sources [default: the scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    sources: SourceOptions,
    /// Weighting scheme, as for render, but auto, which chooses its own settings
    #[arg(long, value_name = "SCHEME", default_value_t)]
    weights: WeightingSpec,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    omissions: OmissionOptions,
    #[command(flatten)]
    network: NetworkOptions,
    /// Seed of every random draw (the training-free field makes none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Measure on this device: cpu, vulkan, vulkan:NUMBER or vulkan:NAME; may be given several times [default: all]
    #[arg(long, value_name = "DEVICE")]
    device: Vec<DeviceChoice>,
    /// Time every setting this many times, after a round that is not timed
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: u32,
    /// Measure, besides exact, only settings whose words begin with this; may be given several times
    #[arg(long, value_name = "WORDS")]
    only: Vec<String>,
    /// Show another program beside: its name, and its seconds for the same pictures; may be given several times
    #[arg(long, value_name = "NAME=SECONDS", value_parser = parse_beside)]
    beside: Vec<Beside>,
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// Another program that makes the exact pictures.
#[derive(Clone)]
struct Beside {
    name: String,
    seconds: f64,
}

fn parse_beside(text: &str) -> Result<Beside, String> {
    let (name, seconds) =
        text.rsplit_once('=').filter(|(name, _)| !name.trim().is_empty()).ok_or("a name and a time, as PyTorch=5.8")?;
    Ok(Beside { name: name.to_owned(), seconds: parse_seconds(seconds)?.as_secs_f64() })
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = arguments.picture.masks.open(&arguments.scene)?;
    warn_of(&scene);
    let field = arguments.network.open(arguments.seed)?;
    // Its variants are measured without their warnings.
    let network = field.downcast_ref::<PixelNerf>().and_then(PixelNerf::assumption);
    network.iter().for_each(|assumption| complain(format_args!("warning: {assumption}")));
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), None);
    let job = selection.resolve(&scene, field.about().least_sources)?;
    let options = arguments.omissions.omitting(arguments.picture.to_render_options(), false, &field.about())?;
    keep_folder_apart([&scene], &arguments.output)?;
    let [csv, svg, json] = ["pareto.csv", "pareto.svg", "pareto.json"].map(|name| arguments.output.join(name));
    [&csv, &svg, &json].into_iter().try_for_each(|path| check_writable(path))?;
    keep_others(&json)?;
    [(&csv, CSV_BEGIN), (&svg, SVG_BEGIN)].into_iter().try_for_each(|(path, begin)| keep_others_than(path, begin))?;
    let Several { devices, notes, failures } = open_several(&arguments.device, &device_options(GpuOptions::default()))?;

    let (progress, count) = (Terminal::new("measuring"), devices.len());
    progress.stage("reading the photographs", 0..1, 1 + READINGS * count);
    let truths = job.targets.iter().filter_map(|target| target.truth);
    let album = Album::open(&scene, job.sources.iter().copied().chain(truths), &progress)?;
    let subject = Subject { scene: &scene, album: &album, job: &job, weighting: &weighting };
    let (only, round_count) = (&arguments.only, arguments.repeat);
    let sweep = Sweep { subject, options: &options, only, round_count };
    let mut record = ParetoRecord {
        viewfuse: env!("CARGO_PKG_VERSION"),
        scene: arguments.scene.display().to_string(),
        field: field.about().name,
        model: arguments.network.label(),
        weighting: weighting.to_string(),
        seed: arguments.seed,
        size: [0, 0],
        sources: view_names(&scene, &job.sources),
        targets: job.targets.iter().map(|target| target.name.clone()).collect(),
        round_count: arguments.repeat,
        devices: Vec::new(),
        failures,
    };
    let mut first: Option<Measured> = None;
    for (index, device) in devices.into_iter().enumerate() {
        let name = device.name();
        let place = 1 + READINGS * index..1 + READINGS * (index + 1);
        let part = Part::begin(&progress, name.clone(), place, 1 + READINGS * count);
        let measured = on_threads(arguments.picture.threads, || sweep.on(&device, &field, &part))?;
        let measured = match measured {
            Ok(measured) => measured,
            // The results of the other devices are kept if one fails.
            Err(Failure::Device(failure)) => {
                record.failures.push(format!("{name}: {failure}"));
                continue;
            }
            Err(Failure::Other(error)) => return Err(error),
        };
        let versus_first = first.as_ref().map(|first| measured.exact_versus(first));
        record.size = measured.size;
        record.devices.push(DeviceRecord::of(name, &measured.points, versus_first));
        first.get_or_insert(measured);
    }
    drop(progress);

    let measured_count = record.devices.len();
    if let Some(exact) = record.devices.first().and_then(|device| device.points.first()).map(|point| point.seconds) {
        let beside = arguments.beside.iter().map(|beside| DeviceRecord::beside(&beside.name, beside.seconds, exact));
        record.devices.extend(beside);
    }
    let title = title(&record);
    if !record.devices.is_empty() {
        // All are computed before the first is written; the record is written last.
        let plot = plot::svg(&title, &record.devices)?;
        let (table, whole) = (csv_of(&record)?, serde_json::to_vec_pretty(&record)?);
        write_whole(&csv, &table)?;
        write_whole(&svg, plot.as_bytes())?;
        write_whole(&json, &whole)?;
    }
    say(format_args!("{title}\n"))?;
    record.devices.iter().take(measured_count).try_for_each(print_device)?;
    notes.iter().try_for_each(say)?;
    if !record.devices.is_empty() {
        say(format_args!("{}, {}, {}", csv.display(), svg.display(), json.display()))?;
    }
    record.failures.iter().try_for_each(|failure| say(format_args!("FAILED: {failure}")))?;
    Ok(ExitCode::from(u8::from(!record.failures.is_empty())))
}

/// Why a device has no points.
enum Failure {
    /// The device's own fault.
    Device(String),
    /// The settings', on every device.
    Other(anyhow::Error),
}

/// The measurement on every device.
struct Sweep<'a> {
    subject: Subject<'a>,
    options: &'a RenderOptions,
    only: &'a [String],
    round_count: u32,
}

impl Sweep<'_> {
    fn on(&self, device: &AnyDevice, field: &AnyField, progress: &dyn Progress) -> Result<Measured, Failure> {
        let settings = settings::of(field, self.options, self.subject.job.targets.len(), &device.precisions());
        let begins = |setting: &Drawn, words: &String| setting.label.starts_with(words.as_str());
        if let Some(none) = self.only.iter().find(|words| !settings.iter().any(|setting| begins(setting, words))) {
            let all: Vec<&str> = settings.iter().map(|setting| setting.label.as_str()).collect();
            let message = format!("--only {none}: no setting begins with it; the settings are: {}", all.join("; "));
            return Err(Failure::Other(wrong(message)));
        }
        let is_exact = |setting: &Drawn| setting.label == EXACT;
        let is_asked = |setting: &Drawn| self.only.iter().any(|words| begins(setting, words));
        let settings: Vec<Drawn> = settings
            .into_iter()
            .filter(|setting| self.only.is_empty() || is_exact(setting) || is_asked(setting))
            .collect();
        self.subject.measure(device, &settings, self.round_count, progress).map_err(|error| match error {
            error if error.is_of_device() => Failure::Device(format!("{:#}", anyhow::Error::from(error))),
            error => Failure::Other(error.into()),
        })
    }
}

fn title(record: &ParetoRecord) -> String {
    let ParetoRecord { field, model, size: [width, height], sources, targets, .. } = record;
    let scene = record.scene.trim_end_matches('/').rsplit('/').next().unwrap_or_default();
    let network = match model {
        None => (*field).to_owned(),
        // Test networks that are named after their field.
        Some(model) if model.split(':').next() == Some(*field) => model.clone(),
        Some(model) => format!("{field} {model}"),
    };
    let targets = if targets.len() == 1 { "1 target".to_owned() } else { format!("{} targets", targets.len()) };
    format!("{scene}: {network}, {targets} of {width}x{height} from {} sources, {}", sources.len(), record.weighting)
}

/// A device's points, and the recommended ones.
fn print_device(device: &DeviceRecord) -> std::io::Result<()> {
    say(&device.device)?;
    let has_truth = device.points.iter().any(|point| point.truth_psnr.is_some());
    let mut header =
        ["", "setting", "s/picture", "encoding", "gain", "PSNR dB\nto exact", "largest\ndifference"].to_vec();
    header.extend(if has_truth { &["PSNR dB\nto truth", "loss"][..] } else { &[] });
    let mut header: Vec<String> = header.into_iter().map(str::to_owned).collect();
    let has_calls = device.points.iter().any(|point| point.denoising.is_some());
    header.extend(has_calls.then(|| "calls".to_owned()));
    let left_out = device.points.first().map_or(&[][..], |point| &point.left_out);
    header.extend(left_out.iter().map(|LeftOut { what, .. }| what.replace(' ', "\n")));
    let mut rows = table(header);
    rows.align_left([1]);
    device.points.iter().for_each(|point| rows.add_row(row(point, has_truth, has_calls)));
    say(rows)?;
    if !left_out.is_empty() {
        say("the last columns: how much of it was omitted, %")?;
    }
    let named = |setting: &Option<String>| setting.clone().unwrap_or_else(|| "none".to_owned());
    if has_truth {
        say(format_args!("fastest with a loss of at most {MAX_LOSS} dB: {}", named(&device.fastest_without_loss)))?;
    }
    say(format_args!("fastest at {SAME_LOOK} dB or more from exact: {}", named(&device.fastest_of_same_look)))?;
    if let Some(difference) = &device.exact_versus_first {
        let (ratio, largest) = (ratio(difference), largest(difference));
        say(format_args!("its exact pictures against the first device's: PSNR {ratio}, largest difference {largest}"))?;
    }
    let changing: Vec<&str> =
        device.points.iter().filter(|point| !point.repeatable).map(|point| point.setting.as_str()).collect();
    if changing.is_empty() {
        say("every round gave the same pictures\n")
    } else {
        say(format_args!("NOT THE SAME in every round: {}\n", changing.join("; ")))
    }
}

fn row(point: &PointRecord, has_truth: bool, has_calls: bool) -> Vec<String> {
    let mut row = vec![
        if point.best { "*" } else { "" }.to_owned(),
        point.setting.clone(),
        format!("{:.3}", point.seconds),
        format!("{:.3}", point.encode_seconds),
        format!("{:.2}", point.gain),
        ratio(&point.versus_exact),
        largest(&point.versus_exact),
    ];
    if has_truth {
        row.extend(
            [point.truth_psnr, point.truth_loss].map(|value| value.map_or(String::new(), |v| format!("{v:.2}"))),
        );
    }
    if has_calls {
        row.push(point.denoising.map_or(String::new(), |denoising| denoising.calls.to_string()));
    }
    row.extend(point.left_out.iter().map(|LeftOut { left_out, of, .. }| match left_out {
        0 => String::new(),
        _ => format!("{:.1}", 100.0 * *left_out as f64 / *of as f64),
    }));
    row
}

fn ratio(difference: &DifferenceRecord) -> String {
    match (difference.root_mean_square, difference.psnr) {
        (None, _) => "no number".to_owned(),
        (_, None) => "equal".to_owned(),
        (_, Some(psnr)) => format!("{psnr:.1}"),
    }
}

fn largest(difference: &DifferenceRecord) -> String {
    match difference.largest {
        None => "no number".to_owned(),
        Some(0.0) => String::new(),
        Some(largest) => format!("{largest:.1e}"),
    }
}
