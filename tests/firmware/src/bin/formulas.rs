//! Prints the list without attention. Its size is the size of the firmware without attention.
#![no_std]
#![no_main]

use viewfuse_firmware::{Output, finish};
use viewfuse_list::{Inputs, formulas::formulas};

#[viewfuse_firmware::entry]
fn main() -> ! {
    let mut output = Output::open();
    // A black box: otherwise the compiler could compute the list itself.
    formulas(core::hint::black_box(Inputs::STANDARD), &mut |name, value| output.number(name, value));
    finish()
}
