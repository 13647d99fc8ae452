//! Prints the list of attention.
#![no_std]
#![no_main]

use viewfuse_firmware::{Output, finish};
use viewfuse_list::{Inputs, attended::attention};

#[viewfuse_firmware::entry]
fn main() -> ! {
    let mut output = Output::open();
    attention(core::hint::black_box(Inputs::STANDARD), &mut |name, value| output.number(name, value));
    finish()
}
