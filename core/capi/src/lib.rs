//! The C face of viewfuse-core: fixed-size entry points for firmware, as a static library with a generated header.
//!
//! Everything here unpacks pointers, checks what came through them, calls core and stores the result. Inputs are read
//! through raw pointers, so that a caller's overlapping arrays are no aliasing; each function says what overlap does.
//!
//! No unwinding leaves: core has no reachable panic, and `extern "C"` would turn one into an abort.
#![cfg_attr(target_os = "none", no_std)]
// The one place where memory that somebody else owns is touched. Core itself forbids unsafe code.
#![allow(unsafe_code)]

mod lent;

pub mod fuse;
pub mod ray;
pub mod schedule;
pub mod status;
pub mod weigh;

/// A program without an operating system has nobody to tell; core does not panic, but the linker wants to know.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
