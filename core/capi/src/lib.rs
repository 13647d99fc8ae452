//! The C face of viewfuse-core: fixed-size entry points for firmware, as a static library with a generated header.
//!
//! Each function checks its pointers and the values behind them, calls core and stores the result. Inputs are read
//! through raw pointers, so overlapping arrays break no aliasing rule; each function says what overlap does.
//!
//! No panic unwinds into C: core has no reachable panic, and `extern "C"` would turn one into an abort.
#![cfg_attr(target_os = "none", no_std)]
// The one place where memory that somebody else owns is touched. Core itself forbids unsafe code.
#![allow(unsafe_code)]

mod lent;

pub mod fuse;
pub mod ray;
pub mod schedule;
pub mod status;
pub mod weigh;

/// The panic handler that linking without an operating system requires. Core does not panic.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
