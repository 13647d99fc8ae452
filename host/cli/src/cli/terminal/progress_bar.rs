//! The course of the work as a bar on a terminal, and elsewhere as a line every few seconds.

use super::course::Course;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Steps of the bar.
const STEPS: f64 = 1000.0;

/// What shows a course.
pub(super) struct Shown {
    pub(super) bar: ProgressBar,
    course: Mutex<Course>,
    /// `None` where the bar is shown. Who shows the course holds it, so that what is shown is in order.
    lines: Mutex<Option<Lines>>,
}

/// Lines about the course.
struct Lines {
    /// Time from one line to the next.
    between: Duration,
    /// When the last one was written.
    last: Instant,
    /// What it said.
    said: String,
}

impl Shown {
    /// On a terminal a bar, elsewhere lines with this time between them; of 0 one for each change.
    pub(super) fn new(label: &str, is_terminal: bool, between: Duration) -> Shown {
        let now = Instant::now();
        let bar = if is_terminal { ProgressBar::new(STEPS as u64) } else { ProgressBar::hidden() };
        let template = "{msg} [{wide_bar:.blue}] {percent:>3} %";
        bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(label.to_owned());
        let lines = (!is_terminal).then(|| Lines { between, last: now, said: String::new() });
        Shown { bar, course: Mutex::new(Course::new(label, now)), lines: Mutex::new(lines) }
    }

    /// Shows nothing.
    #[cfg(feature = "view")]
    pub(super) fn hidden() -> Shown {
        Shown {
            bar: ProgressBar::hidden(),
            course: Mutex::new(Course::new("", Instant::now())),
            lines: Mutex::new(None),
        }
    }

    /// Changes the course and shows it.
    pub(super) fn change(&self, change: impl FnOnce(&mut Course)) {
        if let Ok(mut course) = self.course.lock() {
            change(&mut course);
        }
        self.show();
    }

    /// Shows the course as it is now.
    pub(super) fn show(&self) {
        let Ok(mut lines) = self.lines.lock() else { return };
        let now = Instant::now();
        let Ok((share, words)) = self.course.lock().map(|course| (course.share(), course.words(now))) else { return };
        let Some(lines) = lines.as_mut() else {
            self.bar.set_position((STEPS * share) as u64);
            self.bar.set_message(words);
            return;
        };
        if let Some(line) = lines.due(now, share, &words) {
            // A closed pipe is ignored.
            writeln!(io::stderr().lock(), "{line}").ok();
        }
    }
}

impl Lines {
    /// The line that is to be written now, if it is time for one.
    fn due(&mut self, now: Instant, share: f64, words: &str) -> Option<&str> {
        let line = format!("progress: {} %, {words}", (100.0 * share) as u64);
        // Without a time between lines each is one of its own.
        if now.duration_since(self.last) < self.between || (self.between == Duration::ZERO && line == self.said) {
            return None;
        }
        (self.last, self.said) = (now, line);
        Some(&self.said)
    }
}

#[cfg(test)]
mod tests {
    use super::Lines;
    use std::time::{Duration, Instant};

    #[test]
    fn lines_come_at_even_times() {
        let start = Instant::now();
        let told = |between: u64, share: fn(u64) -> f64| {
            let mut lines = Lines { between: Duration::from_millis(between), last: start, said: String::new() };
            let is_due =
                |tenth: &u64| lines.due(start + Duration::from_millis(100 * tenth), share(*tenth), "work").is_some();
            (1..=20).filter(is_due).collect::<Vec<u64>>()
        };
        assert_eq!(told(500, |_| 0.5), [5, 10, 15, 20], "also where nothing goes on");
        assert_eq!(told(0, |tenth| (tenth / 8) as f64 / 10.0), [1, 8, 16], "each change");
    }
}
