//! How far the work is: a share that never falls, and the time that is left, which is told while it falls.
//!
//! Rates are measured over pieces of the work of about a hundredth. What is left of the stage goes at the median of its
//! own rates, what follows at the median of all or at the mean of all so far, whichever is slower: a machine that is
//! busy for a moment moves neither far, and stages that do nothing do not hide those that take the time. Time that
//! would rise is worse than none: nothing is told until it is below what was told again, in the first seconds, and
//! while a piece takes longer than was expected.

use std::ops::Range;
use std::time::{Duration, Instant};

/// Least share from which the time that is left is told.
const TELLING: f64 = 0.02;

/// Least share over which a rate is measured.
const MIN_MEASURED: f64 = 0.01;

/// Nothing is told before rates are measured over so much time: what comes first is seldom like the rest, and stages
/// that take no time say nothing of one that does.
const MIN_TIME_MEASURED: Duration = Duration::from_secs(2);

/// So much more than was told, or than a piece was expected to take, is taken for the same.
const MAX_RISE: Duration = Duration::from_secs(1);

/// The course of some work.
pub(super) struct Course {
    stage: String,
    /// The stage's name, and what it has come to.
    said: String,
    /// The place of the stage in the whole work, as shares of it.
    place: Range<f64>,
    /// Pieces of the stage that are done, of those that are known.
    pieces: (usize, usize),
    /// The share that is done, from 0 to 1: more pieces than were known do not lower it.
    pub(super) share: f64,
    /// When the work began.
    start: Instant,
    /// Where the measurement of the next rate began.
    mark: (Instant, f64),
    /// Shares a second, of all stages; those of this stage come last.
    rates: Vec<f64>,
    /// How many of the rates are of earlier stages.
    earlier: usize,
    /// The time that was left when the share rose last, and when that was.
    left: Option<(Duration, Instant)>,
    /// The time that is left, as it is expected, when the share rises next: it does not fall below this before.
    next: Duration,
    /// The least time that was told.
    told: Duration,
}

impl Course {
    pub(super) fn new(stage: &str, start: Instant) -> Course {
        Course {
            stage: stage.to_owned(),
            said: stage.to_owned(),
            place: 0.0..1.0,
            pieces: (0, 0),
            share: 0.0,
            start,
            mark: (start, 0.0),
            rates: Vec::new(),
            earlier: 0,
            left: None,
            next: Duration::ZERO,
            told: Duration::MAX,
        }
    }

    /// As of `Progress::stage`.
    pub(super) fn begin(&mut self, stage: &str, place: Range<usize>, count: usize, now: Instant) {
        stage.clone_into(&mut self.stage);
        stage.clone_into(&mut self.said);
        let share = |part: usize| if count == 0 { 0.0 } else { (part as f64 / count as f64).min(1.0) };
        (self.place, self.pieces) = (share(place.start)..share(place.end), (0, 0));
        // What the stage before did until its end is of its rate.
        self.rise(now);
        self.measure(now, 0.0);
        self.earlier = self.rates.len();
        // Until it names pieces, it is one.
        self.estimate(self.place.end - self.place.start, now);
    }

    /// As of `Progress::status`.
    pub(super) fn tell(&mut self, words: &str) {
        self.said = format!("{}: {words}", self.stage);
    }

    pub(super) fn expect(&mut self, pieces: usize) {
        self.pieces.1 += pieces;
    }

    pub(super) fn step(&mut self, now: Instant) {
        self.pieces.0 += 1;
        self.rise(now);
    }

    fn rise(&mut self, now: Instant) {
        let (done, expected) = self.pieces;
        let within = if expected == 0 { 0.0 } else { (done as f64 / expected as f64).min(1.0) };
        let Range { start, end } = self.place;
        let share = start + within * (end - start).max(0.0);
        if share > self.share {
            let gain = share - self.share;
            self.share = share;
            self.measure(now, MIN_MEASURED);
            self.estimate(gain, now);
        }
    }

    /// Ends a measurement if it is of more than this share.
    fn measure(&mut self, now: Instant, least: f64) {
        let (start, share) = self.mark;
        let (gain, time) = (self.share - share, now.duration_since(start).as_secs_f64());
        if gain > least && time > 0.0 {
            self.rates.push(gain / time);
            self.mark = (now, self.share);
        }
    }

