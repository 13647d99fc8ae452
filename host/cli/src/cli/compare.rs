//! `viewfuse compare`.

mod pairs;

use super::metrics_options::MetricOptions;
use super::options::DeviceOptions;
use super::printing::say;
use super::table::table;
use super::terminal::Terminal;
use anyhow::Context;
use clap::Args;
use image::RgbImage;
use pairs::{Pair, pairs};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_device::Device;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_evaluate::metrics::features::Features;
use viewfuse_evaluate::metrics::trunk::InceptionKind;
use viewfuse_evaluate::metrics::{Metrics, Scored, Scorer};
use viewfuse_job::progress::Progress;
use viewfuse_output::folder::recorded_background;
use viewfuse_output::record::RECORD;
use viewfuse_scene::photographs::{BackgroundChoice, read_over};
use viewfuse_scene::picture_size;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse compare out/000020.png car/rgb/000020.png\n      PSNR and SSIM of one picture; psnr-corrected is that \
    of the colours after the gain and the offset of each channel that fit the truth best\n  \
    viewfuse compare out/ car/rgb/ --lpips alex=alexnet.pth --dists vgg16.pth --fid pt_inception-2015-12-05.pth\n      \
    of every picture in out/, with the photograph of the same name\n\n\
    Transparent pictures are laid over the background of their run, as `render` does when it compares; the last line \
    says over which.")]
pub(crate) struct Arguments {
    /// A picture, or a folder of pictures (PNG, JPEG)
    prediction: PathBuf,
    /// Its ground truth: a picture, or a folder with a picture of each name
    truth: PathBuf,
    /// What transparent pictures are laid over: black, white, RED,GREEN,BLUE (0 to 255), none to ignore transparency
    /// [default: that of the run.json beside the picture, else white]
    #[arg(long, value_name = "COLOUR")]
    background: Option<BackgroundChoice>,
    #[command(flatten)]
    metrics: MetricOptions,
    /// Seed of the subsets whose mean is the KID of more than 1000 pictures
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let pairs = pairs(&arguments.prediction, &arguments.truth)?;
    let Chosen { device, .. } = arguments.device.open()?;
    match &device {
        AnyDevice::Cpu(cpu) => compare(arguments, &pairs, cpu)?,
        AnyDevice::Vulkan(vulkan) => compare(arguments, &pairs, vulkan.as_ref())?,
    }
    Ok(ExitCode::SUCCESS)
}

/// What pictures with transparency are laid over: `None` for nothing, as a render does with photographs of whole
/// scenes.
struct Background {
    colour: Option<[f32; 3]>,
    /// Where it comes from, for a person.
    source: String,
}

impl Background {
    /// What was given; otherwise what the record beside the predictions says; otherwise white, as `auto` of `render`.
    fn of(given: Option<BackgroundChoice>, predictions: &Path) -> Background {
        let folder = if predictions.is_dir() { predictions } else { predictions.parent().unwrap_or(Path::new("")) };
        let recorded = || recorded_background(folder).map(|used| (used, folder.join(RECORD).display().to_string()));
        let white = || (Some([1.0; 3]), "the default".to_owned());
        let (colour, source) = match given {
            Some(BackgroundChoice::Colour(colour)) => (Some(colour), "--background".to_owned()),
            Some(BackgroundChoice::None) => (None, "--background".to_owned()),
            Some(BackgroundChoice::Auto) | None => recorded().unwrap_or_else(white),
        };
        Background { colour, source }
    }

    fn words(&self) -> String {
        let Some(colour) = self.colour else { return format!("transparency ignored ({})", self.source) };
        let [red, green, blue] = colour.map(|value| (255.0 * value).round());
        format!("over {red},{green},{blue} ({})", self.source)
    }
}

/// The pictures of a pair in one size. A truth that is larger, and of the same shape, is resampled as `render` does it.
fn opened(pair: &Pair, background: &Background) -> anyhow::Result<([RgbImage; 2], bool)> {
    let prediction = read_over(&pair.prediction, None, background.colour)?;
    let size: [u32; 2] = prediction.dimensions().into();
    let full = picture_size(&pair.truth)?;
    let is_larger = full != size && is_shape_of(size, full) && full[0] >= size[0] && full[1] >= size[1];
    let truth = read_over(&pair.truth, is_larger.then_some(size), background.colour)?;
    Ok(([prediction, truth], is_larger))
}

/// Whether a picture of the second size, made smaller, has the first one, up to rounding.
fn is_shape_of(size: [u32; 2], larger: [u32; 2]) -> bool {
    let [[width, height], [full_width, full_height]] = [size, larger].map(|size| size.map(u64::from));
    (width * full_height).abs_diff(height * full_width) <= full_width.max(full_height) / 2
}

