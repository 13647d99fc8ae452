//! The terminal: progress, warnings, messages, and Ctrl-C.
//!
//! ```text
//! course        how far the work is: a share that never falls, and the time that is left
//! progress_bar  the course as a bar or as lines
//! clock         what is shown again and again
//! ```

mod clock;
mod course;
mod progress_bar;

use super::ending;
use super::environment::time_between_lines;
use super::printing::{complain, has_terminal, say};
use clock::Clock;
use course::Course;
use progress_bar::ProgressDisplay;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use viewfuse_job::progress::Progress;

/// Set by Ctrl-C and by SIGTERM.
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C (and SIGTERM) set the flag instead of ending the process. Work that does not stop soon, and a second
/// signal, end it at once.
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

/// Makes the limit of files' sizes (`ulimit -f`) an error of what is written instead of the end of the process.
/// Programs that are started have the usual end again.
pub(crate) fn survive_full_files() {
    #[cfg(unix)]
    {
        use nix::sys::signal::{SigSet, Signal};
        let mut full = SigSet::empty();
        full.add(Signal::SIGXFSZ);
        // Of this thread, and of those that it starts.
        let _ = full.thread_block();
    }
}

/// On standard error: a bar on a terminal, elsewhere a line every few seconds, and warnings. Messages on standard
/// output.
pub struct Terminal {
    display: Arc<ProgressDisplay>,
    /// Shows the time that is left also while nothing else changes. `None` where there is nothing to show it on.
    clock: Option<Clock>,
    /// Warnings that were shown.
    told: Mutex<Vec<String>>,
}

impl Terminal {
    /// Without progress; `label` is the stage until the work names one.
    pub fn new(label: &str) -> Terminal {
        let display = Arc::new(ProgressDisplay::new(label, has_terminal(), time_between_lines()));
        let shared = Arc::clone(&display);
        let clock = Clock::start(move || shared.show());
        Terminal { display, clock: Some(clock), told: Mutex::default() }
    }

    /// Without a bar: for work that shows its progress elsewhere.
    pub(crate) fn without_bar() -> Terminal {
        Terminal { display: Arc::new(ProgressDisplay::hidden()), clock: None, told: Mutex::default() }
    }

    /// The warnings that were shown, in their order.
    pub(crate) fn told(&self) -> Vec<String> {
        self.told.lock().map(|told| told.clone()).unwrap_or_default()
    }

    /// Runs what prints while the work goes on.
    pub(crate) fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        self.display.aside(print)
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &str, place: Range<usize>, count: usize) {
        self.display.change(|course, now| course.begin(name, place, count, now));
    }

    fn expect(&self, pieces: usize) {
        self.display.change(|course, _| course.expect(pieces));
    }

    fn step(&self) {
        self.display.change(Course::step);
    }

    /// It is shown with the next step.
    fn status(&self, words: &str) {
        self.display.tell(words);
    }

    /// Shows each warning once.
    fn warn(&self, warning: &str) {
        let Ok(mut told) = self.told.lock() else { return };
        if !told.iter().any(|earlier| earlier == warning) {
            self.aside(|| complain(format_args!("warning: {warning}")));
            told.push(warning.to_owned());
        }
    }

    /// Work goes on where it cannot be shown.
    fn note(&self, news: &str) {
        self.aside(|| say(news).ok());
    }

    fn is_cancelled(&self) -> bool {
        CANCELLED.load(Ordering::SeqCst)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.clock.take();
        self.display.end();
    }
}
