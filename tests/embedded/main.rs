//! What goes into devices: core on a bare microcontroller, and its C interface.

mod capi;
mod firmware;

use libtest_mimic::{Arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let trials = firmware::trials().into_iter().chain(capi::trials());
    run(&arguments, trials.collect()).exit_code()
}