fn compare<D: Device>(arguments: &Arguments, pairs: &[Pair], device: &D) -> anyhow::Result<()> {
    let metrics = arguments.metrics.open(device)?;
    let progress = Terminal::new("comparing pictures");
    // Inception sees every picture again, and each truth.
    let parts = if metrics.inception.is_some() && pairs.len() > 1 { 3 } else { 1 };
    progress.stage("comparing pictures", 0..1, parts);
    progress.expect(pairs.len());
    let background = Background::of(arguments.background, &arguments.prediction);
    let (mut scores, mut pictures, mut resampled) = (Vec::new(), Vec::new(), 0);
    for pair in pairs {
        progress.check()?;
        let ([prediction, truth], is_resampled) = opened(pair, &background)?;
        resampled += usize::from(is_resampled);
        let scored = metrics.score(&prediction, &truth, None);
        scores.push(scored.with_context(|| pair.prediction.display().to_string())?);
        if metrics.inception.is_some() {
            pictures.push([prediction, truth]);
        }
        progress.step();
    }
    let sets = match &metrics.inception {
        Some(_) if pictures.len() > 1 => features_of_sets(&metrics, &pictures, &progress)?,
        _ => None,
    };
    drop(progress);
    print_scores(pairs, &scores)?;
    say(format_args!("transparent pixels: {}", background.words()))?;
    if resampled > 0 {
        say(format_args!("{resampled} of {} photographs are larger: resampled by area averages", pairs.len()))?;
    }
    match (&metrics.inception, sets) {
        (Some(inception), Some(sets)) => print_distances(inception.kind(), &sets, pictures.len(), arguments.seed),
        (Some(_), None) => Ok(say("FID and KID need sets of at least 2 pictures")?),
        (None, _) => Ok(()),
    }
}

/// Inception's features of all predictions and of all truths; `None` without that network.
fn features_of_sets<D: Device>(
    metrics: &Metrics<'_, D>,
    pictures: &[[RgbImage; 2]],
    progress: &dyn Progress,
) -> anyhow::Result<Option<[Features; 2]>> {
    progress.stage("features of the pictures", 1..2, 3);
    let shown: Vec<_> = pictures.iter().map(|[prediction, _]| metrics.convention.shown(prediction)).collect();
    let predictions = metrics.features(shown.iter().map(AsRef::as_ref))?;
    progress.stage("features of the truths", 2..3, 3);
    progress.expect(pictures.len());
    let truths = pictures.iter().map(|[_, truth]| truth).inspect(|_| progress.step());
    let truths = metrics.features(truths)?;
    Ok(predictions.zip(truths).map(|(predictions, truths)| [predictions, truths]))
}

/// A row for each metric: the mean, and the worst picture. A metric leaves out pictures that are too small for it.
fn print_scores(pairs: &[Pair], scores: &[Vec<Scored>]) -> anyhow::Result<()> {
    let mut names: Vec<&str> = Vec::new();
    for score in scores.iter().flatten() {
        if !names.contains(&score.name) {
            names.push(score.name);
        }
    }
    let (mut rows, mut lacks) = (table(["metric", "mean", "worst", "of"].map(str::to_owned)), Vec::new());
    for name in names {
        let scored = pairs
            .iter()
            .zip(scores)
            .filter_map(|(pair, scores)| scores.iter().find(|score| score.name == name).map(|score| (pair, score)));
        let scored: Vec<(&Pair, &Scored)> = scored.collect();
        if scored.len() < pairs.len() {
            let (count, all) = (scored.len(), pairs.len());
            lacks.push(format!("{name}: of {count} of the {all} pictures; the others are too small for it"));
        }
        let mean = scored.iter().map(|(_, score)| score.value).sum::<f64>() / scored.len() as f64;
        let badness = |score: &Scored| if score.more_is_better { -score.value } else { score.value };
        let worst = scored.iter().max_by(|(_, a), (_, b)| badness(a).total_cmp(&badness(b)));
        let (place, worst) = worst.map_or((String::new(), f64::NAN), |(pair, score)| (pair.name.clone(), score.value));
        rows.add_row([name.to_owned(), format!("{mean:.4}"), format!("{worst:.4}"), place]);
    }
    say(format_args!(
        "{}",
        if pairs.len() == 1 { "1 picture".to_owned() } else { format!("{} pictures", pairs.len()) }
    ))?;
    say(rows)?;
    Ok(lacks.iter().try_for_each(say)?)
}

fn print_distances(
    kind: InceptionKind,
    [predictions, truths]: &[Features; 2],
    count: usize,
    seed: u64,
) -> anyhow::Result<()> {
    let [fid, kid] = distances(predictions, truths, seed)?;
    let network = match kind {
        InceptionKind::Fid => "the Inception that FID is defined with",
        InceptionKind::Torchvision => "torchvision's Inception, not comparable with published numbers",
    };
    say(format_args!("FID {fid:.3}, KID {kid:.6} ({network})"))?;
    if count < predictions.dimension() {
        say(format_args!("FID of {count} pictures is biased; KID does not depend on their number"))?;
    }
    Ok(())
}

/// FID and KID of two sets.
#[cfg(feature = "fid")]
fn distances(predictions: &Features, truths: &Features, seed: u64) -> anyhow::Result<[f64; 2]> {
    use viewfuse_evaluate::metrics::frechet::frechet_distance;
    use viewfuse_evaluate::metrics::kernel::kernel_distance;
    Ok([frechet_distance(predictions, truths)?, kernel_distance(predictions, truths, seed)?])
}

/// `--fid` was rejected before ([`MetricOptions::open`]).
#[cfg(not(feature = "fid"))]
fn distances(_: &Features, _: &Features, _: u64) -> anyhow::Result<[f64; 2]> {
    Err(super::wrong::wrong(super::wrong::not_built("FID and KID", "fid")))
}
