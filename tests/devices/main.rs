//! Vulkan devices under bad conditions: nothing there, lowered limits, no memory, no time, wrong arguments; and good
//! ones under validation. Each ends in its typed error or in the right picture, never in a crash or in a wrong one.
//!
//! One trial for each test and device. Without a device they are ignored and say why; with `VIEWFUSE_REQUIRE_VULKAN=1`
//! nothing is ignored, and with `VIEWFUSE_REQUIRE_DRIVERS=N` devices of so many drivers must be there.

mod arguments;
mod candidate;
mod child;
mod expectations;
mod forms;
mod gaussians;
mod genvs;
mod limits;
mod loader;
mod memory;
mod picture;
mod pixelnerf;
mod precision;
mod recording;
mod time;
mod transfers;
mod validation;

use candidate::{Candidate, Test};
use libtest_mimic::Failed;
use std::collections::BTreeSet;
use std::env;
use std::process::ExitCode;
use std::sync::Arc;
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_tests::trials::{is_required, needing, run, timed};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_VULKAN";

const BINARY: &str = env!("CARGO_BIN_EXE_viewfuse");

fn main() -> ExitCode {
    if let Some(code) = child::run() {
        return code;
    }
    let (candidates, problem) = match vulkan_devices() {
        Ok((instance, adapters)) => {
            (adapters.into_iter().map(|adapter| Arc::new(Candidate::new(&instance, adapter))).collect(), None)
        }
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    let drivers: BTreeSet<String> = candidates.iter().map(|candidate| candidate.adapter.driver.clone()).collect();
    let mut trials = vec![timed("so_many_drivers_as_required", move || enough_drivers(&drivers))];
    trials.extend(loader::trials());
    let tests: Vec<Test> = [
        arguments::TESTS,
        transfers::TESTS,
        memory::TESTS,
        time::TESTS,
        picture::TESTS,
        pixelnerf::TESTS,
        genvs::TESTS,
        precision::TESTS,
        limits::TESTS,
        expectations::TESTS,
        forms::TESTS,
        recording::TESTS,
        gaussians::TESTS,
    ]
    .concat();
    // The layers see what is asked of a driver: most is asked of one that has subgroups.
    let most_forms =
        candidates.iter().position(|candidate| candidate.adapter.subgroup_size.is_some()).unwrap_or_default();
    for (index, candidate) in candidates.iter().enumerate() {
        let validated = if index == most_forms { validation::tests() } else { Vec::new() };
        for test in tests.iter().chain(&validated) {
            let (work, candidate) = (test.work, candidate.clone());
            let name = format!("{}::{}", candidate.adapter.name, test.name);
            let missing = candidate.problem().or_else(|| test.missing.clone());
            trials.push(needing(missing, is_required(REQUIRED), timed(name, move || work(&candidate))));
        }
    }
    if let Some(problem) = problem {
        let all = [tests, validation::tests()].concat();
        let gone = all.iter().map(|test| {
            let problem_here = problem.clone();
            let trial = timed(format!("vulkan::{}", test.name), move || Err(problem_here.into()));
            needing(Some(problem.clone()), is_required(REQUIRED), trial)
        });
        trials.extend(gone);
    }
    run(trials)
}

fn enough_drivers(drivers: &BTreeSet<String>) -> Result<(), Failed> {
    let Ok(required) = env::var("VIEWFUSE_REQUIRE_DRIVERS") else { return Ok(()) };
    let required: usize = required.parse()?;
    match drivers.len() >= required {
        true => Ok(()),
        false => Err(format!("{required} drivers are required; there are {drivers:?}").into()),
    }
}
