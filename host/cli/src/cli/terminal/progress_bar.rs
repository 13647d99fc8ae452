//! The course of the work as a bar on a terminal, and elsewhere as a line every few seconds.

use super::course::Course;
use crate::cli::printing::{draw, progress_line, width};
use crate::cli::shown::shown_in_line;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use unicode_width::UnicodeWidthChar;

/// Shows a course.
pub(super) struct ProgressDisplay {
    course: Mutex<Course>,
    /// Who writes to the terminal holds it, so that what is shown is in order.
    style: Mutex<ProgressStyle>,
}

/// How a course is shown.
enum ProgressStyle {
    Hidden,
    /// The last line of a terminal, and what it says.
    Bar(String),
    Lines(Lines),
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

impl ProgressDisplay {
    /// On a terminal a bar, elsewhere lines with this time between them; of 0 one for each change.
    pub(super) fn new(label: &str, is_terminal: bool, between: Duration) -> ProgressDisplay {
        let now = Instant::now();
        let style = match is_terminal {
            true => ProgressStyle::Bar(String::new()),
            false => ProgressStyle::Lines(Lines { between, last: now, said: String::new() }),
        };
        ProgressDisplay { course: Mutex::new(Course::new(label, now)), style: Mutex::new(style) }
    }

    /// Shows nothing.
    pub(super) fn hidden() -> ProgressDisplay {
        ProgressDisplay {
            course: Mutex::new(Course::new("", Instant::now())),
            style: Mutex::new(ProgressStyle::Hidden),
        }
    }

    /// Runs what prints, without the bar.
    pub(super) fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        let mut style = self.style.lock().unwrap_or_else(PoisonError::into_inner);
        style.clear();
        print()
    }

    /// Removes the bar.
    pub(super) fn end(&self) {
        self.aside(|| ());
    }

    /// What the stage has come to, for when the course is shown next.
    pub(super) fn tell(&self, words: &str) {
        if let Ok(mut course) = self.course.lock() {
            course.tell(words);
        }
    }

    /// Changes the course and shows it.
    pub(super) fn change(&self, change: impl FnOnce(&mut Course, Instant)) {
        if let Ok(mut course) = self.course.lock() {
            change(&mut course, Instant::now());
        }
        self.show();
    }

    /// Shows the course as it is now.
    pub(super) fn show(&self) {
        let Ok(mut style) = self.style.lock() else { return };
        let now = Instant::now();
        let Ok((share, words)) = self.course.lock().map(|mut course| (course.share, course.words(now))) else {
            return;
        };
        match &mut *style {
            ProgressStyle::Hidden => {}
            ProgressStyle::Bar(shown) => {
                let bar = bar(&words, share, width().into());
                if bar != *shown {
                    draw(&bar);
                    *shown = bar;
                }
            }
            ProgressStyle::Lines(lines) => {
                if let Some(line) = lines.due(now, share, &words) {
                    progress_line(line);
                }
            }
        }
    }
}

impl ProgressStyle {
    fn clear(&mut self) {
        if let ProgressStyle::Bar(shown) = self
            && !shown.is_empty()
        {
            draw("");
            shown.clear();
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

/// The words, a bar in what they leave of the width, and the share; shorter than the width, so that no terminal wraps
/// it.
fn bar(words: &str, share: f64, width: usize) -> String {
    let end = format!(" {:>3} %", (100.0 * share) as u64);
    let room = width.saturating_sub(end.len() + 1);
    let (mut line, mut used) = (String::new(), 0);
    // As it is shown, so that its width is known.
    for character in shown_in_line(words).chars() {
        used += character.width().unwrap_or(0);
        if used > room {
            break;
        }
        line.push(character);
    }
    let steps = room.saturating_sub(used + 3);
    if steps > 0 {
        let done = (share * steps as f64) as usize;
        line += &format!(" [{}{}]", "#".repeat(done), "-".repeat(steps - done));
    }
    line + &end
}

#[cfg(test)]
mod tests {
    use super::{Lines, bar};
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

    #[test]
    fn a_bar_is_shorter_than_the_terminal() {
        assert_eq!(bar("view 2", 0.5, 24), "view 2 [####----]  50 %");
        assert_eq!(bar("a\u{1b}[2J", 0.0, 24), "a\\u001b[2J [----]   0 %", "no names that control it");
        assert_eq!(bar("\u{6f22}", 1.0, 24), "\u{6f22} [############] 100 %");
        assert_eq!(bar("a long name of a stage", 0.999, 20), "a long name o  99 %");
        for width in 0..40 {
            assert!(bar("stage", 0.3, width).chars().count() < width.max(7));
        }
    }
}
