//! Panics of other libraries as errors: a decoder that panics on a damaged file must not end the program.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

thread_local! {
    /// How many calls of [`caught`] this thread is in.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// A panic, with its message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the decoder panicked: {message}")]
pub struct Panicked {
    /// What the panic said.
    pub message: String,
}

/// Calls `work`, which decodes something and leaves nothing behind when it panics.
///
/// # Errors
/// [`Panicked`].
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, Panicked> {
    DEPTH.with(|depth| depth.set(depth.get() + 1));
    let outcome = catch_unwind(AssertUnwindSafe(work));
    DEPTH.with(|depth| depth.set(depth.get() - 1));
    outcome.map_err(|panic| Panicked { message: message(panic.as_ref()) })
}

/// Keeps panics silent that become errors, in the whole program.
pub fn silence_caught() {
    let hook = take_hook();
    set_hook(Box::new(move |panic| {
        if !is_catching() {
            hook(panic);
        }
    }));
}

/// Whether a panic of this thread would become an error.
fn is_catching() -> bool {
    DEPTH.with(Cell::get) > 0
}

/// The message in one line.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error() {
        let (inside, failed) = (caught(is_catching), caught(|| panic!("chunk 7 of\n 6")));
        assert_eq!(inside, Ok(true));
        assert_eq!(failed.map(|()| 0), Err(Panicked { message: "chunk 7 of 6".to_owned() }));
        assert!(!is_catching());
    }
}
