//! Broken input to everything that reads: a short run in the tests, a long one with `VIEWFUSE_FUZZ_SECONDS=N`.
//!
//! ```sh
//! VIEWFUSE_FUZZ_SECONDS=60 cargo test --profile fuzz -p viewfuse-tests --test fuzz [TARGET ...]
//! ```
//!
//! runs every target (or those named) for so many seconds, with overflow checks, and prints executions, executions a
//! second, the most memory of one execution, different outcomes, and what fell. Each target runs in processes of its
//! own: an input that ends a process, or takes too long, is found and kept like one that panics. The generator draws
//! from a seed, so that a run can be repeated; an input that leads to a new kind of message is kept and changed
//! further.
//!
//! ```text
//! memory    the allocator that counts
//! change    how inputs are changed
//! targets   what is fed
//! worker    a process that feeds one target
//! drive     the processes of all targets, and the table
//! ```

mod change;
mod drive;
mod memory;
mod targets;
mod worker;

use libtest_mimic::Trial;
use std::env;
use std::process::ExitCode;
use viewfuse_tests::trials::{run, timed};

#[global_allocator]
static MEMORY: memory::Counting = memory::Counting;

/// Executions of each target in the tests.
const SHORT: u64 = 3000;

fn main() -> ExitCode {
    if let Ok(order) = env::var(drive::ORDER) {
        worker::work(&serde_json::from_str(&order).expect("an order"));
        return ExitCode::SUCCESS;
    }
    if let Ok(seconds) = env::var("VIEWFUSE_FUZZ_SECONDS") {
        let names: Vec<String> = env::args().skip(1).filter(|name| !name.starts_with('-')).collect();
        return drive::long(seconds.parse().expect("VIEWFUSE_FUZZ_SECONDS is a number"), &names);
    }
    let trial = |(name, _): &(&'static str, _)| {
        let name = *name;
        timed(name, move || {
            drive::short(name, SHORT);
            Ok(())
        })
    };
    let mut trials: Vec<Trial> = targets::ALL.iter().map(trial).collect();
    trials.push(timed("what_falls_is_found", || {
        drive::what_falls_is_found();
        Ok(())
    }));
    run(trials)
}
