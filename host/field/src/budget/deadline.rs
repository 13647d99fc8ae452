//! Progress of what may be for nothing.

use std::time::Instant;
use viewfuse_job::progress::Progress;

/// Passes warnings on, but no pieces: what a search tries and checks is not the picture's progress. It may be cancelled
/// at a time, because it would come too late.
pub(super) struct Deadline<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) end: Option<Instant>,
}

impl Progress for Deadline<'_> {
    fn warn(&self, warning: &str) {
        self.progress.warn(warning);
    }

    fn is_cancelled(&self) -> bool {
        self.end.is_some_and(|end| Instant::now() >= end) || self.progress.is_cancelled()
    }
}
