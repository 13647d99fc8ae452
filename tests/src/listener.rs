//! A caller of long work that remembers what it was told and stops the work after so many questions.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use viewfuse::job::progress::Progress;

/// Without a limit (the default) it stops nothing.
#[derive(Default)]
pub struct Listener {
    limit: Option<usize>,
    asked: AtomicUsize,
    warnings: Mutex<Vec<String>>,
}

impl Listener {
    /// Lets this many questions whether to stop pass.
    pub fn stops_after(limit: usize) -> Listener {
        Listener { limit: Some(limit), ..Listener::default() }
    }

    /// How often it was asked whether to stop: work asks often.
    pub fn asked(&self) -> usize {
        self.asked.load(Ordering::Relaxed)
    }

    /// In their order; the same may be there several times.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.lock().expect("no panic").clone()
    }
}

impl Progress for Listener {
    fn is_cancelled(&self) -> bool {
        let before = self.asked.fetch_add(1, Ordering::Relaxed);
        self.limit.is_some_and(|limit| before >= limit)
    }

    fn warn(&self, warning: &str) {
        self.warnings.lock().expect("no panic").push(warning.to_owned());
    }
}
