//! `--threads`.

use anyhow::Context;
use std::error::Error;

/// Runs `work` on this many threads instead of all cores.
///
/// # Errors
/// If the threads cannot be started.
pub fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> anyhow::Result<T> {
    match threads {
        None => {
            let begun = rayon::ThreadPoolBuilder::new().build_global();
            // Without a cause it was begun before.
            match begun {
                Err(error) if error.source().is_some() => Err(error).context("the threads cannot be started"),
                _ => Ok(work()),
            }
        }
        Some(count) => Ok(rayon::ThreadPoolBuilder::new().num_threads(count.into()).build()?.install(work)),
    }
}
