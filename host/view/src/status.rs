//! What is being done, for the page: the stage of the work and the warnings.

use serde::Serialize;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most warnings that are kept.
const MAX_WARNINGS: usize = 20;

/// What is being done.
#[derive(Debug, Default)]
pub(crate) struct Status(Mutex<StageStatus>);

#[derive(Clone, Debug, Default, Serialize)]
struct StageStatus {
    /// What is being done; empty while nothing is.
    stage: &'static str,
    done: usize,
    /// So many pieces in all; 0 if that is not known.
    pieces: usize,
    warnings: Vec<String>,
    /// The scheme that was chosen for the scene, once it is.
    chosen: Option<String>,
    /// Of a video that is made the frames that are there, and all.
    video: Option<[usize; 2]>,
}

impl Status {
    /// No work is done while it is held, so it cannot be poisoned.
    fn shown(&self) -> MutexGuard<'_, StageStatus> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn begin(&self, stage: &'static str) {
        let mut shown = self.shown();
        (shown.stage, shown.done, shown.pieces) = (stage, 0, 0);
    }

    pub(crate) fn expect(&self, pieces: usize) {
        self.shown().pieces += pieces;
    }

    pub(crate) fn step(&self) {
        self.shown().done += 1;
    }

    /// Each warning is kept once.
    pub(crate) fn warn(&self, warning: &str) {
        let mut shown = self.shown();
        if shown.warnings.len() < MAX_WARNINGS && !shown.warnings.iter().any(|known| known == warning) {
            shown.warnings.push(warning.to_owned());
        }
    }

    /// The scheme for the scene is known.
    pub(crate) fn choose(&self, scheme: String) {
        self.shown().chosen = Some(scheme);
    }

    /// How far a video is; `None` once there is none.
    pub(crate) fn film(&self, frames: Option<[usize; 2]>) {
        self.shown().video = frames;
    }

    pub(crate) fn json(&self) -> Vec<u8> {
        serde_json::to_vec(&*self.shown()).unwrap_or_default()
    }
}
