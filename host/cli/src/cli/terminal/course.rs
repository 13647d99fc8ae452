//! How far the work is: a share that never falls, and the time that is left.

use std::ops::Range;
use std::time::{Duration, Instant};

/// Least share from which the time that is left is told.
const TELLING: f64 = 0.02;

/// The course of some work.
pub(super) struct Course {
    stage: String,
    /// The place of the stage in the whole work, as shares of it.
    place: Range<f64>,
    /// Pieces of the stage that are done, of those that are known.
    pieces: (usize, usize),
    /// The greatest share so far.
    share: f64,
    start: Instant,
}

impl Course {
    pub(super) fn new(stage: &str, start: Instant) -> Course {
        Course { stage: stage.to_owned(), place: 0.0..1.0, pieces: (0, 0), share: 0.0, start }
    }

    /// As of `Progress::stage`.
    pub(super) fn begin(&mut self, stage: &str, place: Range<usize>, of: usize) {
        stage.clone_into(&mut self.stage);
        let share = |part: usize| if of == 0 { 0.0 } else { (part as f64 / of as f64).min(1.0) };
        (self.place, self.pieces) = (share(place.start)..share(place.end), (0, 0));
        self.rise();
    }

    pub(super) fn expect(&mut self, pieces: usize) {
        self.pieces.1 += pieces;
    }

    pub(super) fn step(&mut self) {
        self.pieces.0 += 1;
        self.rise();
    }

    /// The share that is done, from 0 to 1: more pieces than were known do not lower it.
    pub(super) fn share(&self) -> f64 {
        self.share
    }

    fn rise(&mut self) {
        let (done, of) = self.pieces;
        let within = if of == 0 { 0.0 } else { (done as f64 / of as f64).min(1.0) };
        let Range { start, end } = self.place;
        self.share = self.share.max(start + within * (end - start).max(0.0));
    }

    /// The stage, and the time that is left at the rate so far.
    pub(super) fn words(&self, now: Instant) -> String {
        if self.share < TELLING || self.share >= 1.0 {
            return self.stage.clone();
        }
        let left = now.duration_since(self.start).mul_f64(1.0 / self.share - 1.0);
        format!("{}, about {} left", self.stage, time_words(left))
    }
}

/// `40 s`, `12 min`, `3 h 20 min`.
fn time_words(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..=119 => format!("{} s", seconds.max(1)),
        120..=7199 => format!("{} min", seconds / 60),
        _ => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::Course;
    use std::time::{Duration, Instant};

    #[test]
    fn the_share_never_falls() {
        let mut course = Course::new("start", Instant::now());
        let mut before = 0.0;
        for stage in 0..4 {
            course.begin(&format!("stage {stage}"), stage..stage + 1, 4);
            for pieces in [1, 3, 10] {
                course.expect(pieces);
                course.step();
                assert!(course.share() >= before && course.share() <= (stage + 1) as f64 / 4.0);
                before = course.share();
            }
        }
        // The only piece that was known was done: the further ones do not lower it.
        assert_eq!(before, 1.0);
        // A stage that begins before the last one ended.
        course.begin("again", 1..2, 4);
        course.expect(2);
        course.step();
        assert_eq!(course.share(), before);
        // Pieces without stages.
        let mut course = Course::new("pieces", Instant::now());
        course.step();
        assert_eq!(course.share(), 0.0);
        course.expect(4);
        course.step();
        assert_eq!(course.share(), 0.5);
        course.expect(400);
        course.step();
        assert_eq!(course.share(), 0.5);
    }

    #[test]
    fn the_time_that_is_left_is_told() {
        let start = Instant::now();
        let mut course = Course::new("first", start);
        assert_eq!(course.words(start + Duration::from_secs(9)), "first");
        course.begin("view 2 of 4", 1..2, 4);
        assert_eq!(course.words(start + Duration::from_secs(10)), "view 2 of 4, about 30 s left");
        assert_eq!(course.words(start + Duration::from_secs(200)), "view 2 of 4, about 10 min left");
        assert_eq!(course.words(start + Duration::from_secs(3600)), "view 2 of 4, about 3 h 0 min left");
    }
}
