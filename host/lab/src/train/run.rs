//! A training run: steps, validation, the saved state, and the files of its folder.
//!
//! ```text
//! state.safetensors   the state, for continuing
//! model.safetensors   the trained parameters (their moving average), written with the state
//! curve.svg           loss and validation over the steps; written with the record
//! curve.csv           the same as numbers
//! record.json         settings, times, scores; written at the start, after each validation and with the state
//! ```

use super::TrainError;
use super::adam::Adam;
use super::average::Average;
use super::curve;
use super::draw::Draw;
use super::parameters::{Contents, Parameters};
use super::scenes::{Data, STAGES};
use super::state::{self, Learned, Progressed};
use candle_core::Tensor;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;
use viewfuse_job::digest::sha256_of;
use viewfuse_job::files::{FolderLock, WriteError, check_writable, read_at_most, write_whole};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_nn::checkpoint::{Checkpoint, Precision};

/// Most bytes of a record that is read.
const LONGEST_RECORD: u64 = 64 << 20;

/// Length and learning rate of a run.
#[derive(Args, Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Schedule {
    /// Steps of the run
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) steps: u32,
    /// Learning rate; it rises over the first hundred steps and falls along a cosine
    #[arg(long, value_name = "RATE", default_value_t = 1.0e-3, value_parser = share::<f64>())]
    rate: f64,
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Steps from one validation to the next
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
    validate_every: u32,
    /// Seconds between writing the state
    // It changes no number.
    #[serde(skip)]
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser =
        number(|seconds: &f64| (0.0..=86_400.0).contains(seconds), "a number of seconds from 0 to 86400 is needed"))]
    write_every: f64,
}

/// What every run takes.
pub(crate) struct Task<'a> {
    pub(crate) schedule: &'a Schedule,
    /// Training and validation scenes.
    pub(crate) scenes: [&'a [PathBuf]; 2],
    pub(crate) folder: &'a Path,
    pub(crate) progress: &'a dyn Progress,
}

/// A parser of numbers: of those that fit. `needed` says which do.
pub(crate) fn number<T: FromStr>(
    fits: impl Fn(&T) -> bool + Clone,
    needed: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| text.parse().ok().filter(|number| fits(number)).ok_or_else(|| needed.to_owned())
}

/// A parser of numbers from 0 to 1.
pub(crate) fn share<T: FromStr + PartialOrd + From<u8>>() -> impl Fn(&str) -> Result<T, String> + Clone {
    number(|share: &T| (T::from(0)..=T::from(1)).contains(share), "a number from 0 to 1 is needed")
}

/// A parser of the numbers of a step.
pub(crate) fn count() -> impl Fn(&str) -> Result<usize, String> + Clone {
    number(|count: &usize| (1..=1024).contains(count), "a whole number from 1 to 1024 is needed")
}

/// A parser of the sides of pictures.
pub(crate) fn side() -> impl Fn(&str) -> Result<u32, String> + Clone {
    let fits = |side: &u32| (1..=1024).contains(side) && side.is_multiple_of(16);
    number(fits, "a multiple of 16 from 16 to 1024 is needed")
}

/// Names of files in the folder of a run.
const CURVE: &str = "curve.svg";
const NUMBERS: &str = "curve.csv";
const RECORD: &str = "record.json";

/// Steps over which the rate rises.
const WARM_UP: u32 = 100;
/// Share of the rate that the run ends with.
const LAST_RATE: f64 = 0.03;
/// Steps from one point of the loss curve to the next.
const LOSS_EVERY: u32 = 50;
/// Largest norm of a gradient.
const MAX_GRADIENT: f64 = 1.0;
/// Decay of the parameters' average at each step.
const AVERAGING: f64 = 0.999;

impl Schedule {
    /// Learning rate of a step.
    fn rate_at(&self, step: u32) -> f64 {
        let rising = f64::from(step + 1) / f64::from(WARM_UP);
        let done = f64::from(step) / f64::from(self.steps.max(1));
        let falling = LAST_RATE + (1.0 - LAST_RATE) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        self.rate * rising.min(falling)
    }
}

/// A trainable model.
pub(crate) trait Learner {
    fn parameters(&self) -> &Parameters;

    /// What it learns from, and is validated on.
    fn data(&self) -> &Data;

    /// The loss of a step.
    fn loss(&self, draw: &Draw) -> candle_core::Result<Tensor>;

    /// Its score on validation data; higher is better.
    fn validate(&self) -> candle_core::Result<Validated>;

    /// Its checkpoint: tensors and metadata.
    fn checkpoint(&self) -> candle_core::Result<Contents>;
}

