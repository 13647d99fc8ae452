//! Stopping between two calls of the denoiser.

use crate::{exact, made, sources, target, try_picture};
use std::env;
use std::process::Command;
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};
use viewfuse::field::FieldError;
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::field::genvs::sampling::Plan;
use viewfuse_core::weights::Weights;

const CHILD: &str = "VIEWFUSE_TEST_INTERRUPTED_CHILD";

/// In a process of its own: the flag is the process's.
#[test]
#[cfg_attr(not(unix), ignore = "there is no signal to send")]
fn a_person_need_not_wait_for_the_picture() {
    if env::var_os(CHILD).is_some() {
        return interrupted();
    }
    let name = "interrupt::a_person_need_not_wait_for_the_picture";
    let child =
        Command::new(env::current_exe().expect("this program")).args(["--exact", name]).env(CHILD, "1").output();
    let child = child.expect("this program starts");
    assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stdout));
}

fn interrupted() {
    viewfuse::job::interrupt::listen().expect("no other handler");
    let start = Instant::now();
    spawn(|| {
        sleep(Duration::from_millis(300));
        Command::new("kill").args(["-INT", &std::process::id().to_string()]).status().expect("a signal");
    });
    // As many calls as take a minute and more.
    let mut plan = Plan { settled: None, ..Plan::published(0) };
    plan.steps = viewfuse::field::genvs::sampling::Steps::Fixed {
        sampler: viewfuse_core::sampler::Sampler::Euler,
        level_count: 100_000,
    };
    let field = made(GenvsOptions { plan, ..exact() });
    match try_picture(&field, &sources(1), &Weights::mean(1), &target(32)) {
        Err(FieldError::Interrupted(_)) => {}
        other => panic!("{:?}", other.map(|_| ())),
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}
