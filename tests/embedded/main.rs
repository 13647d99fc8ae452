//! What goes into devices: core on bare microcontrollers, what they log, and the C interface.

mod capi;
mod defmt;
mod firmware;
mod miri;

use std::process::ExitCode;

fn main() -> ExitCode {
    let trials = firmware::trials().into_iter().chain(capi::trials()).chain(defmt::trials()).chain(miri::trials());
    viewfuse_tests::trials::run(trials.collect())
}