/// The result of validation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Validated {
    pub(crate) score: f64,
    /// A remark for the log.
    pub(crate) remark: String,
}

/// The outcome of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// The trained parameters.
    pub(crate) model: PathBuf,
    /// Seconds of all steps, those of earlier parts of the run included.
    pub(crate) seconds: f64,
    /// Step and score of every validation.
    pub(crate) scores: Vec<(u32, f64)>,
}

/// What a run is, besides its [`Task`].
pub(crate) struct Plan<'a, S> {
    pub(crate) model: &'static str,
    pub(crate) score_name: &'static str,
    pub(crate) settings: &'a S,
    pub(crate) from: Option<&'a Checkpoint>,
}

impl<S: Serialize> Plan<'_, S> {
    /// The inputs that a run's numbers depend on: a run continues only if all of them are the same. Files are
    /// identified by their content, not by their path.
    fn record(&self, schedule: &Schedule, data: &Data) -> Result<serde_json::Value, TrainError> {
        let digest = |checkpoint: &Checkpoint| {
            let path = checkpoint.path();
            sha256_of(path).map_err(|cause| TrainError::Checkpoint {
                path: path.to_path_buf(),
                reason: format!("cannot be read: {cause}"),
            })
        };
        let checkpoint = self.from.map(digest).transpose()?;
        Ok(serde_json::json!({
            "model": self.model, "settings": self.settings, "schedule": schedule, "checkpoint": checkpoint,
            "scenes": data.training.len(), "validation_scenes": data.validation.len(), "data": data.digest(),
        }))
    }
}

/// Trains, or continues, until all steps are done. On cancellation it writes its state first. No other process writes to
/// the folder meanwhile.
pub(crate) fn run<S: Serialize>(
    learner: &dyn Learner,
    plan: &Plan<'_, S>,
    &Task { schedule, folder, progress, .. }: &Task<'_>,
) -> Result<Outcome, TrainError> {
    let settings = &plan.record(schedule, learner.data())?;
    let run = Run { learner, schedule, settings, score_name: plan.score_name, folder };
    std::fs::create_dir_all(folder).map_err(|cause| WriteError::Io { path: folder.to_path_buf(), cause })?;
    let _lock = FolderLock::take(folder)?;
    for file in [run.state(), run.model(), folder.join(CURVE), folder.join(NUMBERS), folder.join(RECORD)] {
        check_writable(&file)?;
    }
    let average = Average::new(learner.parameters(), AVERAGING)?;
    let learned = Learned { parameters: learner.parameters(), adam: Adam::new(learner.parameters())?, average };
    let found = state::read(&run.state(), settings, &learned)?;
    // An empty state is of a machine that lost its power: the record says whether it was this run's.
    if found.is_none() && !(run.state().exists() && run.is_recorded()) {
        let files = [run.model(), folder.join(CURVE), folder.join(NUMBERS), folder.join(RECORD)];
        if let Some(file) = files.into_iter().find(|file| file.exists()) {
            return Err(TrainError::NoState(file));
        }
    }
    let is_new = found.is_none();
    if is_new && run.state().exists() {
        let state = run.state();
        progress.warn(&format!("{}: is empty, as a loss of power leaves it: the run begins anew", state.display()));
    }
    let mut so_far = found.unwrap_or_default();
    if let Some((step, planned)) = so_far.extended.last().filter(|(step, _)| *step == so_far.steps) {
        progress.note(&format!(
            "goes on at step {step} of a run of {planned}: from here the rate is that of {} steps",
            schedule.steps
        ));
    }
    if is_new {
        // From here on this folder is this run's: another one does not begin in it.
        state::write(&run.state(), settings, &so_far, &learned)?;
    }
    run.tell(&so_far)?;
    progress.stage("training", 1..STAGES, STAGES);
    progress.expect(schedule.steps.saturating_sub(so_far.steps) as usize);
    let mut written = Instant::now();
    while so_far.steps < schedule.steps {
        if progress.is_cancelled() {
            run.write(&so_far, &learned)?;
            progress.check()?;
        }
        let start = Instant::now();
        let step = so_far.steps;
        let loss = learner.loss(&Draw { seed: schedule.seed, step })?;
        let value = f64::from(loss.to_dtype(candle_core::DType::F32)?.to_scalar::<f32>()?);
        let not_finite = |what: &str| TrainError::NotFinite { step, what: what.to_owned() };
        if !value.is_finite() {
            return Err(not_finite("loss"));
        }
        let rate = schedule.rate_at(step);
        if !learned.adam.step(learner.parameters(), &loss.backward()?, step, rate, MAX_GRADIENT)? {
            return Err(not_finite("gradient"));
        }
        learned.average.step(learner.parameters(), step)?;
        so_far.steps += 1;
        so_far.pending = (so_far.pending.0 + value, so_far.pending.1 + 1);
        if so_far.steps % LOSS_EVERY == 0 {
            so_far.losses.push((so_far.steps, so_far.pending.0 / f64::from(so_far.pending.1)));
            so_far.pending = (0.0, 0);
        }
        if so_far.steps % schedule.validate_every == 0 || so_far.steps == schedule.steps {
            let Validated { score, remark } = learned.as_written(|| learner.validate())?;
            if !score.is_finite() {
                return Err(not_finite("validation score"));
            }
            so_far.scores.push((so_far.steps, score));
            progress.note(&run.status(&so_far, &remark));
            run.tell(&so_far)?;
        }
        so_far.seconds += start.elapsed().as_secs_f64();
        progress.status(&format!("step {}, {}", so_far.steps, run.values(&so_far)));
        progress.step();
        if written.elapsed().as_secs_f64() > schedule.write_every {
            run.write(&so_far, &learned)?;
            written = Instant::now();
        }
    }
    run.write(&so_far, &learned)?;
    Ok(Outcome { model: run.model(), seconds: so_far.seconds, scores: so_far.scores })
}

