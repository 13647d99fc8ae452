//! What a field may leave out of its work, and the record of what it left out: for the run record, and for comparing
//! settings.

use serde::Serialize;

/// The record of a field's work so far. Each field fills in what applies to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Its omissions.
    pub left_out: Vec<LeftOut>,
    /// Its diffusion sampling.
    pub denoising: Option<Denoising>,
    /// The most bytes that the run takes, beside photographs and pictures.
    pub memory_estimate: Option<u64>,
    /// The near and far bounds of its rays, world units.
    pub near_far: Option<[f32; 2]>,
    /// What else is to be known of the run, each in one sentence.
    pub notes: Vec<String>,
}

/// An omission: a part of the work that an effort leaves out where a scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Omission {
    /// Its name, with which `--compute` switches it off.
    pub name: &'static str,
    /// The kind of work.
    pub what: &'static str,
    /// Which part of this work, for example "in empty space".
    pub part: &'static str,
    /// Its typical error.
    pub typical_error: &'static str,
}

/// The omission of every field that encodes a view when a target first uses it.
pub const VIEWS: Omission =
    Omission { name: "views", what: "encoded views", part: "that no target uses", typical_error: "nothing" };

impl Omission {
    /// The record of so many omitted units of all.
    pub fn left_out(&self, switch: bool, left_out: u64, of: u64) -> LeftOut {
        LeftOut { what: self.what, switch, left_out, of, typical_error: self.typical_error }
    }
}

/// How much of a kind of work was left out: its share of the time is near `left_out / of` of that of this work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The kind of work.
    pub what: &'static str,
    /// Whether it is switched on.
    pub switch: bool,
    /// Omitted units.
    pub left_out: u64,
    /// All units.
    pub of: u64,
    /// The typical error.
    pub typical_error: &'static str,
}

/// The diffusion sampling of a field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Denoising {
    /// The sampler.
    pub sampler: &'static str,
    /// Noise levels of a picture's run; null for adaptive levels.
    pub levels: Option<u32>,
    /// The largest error of a step of adaptive levels, root mean square of values between -1 and 1.
    pub tolerance: Option<f32>,
    /// The largest and the smallest noise level.
    pub noise: [f32; 2],
    /// Noise that is added between steps (churn), over the whole run.
    pub churn: f32,
    /// A run stops when no value will change by more than this; null without an early stop.
    pub early_termination: Option<f32>,
    /// The noise level at which a picture starts from the one before; null where each starts from noise alone.
    pub reuse: Option<f32>,
    /// Calls of the denoiser that were made, for all pictures together.
    pub calls: u64,
    /// Calls that were planned and not made.
    pub saved_calls: u64,
}
