//! Progress and cancellation of long work, through one trait: the library reports its progress and checks for cancellation;
//! the caller decides what is shown and when to stop.

/// The work was cancelled by its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; nothing half-written is left behind")]
pub struct Interrupted;

/// The caller's side of long work: it receives progress reports and can cancel. Every method has a default that shows
/// nothing and never cancels, so that `impl Progress for MyType {}` is enough to begin with.
pub trait Progress: Sync {
    /// A stage begins: its name, and how many of the whole work's stages are done, of how many. The pieces that follow are
    /// of this stage. Work that others contain leaves the stages to them.
    fn stage(&self, _name: &str, _done: usize, _of: usize) {}

    /// The work, or its stage, has this many more pieces.
    fn expect(&self, _pieces: usize) {}

    /// A piece is done.
    fn step(&self) {}

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
}
