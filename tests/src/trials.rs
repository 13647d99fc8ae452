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

/// Makes `trials()` of functions in this module. A test that is not listed is dead code, which is a warning.
#[macro_export]
macro_rules! trials {
    ($($test:ident),* $(,)?) => {
        /// The tests of this module.
        pub(crate) fn trials() -> Vec<libtest_mimic::Trial> {
            vec![$($crate::trials::trial(concat!(module_path!(), "::", stringify!($test)), $test)),*]
        }
    };
}
