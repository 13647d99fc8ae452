//! Why a field could not make a picture.

use std::error::Error;
use viewfuse_device::DeviceError;
use viewfuse_job::progress::Interrupted;
use viewfuse_nn::checkpoint::CheckpointError;
use viewfuse_nn::loader::LoadError;

/// A tensor has an element that is NaN or infinite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{stage}: element {index} of the {tensor} is {}not a finite number", known(*value))]
pub struct NotFinite {
    /// The stage.
    pub stage: String,
    /// The stage's result.
    pub tensor: String,
    /// Index of the first such element, flat.
    pub index: usize,
    /// Its value; NaN also where only its place is known.
    pub value: f32,
}

/// The visual hull of the silhouettes is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the silhouettes of the sources have no common object: no point lies inside all of them; check the poses and the \
     background"
)]
pub struct NoObject;

/// A value in front of what it is not.
fn known(value: f32) -> String {
    if value.is_nan() { String::new() } else { format!("{value}, ") }
}

/// Why a field could not make a picture.
#[derive(Debug, thiserror::Error)]
pub enum FieldError {
    /// The field cannot use these sources or settings, for a reason of its own: [`FieldError::unsuitable`].
    #[error(transparent)]
    Unsuitable(Box<dyn Error + Send + Sync>),
    /// The device failed.
    #[error("the device failed")]
    Device(#[from] DeviceError),
    /// The network's parameters could not be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A stage produced a value that is NaN or infinite.
    #[error(transparent)]
    NotFinite(#[from] NotFinite),
    /// The work was cancelled. Not transparent, so that a search through the causes finds [`Interrupted`] itself.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

impl FieldError {
    /// From a field's own error.
    pub fn unsuitable(reason: impl Into<Box<dyn Error + Send + Sync>>) -> FieldError {
        FieldError::Unsuitable(reason.into())
    }

    /// Whether the field's own error is of this type.
    pub fn is<E: Error + 'static>(&self) -> bool {
        matches!(self, FieldError::Unsuitable(reason) if reason.is::<E>())
    }
}

impl From<LoadError> for FieldError {
    fn from(error: LoadError) -> FieldError {
        match error {
            LoadError::Checkpoint(error) => FieldError::Checkpoint(error),
            LoadError::Device(error) => FieldError::Device(error),
        }
    }
}
