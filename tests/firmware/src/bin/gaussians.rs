//! Prints the list of Gaussians.
#![no_std]
#![no_main]

use viewfuse_firmware::{Output, finish};
use viewfuse_list::{Inputs, splatted::splatting};

#[viewfuse_firmware::entry]
fn main() -> ! {
    let mut output = Output::open();
    splatting(core::hint::black_box(Inputs::STANDARD), &mut |name, value| output.number(name, value));
    finish()
}
