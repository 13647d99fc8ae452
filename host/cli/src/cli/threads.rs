//! `--threads`.

use anyhow::Context;

/// Starts the threads of all cores, which libraries would start when they first need them, and panic if they cannot.
///
/// # Errors
/// If the system allows no more threads.
pub(crate) fn start_threads() -> anyhow::Result<()> {
    rayon::ThreadPoolBuilder::new().build_global().context("the threads of the cores cannot be started")
}

/// Runs `work` on this many threads instead of all cores.
///
/// # Errors
/// If the threads cannot be started.
pub fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> anyhow::Result<T> {
    match threads {
        None => Ok(work()),
        Some(count) => Ok(rayon::ThreadPoolBuilder::new().num_threads(count.into()).build()?.install(work)),
    }
}
