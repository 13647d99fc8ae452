//! The terminal: progress, warnings, messages, and Ctrl-C.

mod course;

use super::ending;
use super::shown::{shown, shown_in_line};
use course::Course;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
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
        let bar = ProgressBar::new(STEPS as u64);
        let is_terminal = io::stderr().is_terminal();
        let template = "{msg} [{wide_bar:.blue}] {percent:>3} %";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        if is_terminal {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Terminal::of(bar, is_terminal, label)
    }

    fn of(bar: ProgressBar, is_terminal: bool, label: &str) -> Terminal {
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
            writeln!(io::stderr().lock(), "progress: {share} %, {}", course.words(now)).ok();
        }
    }

    /// Without a bar: for work that shows its progress elsewhere.
    #[cfg(feature = "view")]
    pub(crate) fn without_bar() -> Terminal {
        // As on a terminal there are no lines, and the bar is hidden.
        Terminal::of(ProgressBar::hidden(), true, "")
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
