//! What a field tells about its work: for the run record, and for comparing settings.

use serde::Serialize;

/// What a field tells about its work so far. Each field fills what it has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// What it left out.
    pub left_out: Vec<LeftOut>,
    /// How it went from noise to pictures.
    pub denoising: Option<Denoising>,
    /// Bytes that the run takes at most, beside photographs and pictures.
    pub memory_estimate: Option<u64>,
    /// The near and far bounds of its rays, world units.
    pub near_far: Option<[f32; 2]>,
}

/// Something that a field leaves out because a scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// What.
    pub what: &'static str,
    /// Whether it was allowed to.
    pub switch: bool,
    /// How much of it was left out.
    pub left_out: u64,
    /// Of how much in all.
    pub of: u64,
    /// What that can cost.
    pub cost: &'static str,
}

/// How a field went from noise to pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Denoising {
    /// The sampler.
    pub sampler: &'static str,
    /// How many noise levels a picture's run has; null where they are chosen on the way.
    pub levels: Option<u32>,
    /// The error that a step may make where levels are chosen on the way, root mean square of values between -1 and 1.
    pub tolerance: Option<f32>,
    /// The largest and the smallest noise level.
    pub noise: [f32; 2],
    /// Noise that is added on the way, over the whole run.
    pub churn: f32,
    /// A run ends where no value will change by more than this; null where it goes to the end.
    pub early_termination: Option<f32>,
    /// The level at which a picture starts from the one before; null where each starts from noise alone.
    pub reuse: Option<f32>,
    /// Calls of the denoiser that were made, for all pictures together.
    pub calls: u64,
    /// Calls that were planned and not made.
    pub saved_calls: u64,
}