    /// `gain` is that of the piece that was done last, and is expected of the next one.
    fn estimate(&mut self, gain: f64, now: Instant) {
        let Some(median_rate) = median(&self.rates) else { return };
        let mean_rate = self.share / now.duration_since(self.start).as_secs_f64();
        let all = if mean_rate > 0.0 { median_rate.min(mean_rate) } else { median_rate };
        let rate = median(&self.rates[self.earlier..]).unwrap_or(all);
        let stage_end = self.place.end.max(self.share);
        let left = (stage_end - self.share) / rate + (1.0 - stage_end).max(0.0) / all;
        self.left = Duration::try_from_secs_f64(left).ok().map(|left| (left, now));
        self.next = Duration::try_from_secs_f64(left - gain / rate).unwrap_or_default();
    }

    /// The stage, and the time that is left if it is not more than was told.
    pub(super) fn words(&mut self, now: Instant) -> String {
        let Some((left, since)) = self.left.filter(|_| self.share >= TELLING && self.share < 1.0) else {
            return self.said.clone();
        };
        let (passed, expected) = (now.duration_since(since), left.saturating_sub(self.next));
        let measured = self.mark.0.duration_since(self.start);
        if measured < MIN_TIME_MEASURED || passed > expected + MAX_RISE {
            return self.said.clone();
        }
        let left = left.saturating_sub(passed).max(self.next);
        if left > self.told.saturating_add(MAX_RISE) {
            return self.said.clone();
        }
        let left = left.min(self.told);
        self.told = left;
        format!("{}, about {} left", self.said, time_words(left))
    }
}

