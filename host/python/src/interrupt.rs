//! Long work, without Python's lock, which Ctrl-C ends.
//!
//! Only the thread that called may ask Python for signals, and the library asks for cancellation on any thread. So the
//! work has a thread of its own, and the calling one looks after Python until it is done.

use crate::error::Failure;
use crate::progress::{Course, Reporter};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;
use std::ffi::CString;
use std::ops::Range;
use std::panic::resume_unwind;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;
use viewfuse::job::progress::Progress;

/// Time between two questions to Python.
const EVERY: Duration = Duration::from_millis(50);

/// What the calling thread and the work tell each other.
#[derive(Default)]
struct Watched {
    is_cancelled: AtomicBool,
    /// Each once.
    warnings: Mutex<Vec<String>>,
    course: Mutex<Course>,
}

impl Watched {
    fn course(&self) -> MutexGuard<'_, Course> {
        self.course.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn warnings(&self) -> MutexGuard<'_, Vec<String>> {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the warnings Python's, each once.
    ///
    /// # Errors
    /// What a warnings filter raised, after which no others come.
    fn warn_python(&self, py: Python<'_>) -> PyResult<()> {
        // Not while the lock is held: what Python calls for a warning may take its time.
        let warnings = std::mem::take(&mut *self.warnings());
        for warning in warnings {
            let warning = CString::new(warning.replace('\0', " "))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &warning, 1)?;
        }
        Ok(())
    }
}

impl Progress for Watched {
    fn stage(&self, name: &str, place: Range<usize>, of: usize) {
        self.course().begin(name, place, of);
    }

    fn expect(&self, pieces: usize) {
        self.course().expect(pieces);
    }

    fn step(&self) {
        self.course().step();
    }

    fn warn(&self, warning: &str) {
        let mut warnings = self.warnings();
        if !warnings.iter().any(|known| known == warning) {
            warnings.push(warning.to_owned());
        }
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

/// The process in which the library worked first.
static PROCESS: OnceLock<u32> = OnceLock::new();

/// The library's threads are those of the process in which it worked first: a process that was forked from that one has
/// none of them, and would wait for them for ever.
///
/// # Errors
/// `RuntimeError` in such a process.
fn check_process() -> PyResult<()> {
    match *PROCESS.get_or_init(process::id) == process::id() {
        true => Ok(()),
        false => Err(PyRuntimeError::new_err(
            "viewfuse worked in the process that this one was forked from, and its threads are there; start processes \
             with multiprocessing.get_context(\"spawn\")",
        )),
    }
}

/// Runs short work that cannot be cancelled while other Python threads run. After Ctrl-C nobody waits for its end.
pub(crate) fn left_alone<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    check_process()?;
    let (sender, done) = channel();
    thread::spawn(move || sender.send(work()).ok());
    py.detach(move || {
        loop {
            match done.recv_timeout(EVERY) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Failure::Other("the work ended without a result".to_owned()).into());
                }
            }
        }
    })
}

/// Runs `work` while other Python threads run; its warnings become Python's.
///
/// # Errors
/// Those of `work`; what a signal handler raised (`KeyboardInterrupt`), or a warnings filter.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&dyn Progress) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    reported(py, None, work)
}

/// As [`interruptible`], and the course of the work is shown where `progress=` says.
///
/// # Errors
/// The same, and what the report raised, which ends the work.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let reporter = Reporter::of(py, progress)?;
    let result = reported(py, reporter.as_ref(), work);
    if let Some(reporter) = reporter {
        reporter.end(py)?;
    }
    result
}

/// As [`interruptible`], and the course of the work is reported from the calling thread.
///
/// # Errors
/// The same, and what the report raised, which ends the work.
fn reported<T: Send>(
    py: Python<'_>,
    reporter: Option<&Reporter>,
    work: impl FnOnce(&dyn Progress) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    check_process()?;
    let watched = Watched::default();
    let mut last = Course::default();
    let mut look = |py: Python<'_>| {
        py.check_signals()?;
        let course = watched.course().clone();
        if let Some(reporter) = reporter.filter(|_| course != last) {
            reporter.report(py, &course)?;
            last = course;
        }
        PyResult::Ok(())
    };
    let (outcome, signal) = py.detach(|| {
        thread::scope(|scope| {
            let (working, done) = channel::<()>();
            let shared = &watched;
            let worker = scope.spawn(move || {
                // Dropped at the end, also by a panic.
                let _working = working;
                work(shared)
            });
            let mut signal = None;
            while done.recv_timeout(EVERY) == Err(RecvTimeoutError::Timeout) {
                if signal.is_none() {
                    signal = Python::attach(&mut look).err();
                    watched.is_cancelled.store(signal.is_some(), Ordering::Relaxed);
                }
            }
            (worker.join(), signal)
        })
    });
    if let Some(signal) = signal {
        return Err(signal);
    }
    let outcome = outcome.unwrap_or_else(|panic| resume_unwind(panic));
    // Also those of work that failed, whose own error goes before one that a filter raised.
    let warned = watched.warn_python(py);
    let result = outcome?;
    warned?;
    if let Some(reporter) = reporter {
        let mut course = watched.course().clone();
        course.share = 1.0;
        reporter.report(py, &course)?;
    }
    Ok(result)
}
