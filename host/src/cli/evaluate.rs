//! `viewfuse evaluate`.

use super::model::{ModelOptions, Work};
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::table::table;
use super::{on_threads, say};
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse::device::Device;
use viewfuse::device::choice::Chosen;
use viewfuse::evaluate::{Mean, NEAREST_COPY, Score, evaluate, means};
use viewfuse::few_shot::Selection;
use viewfuse::field::Field;
use viewfuse::files::{check_writable, write_whole};
use viewfuse::progress::Progress;
use viewfuse::render::RenderOptions;
use viewfuse::scene::Scene;
use viewfuse::weighting::{SCHEME_NAMES, Weighting};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse evaluate dino/ --targets 1,4,7,10,13,16 --size 160x120\n      each of six views from all others, every scheme\n  \
    viewfuse evaluate cars/*/ --sources all/3 --weights mean --weights error:alpha=1 -o cars.csv\n      the other views from every third, two schemes")]
pub(crate) struct Arguments {
    /// One or more scenes
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Views to render and compare, as for --sources [default: all views, each left out in turn; with --sources all others]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    sources: SourceOptions,
    /// A weighting scheme; may be given several times [default: every scheme that needs no file]
    #[arg(long, value_name = "SCHEME")]
    weights: Vec<String>,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    model: ModelOptions,
    /// Seed of every random number (the field that needs no network draws none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
    /// Write every single score to this CSV file
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let names: Vec<&str> = match arguments.weights.is_empty() {
        true => SCHEME_NAMES.to_vec(),
        false => arguments.weights.iter().map(String::as_str).collect(),
    };
    let weightings: Vec<Weighting> = names.into_iter().map(str::parse).collect::<Result<_, _>>()?;
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), None);
    arguments.output.as_deref().map_or(Ok(()), check_writable)?;
    let field = arguments.model.open(arguments.seed, None)?;
    let options = arguments.picture.to_render_options(arguments.model.exact, &field)?;
    let Chosen { device, reason } = arguments.device.open()?;
    let mut all: Vec<(String, Score)> = Vec::new();
    // All are opened before the first is computed: a wrong path shows at once.
    let scenes: Vec<Scene> = arguments.scenes.iter().map(Scene::open).collect::<Result<_, _>>()?;
    for (path, scene) in arguments.scenes.iter().zip(&scenes) {
        let progress = Progress::new("evaluating");
        let job = Job { scene, selection: &selection, weightings: &weightings, options: &options, progress: &progress };
        let scores = on_threads(arguments.picture.threads, || field.on(&device, &job))??;
        drop(progress);
        print_table(&path.display().to_string(), &means(&scores))?;
        all.extend(scores.into_iter().map(|score| (path.display().to_string(), score)));
    }
    if arguments.scenes.len() > 1 {
        let scores: Vec<Score> = all.iter().map(|(_, score)| score.clone()).collect();
        print_table(&format!("all {} scenes", arguments.scenes.len()), &means(&scores))?;
    }
    say(format_args!("device: {}, {reason}", device.name()))?;
    if let Some(path) = &arguments.output {
        write_whole(path, &csv_of(&all)?)?;
        say(format_args!("{}", path.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What is evaluated of a scene.
struct Job<'a> {
    scene: &'a Scene,
    selection: &'a Selection,
    weightings: &'a [Weighting],
    options: &'a RenderOptions,
    progress: &'a Progress,
}

impl Work for Job<'_> {
    type Output = anyhow::Result<Vec<Score>>;

    fn run<D: Device, F: Field<D>>(&self, device: &D, field: &F) -> anyhow::Result<Vec<Score>> {
        let Job { scene, selection, weightings, options, progress } = self;
        Ok(evaluate(scene, selection, weightings, device, field, options, progress)?)
    }
}

/// Means over the targets; the best value of each column is marked.
fn print_table(title: &str, means: &[Mean]) -> std::io::Result<()> {
    let copy = means.iter().find(|mean| mean.scheme == NEAREST_COPY).map_or(f64::NAN, |mean| mean.psnr);
    let best_psnr = means.iter().map(|mean| mean.psnr).fold(f64::NEG_INFINITY, f64::max);
    let best_ssim = means.iter().filter_map(|mean| mean.ssim).fold(f64::NEG_INFINITY, f64::max);
    let mut rows = table(["scheme", "PSNR dB", "over copy", "SSIM", "s / view"].map(str::to_owned));
    let marked = |text: String, is_best: bool| if is_best { format!("* {text}") } else { text };
    for mean in means {
        let is_copy = mean.scheme == NEAREST_COPY;
        rows.add_row([
            mean.scheme.clone(),
            marked(format!("{:.2}", mean.psnr), mean.psnr == best_psnr),
            if is_copy { String::new() } else { format!("{:+.2}", mean.psnr - copy) },
            mean.ssim.map_or(String::new(), |ssim| marked(format!("{ssim:.3}"), ssim == best_ssim)),
            if is_copy { String::new() } else { format!("{:.2}", mean.seconds) },
        ]);
    }
    let count = means.first().map_or(0, |mean| mean.target_count);
    say(format_args!("{title}: {}", if count == 1 { "1 target".to_owned() } else { format!("{count} targets") }))?;
    say(format_args!("{rows}\n"))
}

fn csv_of(scores: &[(String, Score)]) -> anyhow::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["scene", "scheme", "target", "sources", "psnr_db", "ssim", "seconds"])?;
    for (scene, score) in scores {
        writer.write_record([
            scene,
            &score.scheme,
            &score.target,
            &score.source_count.to_string(),
            &format!("{:.6}", score.psnr),
            &score.ssim.map_or(String::new(), |ssim| format!("{ssim:.6}")),
            &format!("{:.6}", score.time.as_secs_f64()),
        ])?;
    }
    Ok(writer.into_inner()?)
}