/// The middle one of some rates, the lower one of two.
fn median(rates: &[f64]) -> Option<f64> {
    let mut sorted = rates.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied()
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
        let now = Instant::now();
        let mut course = Course::new("start", now);
        let mut before = 0.0;
        for stage in 0..4 {
            course.begin(&format!("stage {stage}"), stage..stage + 1, 4, now);
            for pieces in [1, 3, 10] {
                course.expect(pieces);
                course.step(now);
                assert!(course.share >= before && course.share <= (stage + 1) as f64 / 4.0);
                before = course.share;
            }
        }
        // The only piece that was known was done: the further ones do not lower it.
        assert_eq!(before, 1.0);
        // A stage that begins before the last one ended.
        course.begin("again", 1..2, 4, now);
        course.expect(2);
        course.step(now);
        assert_eq!(course.share, before);
        // Pieces without stages.
        let mut course = Course::new("pieces", now);
        course.step(now);
        assert_eq!(course.share, 0.0);
        course.expect(4);
        course.step(now);
        assert_eq!(course.share, 0.5);
        course.expect(400);
        course.step(now);
        assert_eq!(course.share, 0.5);
    }

    /// A clock that is moved by hand, and the times that were told, in seconds.
    struct Faked {
        now: Instant,
        course: Course,
        told: Vec<Option<u64>>,
    }

    impl Faked {
        fn new() -> Faked {
            let now = Instant::now();
            Faked { now, course: Course::new("work", now), told: Vec::new() }
        }

        fn tell(&mut self) {
            let words = self.course.words(self.now);
            let number = |text: &str| text.split(' ').next().and_then(|word| word.parse().ok());
            let time = words.split_once(", about ").map(|(_, time)| {
                let count: u64 = number(time).expect("a number");
                if time.contains(" min") { 60 * count } else { count }
            });
            self.told.push(time);
        }

        /// Time goes by; as on a terminal it is told five times a second.
        fn pass(&mut self, seconds: f64) {
            let beats = (seconds / 0.2).ceil();
            for _ in 0..beats as usize {
                self.now += Duration::from_secs_f64(seconds / beats);
                self.tell();
            }
        }

        /// A stage of so many pieces, each of which takes the time that is given for its number.
        fn stage(&mut self, place: usize, count: usize, pieces: usize, seconds: impl Fn(usize) -> f64) {
            self.course.begin("stage", place..place + 1, count, self.now);
            self.course.expect(pieces);
            for piece in 0..pieces {
                self.pass(seconds(piece));
                self.course.step(self.now);
                self.tell();
            }
        }

        #[track_caller]
        fn never_rises(&self) {
            let told: Vec<u64> = self.told.iter().flatten().copied().collect();
            for pair in told.windows(2) {
                assert!(pair[1] <= pair[0] + 1, "{} s became {} s: {told:?}", pair[0], pair[1]);
            }
        }

        /// The share of the beats on which a time was told.
        fn told_share(&self) -> f64 {
            self.told.iter().flatten().count() as f64 / self.told.len() as f64
        }
    }

    #[test]
    fn of_even_work_the_time_is_right() {
        let mut faked = Faked::new();
        for stage in 0..4 {
            faked.stage(stage, 4, 25, |_| 1.0);
            let (left, told) = (75 - 25 * stage as u64, faked.told.last().copied().flatten());
            assert!(stage == 3 || told.is_some_and(|told| told.abs_diff(left) <= 1), "{told:?} s instead of {left} s");
        }
        faked.never_rises();
        assert!(faked.told_share() > 0.9, "{}", faked.told_share());
    }

    /// Other processes take the processor now and then: one piece in seven takes four times as long.
    #[test]
    fn on_a_busy_machine_the_time_does_not_rise() {
        let mut faked = Faked::new();
        let noise = |piece: usize| 0.8 + 0.4 * (piece as f64 * 0.618).fract();
        for (stage, base) in [0.2, 0.5, 0.4, 0.4, 0.4, 0.4].into_iter().enumerate() {
            let seconds = |piece: usize| base * noise(piece) * if piece % 7 == 3 { 4.0 } else { 1.0 };
            faked.stage(stage, 6, 30, seconds);
        }
        faked.never_rises();
        assert!(faked.told_share() > 0.3, "{}", faked.told_share());
    }

    /// Half-way everything becomes five times as slow: the time that was told was wrong, and no greater one replaces
    /// it.
    #[test]
    fn a_time_that_would_rise_is_not_told() {
        let mut faked = Faked::new();
        faked.stage(0, 2, 50, |_| 0.2);
        let before = faked.told.len();
        faked.stage(1, 2, 50, |_| 1.0);
        faked.never_rises();
        let after = &faked.told[before..];
        assert!(after.iter().any(Option::is_none), "{after:?}");
        assert!(after.iter().rev().skip(2).take(20).any(Option::is_some), "near the end it is told again: {after:?}");
    }

    /// As an evaluation: reading takes no time, and of two stages one does nothing, because the other does its work.
    #[test]
    fn stages_without_work_do_not_hide_the_others() {
        let mut faked = Faked::new();
        for stage in 0..20 {
            faked.stage(stage, 20, 1, |_| if stage < 2 || stage % 2 == 0 { 0.05 } else { 4.0 });
        }
        faked.never_rises();
        // 36 s in all. Of what is left at least a third is told: a second of 36, as the fast stages alone would have
        // it, is none.
        let beats = faked.told.len();
        for (beat, told) in faked.told.iter().enumerate() {
            let left = 36.0 * (beats - beat) as f64 / beats as f64;
            assert!(told.is_none_or(|told| 3.0 * (told as f64 + 1.0) > left), "{told:?} of {left} s: {:?}", faked.told);
        }
        assert!(faked.told_share() > 0.3, "{}", faked.told_share());
    }

    /// As a network's picture: 60 % of the stages are done at once, and the last one has no pieces for a while.
    #[test]
    fn stages_that_take_no_time_promise_nothing() {
        let mut faked = Faked::new();
        for stage in 0..3 {
            faked.stage(stage, 4, 1, |_| 0.01);
        }
        faked.course.begin("view", 3..4, 4, faked.now);
        faked.pass(10.0);
        assert!(faked.told.iter().all(Option::is_none), "{:?}", faked.told);
        faked.stage(3, 4, 100, |_| 0.5);
        faked.never_rises();
        let told: Vec<u64> = faked.told.iter().flatten().copied().collect();
        assert!(told.first().is_some_and(|first| *first >= 40), "{told:?}");
        let half = faked.told[faked.told.len() - 200];
        assert!(half.is_some_and(|left| left.abs_diff(25) <= 2), "{half:?}: {told:?}");
    }

    #[test]
    fn times_in_words() {
        let words = |seconds: u64| super::time_words(Duration::from_secs(seconds));
        assert_eq!([0, 30, 119, 120, 7199].map(words), ["1 s", "30 s", "119 s", "2 min", "119 min"]);
        assert_eq!(words(12_000), "3 h 20 min");
    }
}
