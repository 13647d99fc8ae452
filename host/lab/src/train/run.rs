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
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use viewfuse_job::digest::sha256_of;
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_nn::checkpoint::{Checkpoint, Precision};

/// Length and learning rate of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Schedule {
    /// Steps of the run.
    pub steps: u32,
    /// Learning rate after the first hundred steps, over which it rises; from there it falls along a cosine to
    /// 3 % of it.
    pub rate: f64,
    /// Seed of every random draw.
    pub seed: u64,
    /// Steps from one validation to the next.
    pub validate_every: u32,
    /// Seconds between writing the state; changes no number.
    #[serde(skip)]
    pub write_every: f64,
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
    /// Refuses numbers with which nothing would be learned, or never written.
    fn check(&self) -> Result<(), TrainError> {
        let Schedule { rate, write_every, .. } = *self;
        if !(0.0..=1.0).contains(&rate) {
            return Err(TrainError::Setting { name: "rate", value: rate, allowed: "it must be from 0 to 1" });
        }
        if !(write_every >= 0.0) {
            let allowed = "it must be at least 0 seconds";
            return Err(TrainError::Setting { name: "write_every", value: write_every, allowed });
        }
        Ok(())
    }

    /// Learning rate of a step.
    pub fn rate_at(&self, step: u32) -> f64 {
        let rising = f64::from(step + 1) / f64::from(WARM_UP);
        let done = f64::from(step) / f64::from(self.steps.max(1));
        let falling = LAST_RATE + (1.0 - LAST_RATE) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        self.rate * rising.min(falling)
    }
}

/// The inputs that a run's numbers depend on: a run continues only if all of them are the same. Files are identified by
/// their content, not by their path.
pub(crate) fn settings(
    model: &str,
    own: &impl Serialize,
    schedule: &Schedule,
    data: &Data,
    checkpoint: Option<&Checkpoint>,
) -> Result<serde_json::Value, TrainError> {
    let unreadable = |path: &Path, cause: &std::io::Error| TrainError::Checkpoint {
        path: path.to_path_buf(),
        reason: format!("cannot be read: {cause}"),
    };
    let digest = |path: &Path| sha256_of(path).map_err(|cause| unreadable(path, &cause));
    let checkpoint = checkpoint.map(|checkpoint| digest(checkpoint.path())).transpose()?;
    Ok(serde_json::json!({
        "model": model, "settings": own, "schedule": schedule, "checkpoint": checkpoint,
        "scenes": data.training.len(), "validation_scenes": data.validation.len(), "data": data.digest(),
    }))
}

/// A trainable model.
pub(crate) trait Learner {
    /// Its parameters.
    fn parameters(&self) -> &Parameters;

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
pub struct Outcome {
    /// The trained parameters.
    pub model: PathBuf,
    /// Seconds of all steps, those of earlier parts of the run included.
    pub seconds: f64,
    /// Step and score of every validation.
    pub scores: Vec<(u32, f64)>,
}

/// Trains, or continues, until all steps are done. On cancellation it writes its state first.
pub(crate) fn run(
    learner: &dyn Learner,
    schedule: &Schedule,
    settings: &serde_json::Value,
    score_name: &str,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Outcome, TrainError> {
    schedule.check()?;
    let run = Run { learner, schedule, settings, score_name, folder };
    for file in [run.state(), run.model(), folder.join(CURVE), folder.join(NUMBERS), folder.join(RECORD)] {
        check_writable(&file)?;
    }
    let average = Average::new(learner.parameters(), AVERAGING)?;
    let learned = Learned { parameters: learner.parameters(), adam: Adam::new(learner.parameters())?, average };
    let mut so_far = state::read(&run.state(), settings, &learned)?.unwrap_or_default();
    if let Some((step, planned)) = so_far.extended.last().filter(|(step, _)| *step == so_far.steps) {
        progress.note(&format!(
            "goes on at step {step} of a run of {planned}: from here the rate is that of {} steps",
            schedule.steps
        ));
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
        if !value.is_finite() {
            return Err(TrainError::NotFinite { step, what: "loss".to_owned() });
        }
        let rate = schedule.rate_at(step);
        learned.adam.step(learner.parameters(), &loss.backward()?, step, rate, MAX_GRADIENT)?;
        learned.average.step(learner.parameters(), step)?;
        so_far.steps += 1;
        so_far.pending = (so_far.pending.0 + value, so_far.pending.1 + 1);
        if so_far.steps % LOSS_EVERY == 0 {
            so_far.losses.push((so_far.steps, so_far.pending.0 / f64::from(so_far.pending.1)));
            so_far.pending = (0.0, 0);
        }
        if so_far.steps % schedule.validate_every == 0 || so_far.steps == schedule.steps {
            let Validated { score, remark } = learned.as_written(|| learner.validate())?;
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
        Checkpoint::in_memory("trained", tensors, metadata).write_safetensors(
            &self.model(),
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
