//! Cancels what would come too late.

use std::time::Instant;
use viewfuse_job::progress::Progress;

/// Reports to another progress, and cancels at a time.
pub(super) struct Deadline<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) end: Instant,
}

impl Progress for Deadline<'_> {
    fn warn(&self, warning: &str) {
        self.progress.warn(warning);
    }

    fn is_cancelled(&self) -> bool {
        Instant::now() >= self.end || self.progress.is_cancelled()
    }
}
