//! Progress of long work: a bar on a terminal, nothing elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// A count of pieces of work done and left. Hidden when standard error is not a terminal.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar with a label; its length grows by [`Progress::expect`].
    pub fn new(label: &str) -> Progress {
        let bar = ProgressBar::new(0);
        let template = "{msg:>12} [{wide_bar:.blue}] {pos}/{len} {eta}";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar }
    }

    /// No display at all.
    pub fn hidden() -> Progress {
        Progress { bar: ProgressBar::hidden() }
    }

    /// More pieces will come.
    pub fn expect(&self, pieces: usize) {
        self.bar.inc_length(pieces as u64);
    }

    /// A piece is done.
    pub fn step(&self) {
        self.bar.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
