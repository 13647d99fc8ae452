//! `viewfuse compare`.

use super::metrics_options::MetricOptions;
use super::options::DeviceOptions;
use super::say;
use super::table::table;
use super::terminal::Terminal;
use anyhow::{Context, bail, ensure};
use clap::Args;
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_device::Device;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_evaluate::metrics::features::Features;
use viewfuse_evaluate::metrics::trunk::InceptionKind;
use viewfuse_evaluate::metrics::{Metrics, Scored};
use viewfuse_job::progress::Progress;
use viewfuse_scene::read_picture;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse compare out/000020.png car/rgb/000020.png\n      PSNR and SSIM of one picture\n  \
    viewfuse compare out/ car/rgb/ --lpips alex=alexnet.pth --dists vgg16.pth --fid pt_inception-2015-12-05.pth\n      \
    of every picture in out/, with the photograph of the same name\n\n\
    Transparency is ignored.")]
pub(crate) struct Arguments {
    /// A picture, or a folder of pictures (PNG, JPEG)
    prediction: PathBuf,
    /// Its ground truth: a picture, or a folder with a picture of each name
    truth: PathBuf,
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

/// A picture's name, its path, and the path of its ground truth.
struct Pair {
    name: String,
    prediction: PathBuf,
    truth: PathBuf,
}

/// Every picture with its ground truth.
fn pairs(prediction: &Path, truth: &Path) -> anyhow::Result<Vec<Pair>> {
    if !prediction.is_dir() {
        ensure!(!truth.is_dir(), "{}: is a folder, {} is not", truth.display(), prediction.display());
        let name = prediction.display().to_string();
        return Ok(vec![Pair { name, prediction: prediction.to_owned(), truth: truth.to_owned() }]);
    }
    let listed = || format!("{}: cannot be listed", prediction.display());
    let mut pairs = Vec::new();
    for entry in std::fs::read_dir(prediction).with_context(listed)? {
        let path = entry.with_context(listed)?.path();
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        if !extension.is_some_and(|extension| ["png", "jpg", "jpeg"].iter().any(|known| extension == *known)) {
            continue;
        }
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        pairs.push(Pair { truth: truth.join(&name), prediction: path, name });
    }
    pairs.sort_by(|a, b| a.name.cmp(&b.name));
    match pairs.iter().find(|pair| !pair.truth.is_file()) {
        _ if pairs.is_empty() => bail!("{}: has no pictures (PNG, JPEG)", prediction.display()),
        Some(pair) => bail!("{}: is missing, to compare {} with", pair.truth.display(), pair.prediction.display()),
        None => Ok(pairs),
    }
}

fn opened(path: &Path) -> anyhow::Result<RgbImage> {
    Ok(read_picture(path)?.into_rgb8())
}

fn compare<D: Device>(arguments: &Arguments, pairs: &[Pair], device: &D) -> anyhow::Result<()> {
    let metrics = arguments.metrics.open(device)?;
    let progress = Terminal::new("comparing pictures");
    // Inception sees every picture again, and each truth.
    let parts = if metrics.inception.is_some() && pairs.len() > 1 { 3 } else { 1 };
    progress.stage("comparing pictures", 0..1, parts);
    progress.expect(pairs.len());
    let (mut scores, mut pictures) = (Vec::new(), Vec::new());
    for pair in pairs {
        progress.check()?;
        let [prediction, truth] = [opened(&pair.prediction)?, opened(&pair.truth)?];
        let scored = metrics.compare(device, &prediction, &truth, None);
        scores.push(scored.with_context(|| pair.prediction.display().to_string())?);
        if metrics.inception.is_some() {
            pictures.push([prediction, truth]);
        }
        progress.step();
    }
    let sets = match &metrics.inception {
        Some(_) if pictures.len() > 1 => features_of_sets(&metrics, &pictures, device, &progress)?,
        _ => None,
    };
    drop(progress);
    print_scores(pairs, &scores)?;
    match (&metrics.inception, sets) {
        (Some(inception), Some(sets)) => print_distances(inception.kind(), &sets, pictures.len(), arguments.seed),
        (Some(_), None) => Ok(say("FID and KID need sets of at least 2 pictures")?),
        (None, _) => Ok(()),
    }
}

/// Inception's features of all predictions and of all truths; `None` without that network.
fn features_of_sets<D: Device>(
    metrics: &Metrics<D>,
    pictures: &[[RgbImage; 2]],
    device: &D,
    progress: &dyn Progress,
) -> anyhow::Result<Option<[Features; 2]>> {
    progress.stage("features of the pictures", 1..2, 3);
    let predictions = metrics.features_of_predictions(device, pictures.iter().map(|[prediction, _]| prediction))?;
    progress.stage("features of the truths", 2..3, 3);
    progress.expect(pictures.len());
    let truths = pictures.iter().map(|[_, truth]| truth).inspect(|_| progress.step());
    let truths = metrics.features_of_truths(device, truths)?;
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
    let mut rows = table(["metric", "mean", "worst", "of"].map(str::to_owned));
    for name in names {
        let own = pairs
            .iter()
            .zip(scores)
            .filter_map(|(pair, scores)| scores.iter().find(|score| score.name == name).map(|score| (pair, score)));
        let own: Vec<(&Pair, &Scored)> = own.collect();
        let mean = own.iter().map(|(_, score)| score.value).sum::<f64>() / own.len() as f64;
        let badness = |score: &Scored| if score.more_is_better { -score.value } else { score.value };
        let worst = own.iter().max_by(|(_, a), (_, b)| badness(a).total_cmp(&badness(b)));
        let (place, worst) = worst.map_or((String::new(), f64::NAN), |(pair, score)| (pair.name.clone(), score.value));
        rows.add_row([name.to_owned(), format!("{mean:.4}"), format!("{worst:.4}"), place]);
    }
    say(format_args!(
        "{}",
        if pairs.len() == 1 { "1 picture".to_owned() } else { format!("{} pictures", pairs.len()) }
    ))?;
    Ok(say(rows)?)
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
    Err(super::left_out::in_feature("FID and KID", "fid"))
}
