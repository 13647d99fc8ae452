//! Diffusion sampling: the driver of the samplers in [`viewfuse_core::sampler`], for any device and any denoiser.
//!
//! A denoiser is a function from a noisy picture and its level to an estimate of the picture; its calls take nearly all
//! the time. The state is in `f32` (`tests/numerics/sampler/errors.rs` measures the error against `f64`).
//!
//! ```text
//! plan    sampler, noise levels, noise, seed             Plan, Steps
//! run     the run for one picture                        buffers, calls, results of earlier calls
//! ```

mod plan;
mod run;

pub use plan::{Plan, Steps};

use super::super::FieldError;
use run::Run;
pub(super) use run::root_mean_square;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;

/// The start of a run.
pub enum Start<'a, D: Device> {
    /// Noise of the plan's seed.
    Noise,
    /// Given noise: numbers of variance 1, which are multiplied by the largest level.
    Latents(&'a D::Buffer<f32>),
    /// A picture with noise of the plan's seed: for example an earlier frame of the same orbit.
    Picture {
        /// The picture's values, as many as the run's picture has.
        picture: &'a D::Buffer<f32>,
        /// The noise level to start at: about the size of the expected differences. Levels above it are left out.
        level: f32,
    },
}

impl<D: Device> Start<'_, D> {
    /// The level above which levels are left out.
    fn highest(&self) -> f32 {
        match self {
            Start::Picture { level, .. } => *level,
            Start::Noise | Start::Latents(_) => f32::INFINITY,
        }
    }
}

/// The result of a run.
pub struct Sampled<D: Device> {
    /// The picture: the last result of the denoiser.
    pub picture: D::Buffer<f32>,
    /// The levels at which the denoiser was called, in the order of the calls.
    pub levels: Vec<f32>,
    /// The planned calls that were left out, because of an earlier picture or because the picture did not change any
    /// more. With adaptive levels no number is planned, and this is 0.
    pub left_out: u32,
    /// How little the steps over levels may have erred.
    pub accuracy: Accuracy,
}

/// What a run over levels tells of its error without further calls. Root mean squares over the values, 0 where there
/// are none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// The steps' differences from steps by one result less (embedded solutions of two orders): the root of their
    /// squares' sum. 0 without [`Plan::compares_orders`].
    pub steps: f32,
    /// What the last call changed in the picture.
    pub last_change: f32,
}

impl<D: Device> Sampled<D> {
    /// The number of calls of the denoiser.
    pub fn call_count(&self) -> u32 {
        u32::try_from(self.levels.len()).unwrap_or(u32::MAX)
    }
}

/// The outcome of running a plan. Computes a picture of `element_count` values. `denoise(state, level, denoised)`
/// writes the estimate of the picture behind a noisy one at a level. The noise is that of the plan's seed, the same on
/// every device; progress counts calls. Between calls the run can be cancelled.
///
/// # Errors
/// [`FieldError::NotFinite`] if the denoiser gives NaN or infinity, [`FieldError::Interrupted`], and the errors of
/// `denoise`.
pub fn sample<D: Device>(
    device: &D,
    plan: &Plan,
    element_count: usize,
    start: Start<'_, D>,
    progress: &dyn Progress,
    denoise: impl FnMut(&D::Buffer<f32>, f32, &mut D::Buffer<f32>) -> Result<(), FieldError>,
) -> Result<Sampled<D>, FieldError> {
    let run = Run::new(device, plan, element_count, progress, denoise);
    match plan.steps {
        Steps::Fixed { sampler, level_count } => run.over_levels(sampler, level_count.max(1), start),
        Steps::Chosen { tolerance, most_calls } => run.by_tolerance(tolerance, most_calls, start),
    }
}
