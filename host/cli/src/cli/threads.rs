//! `--threads`.

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
