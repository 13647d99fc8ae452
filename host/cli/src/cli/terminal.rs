//! The terminal: progress, warnings, messages, and Ctrl-C.

mod course;

use course::Course;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use viewfuse_job::progress::Progress;

/// Set by Ctrl-C and by SIGTERM.
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Steps of the bar.
const STEPS: f64 = 1000.0;
/// Time between two lines where there is no terminal.
const LINES: Duration = Duration::from_secs(5);

/// Makes Ctrl-C (and SIGTERM) set the flag instead of ending the process. A second one ends it at once.
///
/// # Errors
/// If another handler is already installed.
pub(crate) fn listen() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if CANCELLED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    })
}

/// On standard error: a bar on a terminal, elsewhere a line every few seconds, and warnings. Messages on standard output.
pub(crate) struct Terminal {
    bar: ProgressBar,
    is_terminal: bool,
    course: Mutex<Course>,
    /// When the last line was written.
    line: Mutex<Instant>,
    /// Warnings that were shown.
    told: Mutex<Vec<String>>,
}

impl Terminal {
    /// Without progress; `label` is the stage until the work names one.
    pub(crate) fn new(label: &str) -> Terminal {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::new(STEPS as u64);
        let template = "{msg} [{wide_bar:.blue}] {percent:>3} %";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        if is_terminal {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        let now = Instant::now();
        let (course, line) = (Mutex::new(Course::new(label, now)), Mutex::new(now));
        Terminal { bar, is_terminal, course, line, told: Mutex::default() }
    }

    /// Changes the course and shows it.
    fn change(&self, change: impl FnOnce(&mut Course)) {
        let Ok(mut course) = self.course.lock() else { return };
        change(&mut course);
        let now = Instant::now();
        if self.is_terminal {
            self.bar.set_position((STEPS * course.share()) as u64);
            self.bar.set_message(course.words(now));
            return;
        }
        let Ok(mut line) = self.line.lock() else { return };
        if now.duration_since(*line) >= LINES {
            *line = now;
            // A closed pipe is ignored.
            let share = (100.0 * course.share()) as u64;
            writeln!(std::io::stderr().lock(), "progress: {share} %, {}", course.words(now)).ok();
        }
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &str, done: usize, of: usize) {
        self.change(|course| course.begin(name, done, of));
    }

    fn expect(&self, pieces: usize) {
        self.change(|course| course.expect(pieces));
    }

    fn step(&self) {
        self.change(Course::step);
    }

    /// Shows each warning once.
    fn warn(&self, warning: &str) {
        let Ok(mut told) = self.told.lock() else { return };
        if !told.iter().any(|earlier| earlier == warning) {
            self.bar.suspend(|| eprintln!("viewfuse: warning: {warning}"));
            told.push(warning.to_owned());
        }
    }

    /// A closed pipe is ignored.
    fn note(&self, news: &str) {
        self.bar.suspend(|| writeln!(std::io::stdout().lock(), "{news}").ok());
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
