//! Rooms of tests without the harness of the standard library: what is known only at run time, such as which devices or
//! programs there are, decides which of their trials exist and which are ignored.

use libtest_mimic::Trial;

/// A test that panics where something is wrong, as a trial. Its name is its path without the room's.
pub fn trial(path: &str, test: fn()) -> Trial {
    let name = path.split_once("::").map_or(path, |(_, name)| name);
    Trial::test(name, move || {
        test();
        Ok(())
    })
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

/// Makes `trials()` of functions in this module, those with `#[cfg(..)]` before them where that holds. A test that is not
/// listed is dead code, which is a warning.
#[macro_export]
macro_rules! trials {
    ($($(#[$attribute:meta])? $test:ident),* $(,)?) => {
        /// The tests of this module.
        pub(crate) fn trials() -> Vec<libtest_mimic::Trial> {
            let trials = [$(
                $(#[$attribute])?
                $crate::trials::trial(concat!(module_path!(), "::", stringify!($test)), $test),
            )*];
            trials.into()
        }
    };
}
