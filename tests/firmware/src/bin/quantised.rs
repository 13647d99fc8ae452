//! Prints the list of attention with 8 bits, and of readings.
#![no_std]
#![no_main]

use viewfuse_firmware::{Output, finish};
use viewfuse_list::{Inputs, quantised::quantised};

#[viewfuse_firmware::entry]
fn main() -> ! {
    let mut output = Output::open();
    // A black box: otherwise the compiler could compute the list itself.
    quantised(core::hint::black_box(Inputs::STANDARD), &mut |name, value| output.number(name, value));
    finish()
}