struct Run<'a> {
    learner: &'a dyn Learner,
    schedule: &'a Schedule,
    settings: &'a serde_json::Value,
    score_name: &'a str,
    folder: &'a Path,
}

impl Run<'_> {
    fn state(&self) -> PathBuf {
        self.folder.join("state.safetensors")
    }

    fn model(&self) -> PathBuf {
        self.folder.join("model.safetensors")
    }

    /// Whether the folder's record is of this run, however long that was to be.
    fn is_recorded(&self) -> bool {
        let record = read_at_most(&self.folder.join(RECORD), LONGEST_RECORD).ok();
        let record: Option<serde_json::Value> = record.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let without_steps = |settings: &serde_json::Value| {
            let mut settings = settings.clone();
            settings.pointer_mut(state::STEPS).into_iter().for_each(|steps| *steps = serde_json::Value::Null);
            settings
        };
        record.is_some_and(|record| {
            record.get("settings").is_some_and(|settings| without_steps(settings) == without_steps(self.settings))
        })
    }

    fn status(&self, so_far: &Progressed, remark: &str) -> String {
        let remark = if remark.is_empty() { String::new() } else { format!(", {remark}") };
        format!("step {}: {}{remark}, {:.0} s", so_far.steps, self.values(so_far), so_far.seconds)
    }

    /// The last loss and the last score, as far as there are any.
    fn values(&self, so_far: &Progressed) -> String {
        // The mean since the last point of the curve, or that point.
        let (sum, count) = so_far.pending;
        let pending = (count > 0).then(|| sum / f64::from(count));
        let loss = so_far.losses.last().map(|(_, loss)| *loss).or(pending).map(|loss| format!("loss {loss:.5}"));
        let score = so_far.scores.last().map(|(_, score)| format!("{} {score:.3}", self.score_name));
        [loss, score].into_iter().flatten().collect::<Vec<_>>().join(", ")
    }

    /// The state is written last, so that all other files exist when a run continues from it.
    fn write(&self, so_far: &Progressed, learned: &Learned<'_>) -> Result<(), TrainError> {
        let (tensors, metadata) = learned.as_written(|| self.learner.checkpoint())?;
        let model = self.model();
        Checkpoint::in_memory(&model.display().to_string(), tensors, metadata).write_safetensors(
            &model,
            Precision::Kept,
            &Silent,
        )?;
        self.tell(so_far)?;
        state::write(&self.state(), self.settings, so_far, learned)
    }

    /// Writes the curves and the record.
    fn tell(&self, so_far: &Progressed) -> Result<(), TrainError> {
        write_whole(&self.folder.join(CURVE), curve::svg(so_far, self.score_name).as_bytes())?;
        write_whole(&self.folder.join(NUMBERS), curve::csv(so_far, self.score_name).as_bytes())?;
        let mut record = serde_json::json!({
            "program": concat!("viewfuse ", env!("CARGO_PKG_VERSION")),
            "settings": self.settings,
            "steps": so_far.steps,
            "steps_planned": self.schedule.steps,
            "seconds": so_far.seconds,
            "losses": so_far.losses,
            "score": self.score_name,
            "scores": so_far.scores,
        });
        if !so_far.extended.is_empty() {
            record["extended"] = serde_json::json!(so_far.extended);
        }
        Ok(write_whole(&self.folder.join(RECORD), format!("{record:#}\n").as_bytes())?)
    }
}
