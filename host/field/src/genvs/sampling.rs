//! From noise to a picture: the driver of the samplers in [`viewfuse_core::sampler`], for any device and any denoiser.
//!
//! A denoiser is a function from a noisy picture and its level to the picture that it believes is behind; a call of it is
//! what costs. The state is in `f32` (`tests/numerics/sampler.rs` measures what that costs against `f64`).
//!
//! ```text
//! plan    which sampler, which levels, which noise       Plan, Steps
//! run     one picture on its way                         buffers, calls, what is known of earlier calls
//! ```

mod plan;
mod run;

pub use plan::{Plan, Steps};

use super::super::FieldError;
use run::Run;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;

/// What a run starts from.
pub enum Start<'a, D: Device> {
    /// Noise of the plan's seed.
    Noise,
    /// Noise that is given: numbers of variance 1, which are multiplied by the largest level.
    Latents(&'a D::Buffer<f32>),
    /// A picture with noise of the plan's seed: that of an earlier frame of the same orbit, say.
    Picture {
        /// Its values, as many as the run's picture has.
        picture: &'a D::Buffer<f32>,
        /// The level to start at: as large as what may be different. Levels above it are left out.
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

/// What a run made.
pub struct Sampled<D: Device> {
    /// The picture: what the denoiser said last.
    pub picture: D::Buffer<f32>,
    /// The levels at which the denoiser was called, in the order of the calls.
    pub levels: Vec<f32>,
    /// How many calls of those that were planned were left out, because of an earlier picture or because nothing changed
    /// any more. Where levels are chosen on the way no number is planned, and this is 0.
    pub left_out: u32,
}

impl<D: Device> Sampled<D> {
    /// How often the denoiser was called.
    pub fn call_count(&self) -> u32 {
        u32::try_from(self.levels.len()).unwrap_or(u32::MAX)
    }
}

/// What running a plan can end with.
/// Makes a picture of `element_count` values. `denoise(state, level, denoised)` writes what it believes is behind a noisy
/// picture at a level. The noise is that of the plan's seed, the same on every device; progress counts calls. Between calls
/// the run can be interrupted.
///
/// # Errors
/// [`FieldError::NotFinite`] if the denoiser gives NaN or infinity, [`FieldError::Interrupted`], and what `denoise`
/// gives.
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
