//! A small GeNVS. With equal weights of the views, as published, unless schemes are given.
//!
//! The loss is that of "Elucidating the design space of diffusion-based generative models" (Karras et al. 2022): noise
//! of a random level on the ground truth, the squared error of the network's output, all levels with one weight. Two
//! changes are for small data and short runs. The first three features are also trained to be the difference of white
//! and a ray's colour, so that volumes learn shapes before the denoiser learns to use them. And a share of the pictures
//! has the largest noise level, where the best output is the mean of all pictures that the sources allow: the result of
//! a single call, and the minimum of the squared error.

use super::TrainError;
use super::augmentation::Augmentation;
use super::batch::{SourceDraw, Targets};
use super::draw::{Draw, Purpose};
use super::genvs::{Genvs, ObjectViews, ViewCounts, colours, each};
use super::parameters::{Contents, Parameters};
use super::pixelnerf_learner::decibels;
use super::run::{self, Learner, Outcome, Plan, Task, Validated, count, number, share, side};
use super::scenes::{Data, TrainingScene};
use candle_core::{DType, Device, Result, Tensor};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::Serialize;
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::schedule::{NoiseSchedule, Preconditioning, SIGMA_DATA};
use viewfuse_field::genvs::{Architecture, Estimate};
use viewfuse_nn::checkpoint::Checkpoint;

/// The settings of a run besides its schedule and scenes.
#[derive(Args, Clone, Debug, PartialEq, Serialize)]
pub(crate) struct GenvsSettings {
    /// Channels of the denoiser's first level, a multiple of 4
    // See [`Architecture::narrow`]. A network that continues from a file has the file's.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = number(
        |width: &usize| (1..=1024).contains(width) && width.is_multiple_of(4), "a multiple of 4 from 4 to 1024 is \
            needed"))]
    width: usize,
    /// Side of the pictures, pixels, a multiple of 16
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side())]
    side: u32,
    /// Objects of a step
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count())]
    objects: usize,
    /// Targets of each object; one in steps with weights other than the mean
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count())]
    targets: usize,
    /// Samples of a ray: as many as in renders
    // Samples shade themselves, so another number changes the brightness.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=4096))]
    samples: u32,
    /// Share of the pictures that have the largest noise level, 0 to 1
    #[arg(long = "largest-share", value_name = "SHARE", default_value_t = MAX_LEVEL_SHARE,
        value_parser = share::<f32>())]
    share_of_largest: f32,
    /// What a new denoiser's estimate is relative to: the colours of the feature image, or nothing, as published
    #[arg(long, default_value = "colours", value_parser = estimate())]
    estimate: Estimate,
    /// With --from: begin with a new denoiser
    #[arg(long, requires = "from")]
    new_denoiser: bool,
    #[arg(skip)]
    pub(crate) augmentation: Augmentation,
}

fn estimate() -> impl TypedValueParser<Value = Estimate> {
    PossibleValuesParser::new(["colours", "published"]).map(|name| match name.as_str() {
        "colours" => Estimate::FromColours,
        _ => Estimate::Published,
    })
}

/// Numbers of sources, fewer than a PixelNeRF's: volumes take more memory.
const SOURCES: [usize; 4] = [1, 2, 3, 3];
/// Mean and deviation of the logarithm of noise levels, as published.
const LEVELS: [f32; 2] = [-1.2, 1.2];
/// Weight of the first features' squared error: that of the picture's at the largest level.
const FEATURES_WEIGHT: f64 = 1.0 / (SIGMA_DATA * SIGMA_DATA) as f64;
/// Objects in validation, and views of each.
const VALIDATION_OBJECTS: usize = 24;
const VALIDATION_SOURCES: usize = 3;
/// Most numbers of a step's volumes, of 4 bytes each; gradients and layers take several times as many.
const MAX_VOLUMES: usize = 1 << 30;

/// The default of [`GenvsSettings::share_of_largest`].
pub(super) const MAX_LEVEL_SHARE: f32 = 0.25;

struct GenvsLearner {
    network: Genvs,
    data: Data,
    settings: GenvsSettings,
}

