//! Fields: what there is at a point in space, from source views.
//!
//! A field turns prepared photographs into latents and latents into a target's picture. The renderer knows no more
//! about it than this trait; the weight-free field ([`photo`]) is the first, networks are further ones.
#![forbid(unsafe_code)]

pub mod family;
pub mod finite;
pub mod genvs;
pub mod learned;
pub mod photo;
pub mod pixelnerf;
pub mod render;

use finite::NotFinite;
use viewfuse_core::camera::Camera;
use viewfuse_device::{Device, DeviceError};
use viewfuse_job::progress::Interrupted;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::CheckpointError;
use viewfuse_nn::loader::LoadError;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Longest side of a picture whose size nobody asked for.
pub const LONGEST_DEFAULT_SIDE: u32 = 512;

/// Why a field could not make a picture.
#[derive(Debug, thiserror::Error)]
pub enum FieldError {
    /// The silhouettes have no point of space in common.
    #[error("no point lies inside all silhouettes of the sources")]
    NoObject,
    /// Rays are to end where they begin or before, or one of the two is no number.
    #[error("rays from depth {near} to depth {far} have nothing between their ends")]
    NoDepths {
        /// Where they begin.
        near: f32,
        /// Where they end.
        far: f32,
    },
    /// The device failed.
    #[error("the device failed")]
    Device(#[from] DeviceError),
    /// The network's parameters could not be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A number that is none came up inside.
    #[error(transparent)]
    NotFinite(#[from] NotFinite),
    /// The person stopped the work. Not transparent: whoever looks for the cause must find [`Interrupted`] itself.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

impl From<LoadError> for FieldError {
    fn from(error: LoadError) -> FieldError {
        match error {
            LoadError::Checkpoint(error) => FieldError::Checkpoint(error),
            LoadError::Device(error) => FieldError::Device(error),
        }
    }
}

/// A rendered target, values not yet rounded. Row-major, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Red, green, blue in `[0, 1]` and opacity.
    pub colours: Vec<[f32; 4]>,
    /// Depth along the principal axis in world units, 0 where nothing is met; empty for fields that know no depth.
    pub depths: Vec<f32>,
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
}

/// Something that a field leaves out because a scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
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
    pub settled: Option<f32>,
    /// The level at which a picture starts from the one before; null where each starts from noise alone.
    pub reuse: Option<f32>,
    /// Calls of the denoiser that were made, for all pictures together.
    pub calls: u64,
    /// Calls that were planned and not made.
    pub saved_calls: u64,
}

/// A field on a device.
pub trait Field<D: Device> {
    /// What depends on the photographs alone: shared by every weighting and every target.
    type Prepared;
    /// What depends on the weighting as well, but not on the target.
    type Latents;

    /// What the run record calls it.
    fn name(&self) -> &'static str;

    /// The least number of sources it can work with.
    fn least_sources(&self) -> usize;

    /// Longest side of the sources that it wants for pictures of this longest side.
    fn source_side(&self, picture_side: u32) -> u32 {
        picture_side
    }

    /// The longest side of its pictures where nobody asks for a size.
    fn longest_side(&self) -> u32 {
        LONGEST_DEFAULT_SIDE
    }

    /// What it left out so far.
    fn left_out(&self) -> Vec<LeftOut> {
        Vec::new()
    }

    /// How it went from noise to the pictures so far; `None` for fields that do not.
    fn denoising(&self) -> Option<Denoising> {
        None
    }

    /// Bytes that a run from sources of these widths and heights takes at most, beside photographs and pictures; `None`
    /// for fields that cannot tell.
    fn memory_estimate(&self, _device: &D, _source_sizes: &[[u32; 2]]) -> Option<u64> {
        None
    }

    /// Takes the photographs to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    fn prepare(
        &self,
        device: &D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Self::Prepared, FieldError>;

    /// Encodes the sources. `relevance[view]` are the weights of all sources for source `view` as a target, its own 0.
    ///
    /// # Errors
    /// [`FieldError`].
    fn encode(
        &self,
        device: &D,
        prepared: &Self::Prepared,
        relevance: &[SourceWeights],
        progress: &dyn Progress,
    ) -> Result<Self::Latents, FieldError>;

    /// Encodes what a target with these weights of the sources needs and no target before it needed, so that the time can
    /// be told apart from rendering, which does the same first. Nothing is left to do for a field that encodes all sources
    /// at once.
    ///
    /// # Errors
    /// [`FieldError`].
    fn encode_used(
        &self,
        _device: &D,
        _prepared: &Self::Prepared,
        _latents: &Self::Latents,
        _weights: &SourceWeights,
        _progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        Ok(())
    }

    /// Renders a target with the sources' weights for it. `settled` is the transmittance at which a ray may end early:
    /// no channel changes by more than that.
    ///
    /// # Errors
    /// [`FieldError`].
    #[allow(clippy::too_many_arguments)]
    fn render(
        &self,
        device: &D,
        prepared: &Self::Prepared,
        latents: &Self::Latents,
        weights: &SourceWeights,
        target: &Camera,
        settled: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError>;
}
