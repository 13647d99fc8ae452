//! Stopping cleanly: Ctrl-C sets a flag, long work looks at it between pieces and returns.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The work was stopped by the person who started it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; nothing half-written is left behind")]
pub struct Interrupted;

/// Makes Ctrl-C (and a polite kill) set the flag instead of ending the process. A second one ends it at once.
///
/// # Errors
/// If another handler is already installed.
pub fn listen() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    })
}

/// Returns [`Interrupted`] once a stop was asked for.
///
/// # Errors
/// [`Interrupted`].
pub fn check() -> Result<(), Interrupted> {
    if REQUESTED.load(Ordering::SeqCst) { Err(Interrupted) } else { Ok(()) }
}
