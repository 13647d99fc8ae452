//! Progress of long work: a bar on a terminal, nothing elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;
use std::sync::Mutex;
use std::time::Duration;

/// A count of pieces of work done and left. Hidden when standard error is not a terminal.
pub struct Progress {
    bar: ProgressBar,
    /// Warnings that were shown; `None` where nothing is shown at all.
    told: Option<Mutex<Vec<String>>>,
}

impl Progress {
    /// A bar with a label; its length grows by [`Progress::expect`].
    pub fn new(label: &str) -> Progress {
        let bar = ProgressBar::new(0);
        let template = "{msg:>12} [{wide_bar:.blue}] {pos}/{len} {eta}";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar, told: Some(Mutex::default()) }
    }

    /// No display at all.
    pub fn hidden() -> Progress {
        Progress { bar: ProgressBar::hidden(), told: None }
    }

    /// More pieces will come.
    pub fn expect(&self, pieces: usize) {
        self.bar.inc_length(pieces as u64);
    }

    /// Shows a warning on standard error, once however often it is given.
    pub fn warn(&self, warning: &str) {
        let Some(Ok(mut told)) = self.told.as_ref().map(Mutex::lock) else { return };
        if !told.iter().any(|earlier| earlier == warning) {
            self.bar.suspend(|| eprintln!("viewfuse: warning: {warning}"));
            told.push(warning.to_owned());
        }
    }

    /// Prints a line of news on standard output, above the bar; nothing where nothing is shown at all. A reader that has gone
    /// away is no reason to stop.
    pub fn note(&self, news: &str) {
        if self.told.is_some() {
            self.bar.suspend(|| writeln!(std::io::stdout().lock(), "{news}").ok());
        }
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
