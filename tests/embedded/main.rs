//! What goes into devices: core on bare microcontrollers, what they log, and the C interface.

mod capi;
mod defmt;
mod firmware;
mod miri;

use libtest_mimic::{Arguments, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let trials = firmware::trials().into_iter().chain(capi::trials()).chain(defmt::trials()).chain(miri::trials());
    run(&arguments, trials.collect()).exit_code()
}
