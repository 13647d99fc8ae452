//! Room for intermediate numbers, kept by each thread: what a kernel needs in between is not allocated and cleared anew
//! for every part of its work.

use std::cell::RefCell;

thread_local! {
    static ROOM: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Runs something with room for `len` numbers, which may be anything. Within it nothing may ask for room.
pub(super) fn with_room<T>(len: usize, run: impl FnOnce(&mut [f32]) -> T) -> T {
    ROOM.with_borrow_mut(|room| {
        if room.len() < len {
            room.resize(len, 0.0);
        }
        run(&mut room[..len])
    })
}
