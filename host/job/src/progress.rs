//! Progress and cancellation of long work, through one trait: the library reports its progress and checks for
//! cancellation; the caller decides what is shown and when to stop.

use std::ops::Range;

/// The work was cancelled by its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; nothing half-written is left behind")]
pub struct Interrupted;

/// The caller's side of long work: it receives progress reports and can cancel. Every method has a default that shows
/// nothing and never cancels, so that `impl Progress for MyType {}` is enough to begin with.
pub trait Progress: Sync {
    /// A stage begins: its name, and its place: the whole work is `of` parts of about the same time, and these are its
    /// own. The pieces that follow are of this stage. Work that contains other work gives it a [`Part`].
    fn stage(&self, _name: &str, _place: Range<usize>, _of: usize) {}

    /// The work, or its stage, has this many more pieces.
    fn expect(&self, _pieces: usize) {}

    /// A piece is done.
    fn step(&self) {}

    /// What the stage has come to: a score, for example. It is shown behind the stage's name until the next stage.
    fn status(&self, _words: &str) {}

    /// A warning that concerns the result; the same warning may come several times.
    fn warn(&self, _warning: &str) {}

    /// A line of information: a score, the name of a written file.
    fn note(&self, _news: &str) {}

    /// Whether the work should stop.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Long work calls this between pieces and returns the error.
    ///
    /// # Errors
    /// [`Interrupted`] once [`Progress::is_cancelled`] says so.
    fn check(&self) -> Result<(), Interrupted> {
        if self.is_cancelled() { Err(Interrupted) } else { Ok(()) }
    }
}

/// Shows nothing and never stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Silent;

impl Progress for Silent {}

/// A part of longer work: the stages of the work in it become stages of the whole, so that what is shown never goes
/// back.
#[derive(Clone)]
pub struct Part<'a> {
    whole: &'a dyn Progress,
    name: String,
    place: Range<usize>,
    of: usize,
}

impl<'a> Part<'a> {
    /// A stage of the whole work at `place` of `of`, as of [`Progress::stage`]. It begins under this name, which the
    /// names of the stages within follow. With an empty name those stand alone, and nothing begins before them.
    pub fn begin(whole: &'a dyn Progress, name: impl Into<String>, place: Range<usize>, of: usize) -> Part<'a> {
        let part = Part { whole, name: name.into(), place, of };
        if !part.name.is_empty() {
            whole.stage(&part.name, part.place.clone(), of);
        }
        part
    }
}

impl Progress for Part<'_> {
    /// Each of the whole's parts is cut into as many as this part has.
    fn stage(&self, name: &str, place: Range<usize>, of: usize) {
        let of = of.max(1);
        let at = |step: usize| self.place.start * of + self.place.len() * step.min(of);
        let place = at(place.start)..at(place.end);
        match self.name.as_str() {
            "" => self.whole.stage(name, place, self.of * of),
            stage => self.whole.stage(&format!("{stage}: {name}"), place, self.of * of),
        }
    }

    fn expect(&self, pieces: usize) {
        self.whole.expect(pieces);
    }

    fn step(&self) {
        self.whole.step();
    }

    fn status(&self, words: &str) {
        self.whole.status(words);
    }

    fn warn(&self, warning: &str) {
        self.whole.warn(warning);
    }

    fn note(&self, news: &str) {
        self.whole.note(news);
    }

    fn is_cancelled(&self) -> bool {
        self.whole.is_cancelled()
    }
}

/// Nested work, whose caller shows its own progress: shows nothing, and is cancelled with the outer work.
#[derive(Clone, Copy)]
pub struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Stopped;

    impl Progress for Stopped {
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn what_is_quiet_still_stops() {
        assert_eq!(Quiet(&Stopped).check(), Err(Interrupted));
        assert_eq!((Quiet(&Silent).check(), Silent.check()), (Ok(()), Ok(())));
    }

    #[derive(Default)]
    struct Told(std::sync::Mutex<Vec<(String, Range<usize>, usize)>>);

    impl Progress for Told {
        fn stage(&self, name: &str, place: Range<usize>, of: usize) {
            self.0.lock().expect("no panic").push((name.to_owned(), place, of));
        }
    }

    #[test]
    fn stages_within_a_part_are_stages_of_the_whole() {
        let told = Told::default();
        let part = Part::begin(&told, "scene", 1..3, 4);
        for done in 0..2 {
            Part::begin(&part, "", done..done + 1, 2).stage("view", 1..2, 2);
        }
        let told = told.0.into_inner().expect("no panic");
        let expected = [("scene", 1..3, 4), ("scene: view", 6..8, 16), ("scene: view", 10..12, 16)];
        assert_eq!(told, expected.map(|(name, place, of)| (name.to_owned(), place, of)));
    }
}
