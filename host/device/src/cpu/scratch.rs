//! Scratch buffers, one a thread: what a kernel needs in between is not allocated and cleared anew for every part of its
//! work.

use std::cell::RefCell;

thread_local! {
    static SCRATCH: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Runs something with a scratch buffer of `len` numbers, which may be anything. Within it nothing may ask for another.
pub(super) fn with_scratch<T>(len: usize, run: impl FnOnce(&mut [f32]) -> T) -> T {
    SCRATCH.with_borrow_mut(|scratch| {
        if scratch.len() < len {
            scratch.resize(len, 0.0);
        }
        run(&mut scratch[..len])
    })
}