impl GenvsSettings {
    /// Refuses steps whose volumes alone take more than 4 GiB.
    fn check_volumes(&self, architecture: &Architecture) -> std::result::Result<(), TrainError> {
        let Architecture { image_side, ref encoder, .. } = *architecture;
        let factors =
            [self.augmentation.most_sources(), image_side, image_side, encoder.volume_depth, encoder.feature_count];
        if factors.into_iter().fold(self.objects, usize::saturating_mul) > MAX_VOLUMES {
            let allowed = "objects times sources times the numbers of a volume must be at most 2^30";
            return Err(TrainError::Setting { name: "objects", value: self.objects as f64, allowed });
        }
        Ok(())
    }
}

/// Trains a GeNVS, or continues: from scratch, or from a trained network.
pub(crate) fn train_genvs(
    mut settings: GenvsSettings,
    from: Option<&Checkpoint>,
    task: &Task<'_>,
) -> std::result::Result<Outcome, TrainError> {
    settings.augmentation = settings.augmentation.or(&SOURCES);
    let mut architecture = Architecture::narrow(settings.side as usize, settings.width);
    let (estimate, seed) = (settings.estimate, task.schedule.seed);
    architecture.denoiser.iter_mut().for_each(|denoiser| denoiser.estimate = estimate);
    let network = match from {
        Some(checkpoint) => {
            let new_denoiser = settings.new_denoiser.then_some(estimate);
            Genvs::continued(checkpoint, settings.side, new_denoiser, DType::F32, seed)?
        }
        None => Genvs::new(architecture, DType::F32, seed)?,
    };
    settings.check_volumes(&network.architecture)?;
    let least_views = settings.augmentation.most_sources() + settings.targets.max(1);
    let data = Data::open(task.scenes, settings.side, least_views.max(VALIDATION_SOURCES + 1), task.progress)?;
    if let Some(denoiser) = &network.architecture.denoiser {
        (settings.width, settings.estimate) = (denoiser.base_channels, denoiser.estimate);
    }
    let learner = GenvsLearner { network, data, settings };
    let plan = Plan { model: "genvs", score_name: "PSNR dB of one call", settings: &learner.settings, from };
    run::run(&learner, &plan, task)
}

/// Noisy pictures.
pub(super) struct Noisy {
    /// `[image][row][column][3]`.
    pub(super) pictures: Tensor,
    /// Noise level of each image.
    pub(super) at: Vec<Preconditioning>,
}

impl Noisy {
    /// `truth + level noise`, a level for each picture.
    pub(super) fn new(truth: &Tensor, levels: &[f32], draw: &Draw) -> Result<Noisy> {
        let noise: Vec<f32> = (0..truth.elem_count()).map(|index| draw.normal(Purpose::Noise, index)).collect();
        let noise = Tensor::from_vec(noise, truth.shape(), &Device::Cpu)?.to_dtype(truth.dtype())?;
        let pictures = (truth + noise.broadcast_mul(&each(levels.iter().copied(), truth)?)?)?;
        Ok(Noisy { pictures, at: levels.iter().map(|level| Preconditioning::at(*level)).collect() })
    }

    /// The network's target output: what its estimate lacks without it, over `c_out`; of variance 1 at most.
    fn target(&self, network: &Genvs, features: &Tensor, truth: &Tensor) -> Result<Tensor> {
        let without = network.without_network(&self.pictures, features, &self.at)?;
        (truth - without)?.broadcast_div(&each(self.at.iter().map(|at| at.output), truth)?)
    }
}

/// The noise levels of a step's pictures, of which this share has the largest.
fn levels(draw: &Draw, count: usize, share_of_largest: f32) -> Vec<f32> {
    let largest = NoiseSchedule::published().level(0, 2);
    let level = |index: usize| match draw.uniform(Purpose::NoiseLevel, 2 * index) < share_of_largest {
        true => largest,
        false => (LEVELS[0] + LEVELS[1] * draw.normal(Purpose::NoiseLevel, 2 * index + 1)).exp(),
    };
    (0..count).map(level).collect()
}

