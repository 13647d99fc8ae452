//! Pipelines that are compiled before their first use, on all cores, while the host reads files: a driver takes up to
//! seconds for each of them in a first process.

use crate::gpu::Gpu;
use crate::kernel::{Form, Kernel};
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
    fn start(&self, pipelines: &Arc<Pipelines>, keys: Vec<Key>) {
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

impl Gpu {
    /// Begins to compile these kernels, in the order of their first use, and returns at once. Of tiled kernels it takes
    /// the forms that were chosen in earlier processes, and where none is known, those that come into question.
    pub fn compile_ahead(&self, kernels: &[Kernel]) {
        let known = self.lock().choices.clone();
        let is_run = |form: &Form| self.form.map_or_else(|| self.handle.runs(*form), |only| only == *form);
        let candidates = |kernel: &Kernel| -> Vec<Form> {
            let chosen = known.forms_of(*kernel);
            let forms = if chosen.is_empty() { kernel.forms().to_vec() } else { chosen };
            forms.into_iter().filter(|form| *form != Form::Single && is_run(form)).collect()
        };
        // All need the plain form: for little work, or to compare with.
        let single = kernels.iter().map(|kernel| (*kernel, Form::Single, 0));
        let others = kernels.iter().flat_map(|kernel| candidates(kernel).into_iter().map(|form| (*kernel, form, 0)));
        let keys: Vec<Key> = single.chain(others).filter(|key| !self.pipelines.has(*key)).collect();
        self.ahead.start(&self.pipelines, keys);
    }
}
