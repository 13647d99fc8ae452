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

pub(crate) use augmentation::Augmentation;
pub(crate) use genvs_learner::{GenvsSettings, train_genvs};
pub(crate) use pixelnerf_learner::{PixelNerfSettings, train_pixelnerf};
pub(crate) use run::{Outcome, Schedule, Task, side};
pub use state::check_state;
pub(crate) use weighting_learner::{WeightingSettings, train_weighting};

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
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("{}: view '{view}' is {width}x{height}; training takes square pictures", path.display())]
    NotSquare { path: PathBuf, view: String, width: u32, height: u32 },
    #[error("{}: has {view_count} photographs; {least_views} are needed, for the sources and a target", path.display())]
    FewViews { path: PathBuf, view_count: usize, least_views: usize },
    #[error("the setting {name} is {value}; {allowed}")]
    Setting { name: &'static str, value: f64, allowed: &'static str },
    #[error("there are no scenes to {purpose}")]
    NoScenes { purpose: &'static str },
    #[error("{}: cannot be resampled: {error}", path.display())]
    Pinhole { path: PathBuf, error: PinholeError },
    #[error(transparent)]
    Parameters(#[from] CheckpointError),
    #[error("{}: {reason}", path.display())]
    Checkpoint { path: PathBuf, reason: String },
    #[error("{}: holds a run with other settings: {difference}; give another folder, or the same settings to \
        continue", path.display())]
    OtherRun { path: PathBuf, difference: String },
    #[error("{}: is not the state of a training run: {reason}", path.display())]
    State { path: PathBuf, reason: String },
    #[error("step {step}: the {what} is not finite; the state that was written last is kept")]
    NotFinite { step: u32, what: String },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the training graph: {0}")]
    Graph(#[from] candle_core::Error),
    /// A file that a run writes is there, and no state from which its training could go on.
    #[error(
        "{}: is there, and no state.safetensors to continue its training from; move it, or give another folder",
        .0.display()
    )]
    NoState(PathBuf),
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