/// The loss of some views, with noise by `draw`, for this share of the pictures of the largest level.
pub(super) fn loss(
    network: &Genvs,
    views: &ObjectViews,
    weights: &Tensor,
    samples: &CoarseBlock,
    share_of_largest: f32,
    draw: &Draw,
) -> Result<Tensor> {
    let features = network.features(&network.volumes(&views.pictures)?, weights, views, samples)?;
    let noisy = Noisy::new(&views.truth, &levels(draw, views.truth.dim(0)?, share_of_largest), draw)?;
    let said = network.network(&noisy.pictures, &features, &noisy.at)?;
    let error = (said - noisy.target(network, &features, &views.truth)?)?.sqr()?.mean_all()?;
    let colour_error = (colours(&features)? - &views.truth)?.sqr()?.mean_all()?;
    error + (colour_error * FEATURES_WEIGHT)?
}

/// Mean PSNR over scenes of one call for noise of the largest level, and of the features' colours, with the weights
/// `weigh` of the views: the same views and noise every time, for any seed of the run.
pub(super) fn scores(
    network: &Genvs,
    scenes: &[TrainingScene],
    views: ViewCounts,
    sample_count: u32,
    weigh: &dyn Fn(&ObjectViews) -> Result<Tensor>,
) -> Result<[f64; 2]> {
    let count = VALIDATION_OBJECTS.min(scenes.len());
    let samples = CoarseBlock { seed: [0, 0], sample_count, jitter: 0.0 };
    let largest = NoiseSchedule::published().level(0, 2);
    let [mut score, mut colour_score] = [0.0, 0.0];
    for (index, object) in scenes[..count].iter().enumerate() {
        let draw = Draw { seed: 0, step: u32::MAX - index as u32 };
        let views = ObjectViews::of(&[object], &draw, views, network.parameters.dtype())?;
        let volumes = network.volumes(&views.pictures)?.detach();
        let features = network.features(&volumes, &weigh(&views)?, &views, &samples)?;
        let noise = Noisy::new(&views.truth.zeros_like()?, &[largest], &draw)?;
        let picture = network.denoised(&noise.pictures, &features, &noise.at)?;
        let score_of = |picture: &Tensor| decibels(&((picture - &views.truth)? * 0.5)?.sqr()?.mean_all()?);
        score += score_of(&picture.clamp(-1.0, 1.0)?)?;
        colour_score += score_of(&colours(&features)?.clamp(-1.0, 1.0)?)?;
    }
    Ok([score, colour_score].map(|sum| sum / count as f64))
}

impl Learner for GenvsLearner {
    fn parameters(&self) -> &Parameters {
        &self.network.parameters
    }

    fn data(&self) -> &Data {
        &self.data
    }

    fn loss(&self, draw: &Draw) -> Result<Tensor> {
        let GenvsSettings { objects, targets, samples, share_of_largest, ref augmentation, .. } = self.settings;
        let (sources, scheme) = augmentation.drawn(draw);
        let targets = if Targets::of(scheme) == Targets::One { 1 } else { targets };
        let views = ViewCounts { sources, targets };
        let views = ObjectViews::draw(&self.data.training, draw, objects, views, self.network.parameters.dtype())?;
        let samples = CoarseBlock { seed: [draw.seed as u32, draw.step], sample_count: samples, jitter: 1.0 };
        loss(&self.network, &views, &views.weights(scheme)?, &samples, share_of_largest, draw)
    }

    fn validate(&self) -> Result<Validated> {
        let views = ViewCounts { sources: SourceDraw::whole(VALIDATION_SOURCES), targets: 1 };
        let weigh = |views: &ObjectViews| views.weights(self.settings.augmentation.schemes[0]);
        let [score, colour_score] = scores(&self.network, &self.data.validation, views, self.settings.samples, &weigh)?;
        Ok(Validated { score, remark: format!("features {colour_score:.3} dB") })
    }

    fn checkpoint(&self) -> Result<Contents> {
        self.network.checkpoint()
    }
}
