//! Pipelines that are compiled before their first use, on all cores, while the host reads files: a driver takes up to
//! seconds for each of them in a first process.

use crate::pipelines::{Key, Pipelines};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// The threads that compile.
#[derive(Default)]
pub(crate) struct Ahead {
    threads: Mutex<Vec<JoinHandle<()>>>,
    is_stopped: Arc<AtomicBool>,
}

impl Ahead {
    /// Compiles in this order what is not there. What fails is told at its first use.
    pub(crate) fn start(&self, pipelines: &Arc<Pipelines>, keys: Vec<Key>) {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let (next, keys) = (Arc::new(AtomicUsize::new(0)), Arc::new(keys));
        for _ in 0..cores.min(keys.len()) {
            let (pipelines, is_stopped) = (pipelines.clone(), self.is_stopped.clone());
            let (next, keys) = (next.clone(), keys.clone());
            let work = move || {
                while let Some(key) = keys.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if is_stopped.load(Ordering::Relaxed) {
                        break;
                    }
                    let _ = pipelines.get(*key);
                }
            };
            // Without a thread it is compiled at its first use.
            if let Ok(thread) = std::thread::Builder::new().name("viewfuse-compile".to_owned()).spawn(work) {
                self.threads.lock().unwrap_or_else(PoisonError::into_inner).push(thread);
            }
        }
    }

    /// Compiles no more than what is being compiled, and waits for that.
    pub(crate) fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
        let threads = std::mem::take(&mut *self.threads.lock().unwrap_or_else(PoisonError::into_inner));
        for thread in threads {
            let _ = thread.join();
        }
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        self.stop();
    }
}
