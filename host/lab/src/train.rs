//! Training: networks from scratch, and the weighting of views for a fixed network.
//!
//! Gradients are computed by candle. This crate has the networks' graphs, a few operations of the published networks
//! that candle lacks or computes slowly (`operations`), and a run that can be killed at any time and continued. Every
//! random draw is a function of the run's seed and the step (`draw`), and sums run in one order: an interrupted run
//! gives the same numbers as an uninterrupted one.
//!
//! ```text
//! scenes       pictures and cameras in memory            TrainingScene
//! draw         random numbers of a step                  Draw
//! weights      of a batch's views, by a scheme           of_scheme
//! batch        sources and target rays of a step         Batch
//! augmentation      what differs from step to step            Augmentation
//! operations   gradients of our own kernels              Convolution, PointNetwork, MarchVolumes
//! parameters   trained parameters                        Parameters
//! images, compositing     parts of the graphs
//! pixelnerf, genvs        networks as graphs             PixelNerf, Genvs
//! attention    weighting of views as a graph             Attention
//! adam, average           the optimiser
//! state, curve            the saved state of a run, and its curves
//! run          steps, validation, continuing             run, Settings
//! pixelnerf_learner, genvs_learner, weighting_learner      losses
//! ```
#![forbid(unsafe_code)]

mod adam;
mod attention;
mod augmentation;
mod average;
mod batch;
mod compositing;
mod curve;
mod draw;
mod genvs;
mod genvs_learner;
#[cfg(test)]
mod gradient_check;
mod images;
mod operations;
mod parameters;
mod pixelnerf;
mod pixelnerf_learner;
mod run;
mod scenes;
mod state;
mod weighting_learner;
mod weights;

pub use attention::Embedding;
pub use augmentation::Augmentation;
pub use genvs_learner::{GenvsSettings, MAX_LEVEL_SHARE, train_genvs};
pub use pixelnerf_learner::{PixelNerfSettings, train_pixelnerf};
pub use run::{Outcome, Schedule};
pub use state::check_state;
pub use weighting_learner::{WeightingSettings, train_weighting};

use std::path::PathBuf;
use viewfuse_core::camera::PinholeError;
use viewfuse_job::files::WriteError;
use viewfuse_job::progress::Interrupted;
use viewfuse_nn::checkpoint::CheckpointError;
use viewfuse_scene::SceneError;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Why training failed.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A scene could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Training takes square pictures.
    #[error("{}: view '{view}' is {width}x{height}; training takes square pictures", path.display())]
    NotSquare {
        /// The scene.
        path: PathBuf,
        /// The view.
        view: String,
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
    },
    /// A scene has too few views for sources and a target view.
    #[error("{}: has {view_count} photographs; {least_views} are needed, for the sources and a target", path.display())]
    FewViews {
        /// The scene.
        path: PathBuf,
        /// Its photographs.
        view_count: usize,
        /// How many are needed.
        least_views: usize,
    },
    /// A setting is out of its range.
    #[error("the setting {name} is {value}; {allowed}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// There are no scenes.
    #[error("there are no scenes to {purpose}")]
    NoScenes {
        /// Their purpose.
        purpose: &'static str,
    },
    /// The size of the pictures is invalid.
    #[error("{}: cannot be resampled: {error}", path.display())]
    Pinhole {
        /// The scene.
        path: PathBuf,
        /// The problem.
        error: PinholeError,
    },
    /// A checkpoint could not be read.
    #[error(transparent)]
    Parameters(#[from] CheckpointError),
    /// A checkpoint cannot be used for training.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// The folder holds a run with other settings.
    #[error("{}: holds a run with other settings: {difference}; give another folder, or the same settings to continue", path.display())]
    OtherRun {
        /// The file with the run's state.
        path: PathBuf,
        /// The difference.
        difference: String,
    },
    /// The run's state is invalid.
    #[error("{}: is not the state of a training run: {reason}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// The loss or a parameter became NaN or infinite.
    #[error("step {step}: the {what} is not finite; the state before it is kept")]
    NotFinite {
        /// The step.
        step: u32,
        /// The value that is not finite.
        what: String,
    },
    /// An output could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The library of automatic differentiation reported an error.
    #[error("the training graph: {0}")]
    Graph(#[from] candle_core::Error),
    /// The work was cancelled.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
