//! Errors as Python exceptions, with the text that the command prints.

use pyo3::PyErr;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyOSError, PyValueError};
use std::error::Error as StdError;
use viewfuse::device::choice::UnknownDevice;
use viewfuse::evaluate::EvaluateError;
use viewfuse::evaluate::metrics::MetricError;
use viewfuse::field::FieldError;
use viewfuse::field::optimise::OptimiseError;
use viewfuse::field::options::OpenError;
use viewfuse::field::render::RenderError;
use viewfuse::job::files::WriteError;
use viewfuse::job::named::UnknownName;
use viewfuse::job::progress::Interrupted;
use viewfuse::nn::checkpoint::CheckpointError;
use viewfuse::pose::{PoseError, SolverError};
use viewfuse::scene::SceneError;
use viewfuse::scene::few_shot::SelectionError;
use viewfuse::scene::write::WriteSceneError;
use viewfuse::vulkan::VulkanError;
use viewfuse::weighting::WeightingError;
use viewfuse::weighting::attention::AttentionError;

pyo3::create_exception!(
    viewfuse,
    Error,
    PyException,
    "Work failed although its input was good: a device, for example."
);

/// Why a call failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input is at fault: `ValueError`.
    Input(String),
    /// A file could not be written: `OSError`.
    File(String),
    /// Something else: `viewfuse.Error`.
    Other(String),
    /// What a function of the caller raised.
    Raised(PyErr),
    /// The work was cancelled: `KeyboardInterrupt`.
    Interrupted,
}

/// The error with its causes, as the command prints it.
fn text(error: &(dyn StdError + 'static)) -> String {
    causes(error).map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

fn causes<'a>(error: &'a (dyn StdError + 'static)) -> impl Iterator<Item = &'a (dyn StdError + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Failure {
        if causes(&error).any(|cause| cause.is::<Interrupted>()) {
            return Failure::Interrupted;
        }
        match &error {
            RenderError::Field(FieldError::Device(_) | FieldError::NotFinite(_)) => Failure::Other(text(&error)),
            _ => Failure::Input(text(&error)),
        }
    }
}

impl From<EvaluateError> for Failure {
    fn from(error: EvaluateError) -> Failure {
        match error {
            EvaluateError::Render(error) => error.into(),
            EvaluateError::Metric(MetricError::Device(_) | MetricError::NotFinite(_)) => Failure::Other(text(&error)),
            error => Failure::Input(text(&error)),
        }
    }
}

impl From<OptimiseError> for Failure {
    fn from(error: OptimiseError) -> Failure {
        match error {
            OptimiseError::Render(error) => error.into(),
            OptimiseError::Write(error) => error.into(),
            error => Failure::Input(text(&error)),
        }
    }
}

impl From<PoseError> for Failure {
    fn from(error: PoseError) -> Failure {
        match error {
            _ if causes(&error).any(|cause| cause.is::<Interrupted>()) => Failure::Interrupted,
            PoseError::Render(error) => error.into(),
            PoseError::Solver(error @ SolverError::Broken { .. }) => Failure::Other(text(&error)),
            error => Failure::Input(text(&error)),
        }
    }
}

impl From<WriteSceneError> for Failure {
    fn from(error: WriteSceneError) -> Failure {
        match error {
            WriteSceneError::Interrupted(_) => Failure::Interrupted,
            WriteSceneError::Io { .. } => Failure::File(text(&error)),
            error => Failure::Input(text(&error)),
        }
    }
}

/// Errors that are always failures of one kind.
macro_rules! failures {
    ($($Kind:ident: $($Type:ty),+;)+) => {
        $($(impl From<$Type> for Failure {
            fn from(error: $Type) -> Failure {
                Failure::$Kind(text(&error))
            }
        })+)+
    };
}

failures! {
    Input: SceneError, SelectionError, WeightingError, AttentionError, UnknownDevice, UnknownName, CheckpointError,
        OpenError;
    Other: VulkanError;
    File: WriteError;
}

impl From<Interrupted> for Failure {
    fn from(_: Interrupted) -> Failure {
        Failure::Interrupted
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> PyErr {
        match failure {
            Failure::Input(text) => PyValueError::new_err(text),
            Failure::File(text) => PyOSError::new_err(text),
            Failure::Other(text) => Error::new_err(text),
            Failure::Raised(error) => error,
            Failure::Interrupted => PyKeyboardInterrupt::new_err(Interrupted.to_string()),
        }
    }
}
