//! Rooms of tests without the harness of the standard library: what is known only at run time, such as which devices or
//! programs there are, decides which of their trials exist and which are ignored.

use libtest_mimic::{Arguments, Failed, Trial};
use std::num::NonZero;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// How long trials took, with their names.
static TIMES: Mutex<Vec<(Duration, String)>> = Mutex::new(Vec::new());
/// From how many seconds on a trial is named as slow, and how many at most.
const SLOW: f64 = 5.0;
const MOST_SLOW: usize = 15;

/// What a room has as a test: it panics where something is wrong, or says it.
pub trait Test: Send + 'static {
    /// Runs it.
    ///
    /// # Errors
    /// What is wrong.
    fn run(self) -> Result<(), Failed>;
}

impl Test for fn() {
    fn run(self) -> Result<(), Failed> {
        self();
        Ok(())
    }
}

impl Test for fn() -> Result<(), Failed> {
    fn run(self) -> Result<(), Failed> {
        self()
    }
}

/// A test as a trial. Its name is its path without the room's.
pub fn trial(path: &str, test: impl Test) -> Trial {
    timed(path.split_once("::").map_or(path, |(_, name)| name), move || test.run())
}

/// As [`Trial::test`], of which [`run`] knows the time.
pub fn timed(name: impl Into<String>, test: impl FnOnce() -> Result<(), Failed> + Send + 'static) -> Trial {
    let name = name.into();
    let named = name.clone();
    Trial::test(name, move || {
        let start = Instant::now();
        let outcome = test();
        TIMES.lock().expect("nothing panics here").push((start.elapsed(), named));
        outcome
    })
}

/// What `main` of a room does: runs the trials that the program's arguments choose, and says which took long, beside
/// the others that ran at the same time. They wait for processes, for locks and for time limits, so that there is one
/// more of them than cores unless the arguments say otherwise.
pub fn run(trials: Vec<Trial>) -> ExitCode {
    let mut arguments = Arguments::from_args();
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    arguments.test_threads = arguments.test_threads.or(Some(cores + 1));
    let outcome = libtest_mimic::run(&arguments, trials);
    let mut times = std::mem::take(&mut *TIMES.lock().expect("nothing panics here"));
    times.sort_by(|a, b| b.cmp(a));
    for (time, name) in times.iter().filter(|(time, _)| time.as_secs_f64() >= SLOW).take(MOST_SLOW) {
        println!("{:6.0} s: {name}", time.as_secs_f64());
    }
    outcome.exit_code()
}

/// Whether an environment variable such as `VIEWFUSE_REQUIRE_VULKAN` is 1: what is missing then is a failure.
pub fn is_required(variable: &str) -> bool {
    std::env::var(variable).is_ok_and(|value| value == "1")
}

/// A trial that is ignored, with the reason before its name, where something is missing that is not required.
pub fn needing(missing: Option<String>, is_required: bool, trial: Trial) -> Trial {
    match missing {
        Some(missing) if !is_required => trial.with_kind(missing).with_ignored_flag(true),
        _ => trial,
    }
}

/// Why something is missing, unless it is there.
pub fn lacking(is_there: bool, why: &str) -> Option<String> {
    (!is_there).then(|| why.to_owned())
}

/// Makes `trials()` of functions in this module, those with `#[cfg(..)]` before them where that holds. Behind `;` stand
/// what is missing, if anything, the variable that makes this a failure, if there is one, and the functions that need
/// it; before all, as `[..];`, the modules within this one that have tests. A test that is not listed is dead code,
/// which is a warning.
#[macro_export]
macro_rules! trials {
    (
        $([$($(#[$platform:meta])? $module:ident),+ $(,)?];)?
        $($(#[$attribute:meta])? $test:ident),* $(,)?
        $(; $missing:expr $(, $variable:expr)? => $($needing:ident),+ $(,)?)*
    ) => {
        /// The tests of this module.
        pub(crate) fn trials() -> Vec<libtest_mimic::Trial> {
            let plain = [$(
                $(#[$attribute])?
                $crate::trial!($test),
            )*];
            let all: Vec<Vec<libtest_mimic::Trial>> = vec![
                plain.into(),
                $({
                    let (missing, is_required) = ($missing, false $(|| $crate::trials::is_required($variable))?);
                    let trials = [$($crate::trial!($needing)),+];
                    trials.map(|trial| $crate::trials::needing(missing.clone(), is_required, trial)).into()
                },)*
            ];
            let within: Vec<Vec<libtest_mimic::Trial>> = [$($(
                $(#[$platform])?
                $module::trials(),
            )+)?]
            .into();
            all.into_iter().chain(within).flatten().collect()
        }
    };
}

/// A function of this module as a trial, by its name.
#[macro_export]
macro_rules! trial {
    ($test:ident) => {
        $crate::trials::trial(concat!(module_path!(), "::", stringify!($test)), $test as fn() -> _)
    };
}
