//! The terminal: a progress bar, warnings, messages, and Ctrl-C.

use super::ending;
use super::shown::{shown, shown_in_line};
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::{self, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use viewfuse_job::progress::Progress;

/// Set by Ctrl-C and by SIGTERM.
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C (and SIGTERM) set the flag instead of ending the process. Work that does not stop soon, and a second signal,
/// end it at once.
///
/// # Errors
/// If another handler is already installed.
pub(crate) fn listen() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if CANCELLED.swap(true, Ordering::SeqCst) {
            ending::end();
        }
        // A thread of its own: this one waits for the second signal.
        std::thread::spawn(ending::watch);
    })
}

/// Prints an error in one line on standard error, which may be full or closed: what went wrong is in the exit code, too.
pub(crate) fn complain(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "viewfuse: {}", shown_in_line(message));
}

/// Prints what is wrong with the arguments, which takes several lines.
pub(crate) fn complain_of_arguments(message: impl Display) {
    let _ = write!(io::stderr().lock(), "{}", shown(message));
}

/// Keeps panics silent that become errors.
pub(crate) fn silence_caught_panics() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !viewfuse_job::panics::is_catching() {
            hook(panic);
        }
    }));
}

/// A progress bar on a terminal, none elsewhere; warnings on standard error, messages on standard output.
pub(crate) struct Terminal {
    bar: ProgressBar,
    /// Warnings that were shown.
    told: Mutex<Vec<String>>,
}

impl Terminal {
    /// A bar with a label; its length grows by [`Progress::expect`]. Hidden when standard error is not a terminal.
    pub(crate) fn new(label: &str) -> Terminal {
        let bar = ProgressBar::new(0);
        let template = "{msg:>12} [{wide_bar:.blue}] {pos}/{len} {eta}";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Terminal { bar, told: Mutex::default() }
    }

    /// Without a bar: for work that shows its progress elsewhere.
    #[cfg(feature = "view")]
    pub(crate) fn without_bar() -> Terminal {
        Terminal { bar: ProgressBar::hidden(), told: Mutex::default() }
    }
}

impl Progress for Terminal {
    fn expect(&self, pieces: usize) {
        self.bar.inc_length(pieces as u64);
    }

    fn step(&self) {
        self.bar.inc(1);
    }

    /// Shows each warning once.
    fn warn(&self, warning: &str) {
        let Ok(mut told) = self.told.lock() else { return };
        if !told.iter().any(|earlier| earlier == warning) {
            self.bar.suspend(|| complain(format_args!("warning: {warning}")));
            told.push(warning.to_owned());
        }
    }

    /// A closed pipe is ignored.
    fn note(&self, news: &str) {
        self.bar.suspend(|| writeln!(io::stdout().lock(), "{}", shown(news)).ok());
    }

    fn is_cancelled(&self) -> bool {
        CANCELLED.load(Ordering::SeqCst)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
