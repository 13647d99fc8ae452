//! Fails, so that a test can see that a failure is noticed.
#![no_std]
#![no_main]

use viewfuse_list::Inputs;
use viewfuse_list::formulas::latents;

#[viewfuse_firmware::entry]
fn main() -> ! {
    let latents = latents(core::hint::black_box(Inputs::STANDARD));
    // No such view.
    core::hint::black_box(latents[core::hint::black_box(99)]);
    viewfuse_firmware::finish()
}
