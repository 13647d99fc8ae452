//! What the programs share: printing numbers by their bits, and ending.
//!
//! Nothing here formats: `core::fmt` would be the largest part of the firmware.
#![no_std]
#![forbid(unsafe_code)]

use core::panic::PanicInfo;
#[cfg(target_arch = "arm")]
use cortex_m_semihosting as semihosting;
#[cfg(target_arch = "riscv32")]
use riscv_semihosting as semihosting;
use semihosting::debug;
use semihosting::hio::{self, HostStream};

#[cfg(target_arch = "arm")]
pub use cortex_m_rt::entry;
#[cfg(target_arch = "riscv32")]
pub use riscv_rt::entry;

/// The emulator's standard output.
pub struct Output(HostStream);

impl Output {
    /// Opens it; ends the program with a failure if there is none.
    pub fn open() -> Output {
        match hio::hstdout() {
            Ok(stream) => Output(stream),
            Err(()) => fail(),
        }
    }

    /// Prints a line: eight hexadecimal digits of the number's bits, a space and its name.
    pub fn number(&mut self, name: &str, value: f32) {
        const LONGEST: usize = 64;
        let mut line = [b' '; LONGEST];
        for (digit, place) in line.iter_mut().zip((0..8).rev()) {
            let nibble = (value.to_bits() >> (4 * place)) as u8 & 15;
            *digit = if nibble < 10 { b'0' + nibble } else { b'a' + nibble - 10 };
        }
        let mut length = 9;
        for (letter, byte) in line[9..LONGEST - 1].iter_mut().zip(name.as_bytes()) {
            *letter = *byte;
            length += 1;
        }
        line[length.min(LONGEST - 1)] = b'\n';
        if self.0.write_all(&line[..(length + 1).min(LONGEST)]).is_err() {
            fail();
        }
    }
}

/// Ends the program: everything was done.
pub fn finish() -> ! {
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        core::hint::spin_loop();
    }
}

fn fail() -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    fail()
}

/// Functions that are measured: the emulator's trace shows where each begins, so none becomes part of its caller.
#[macro_export]
macro_rules! measured {
    ($(fn $name:ident($($argument:ident: $Type:ty),+ $(,)?) $(-> $Result:ty)? $body:block)+) => {
        $(
            // SAFETY: no other symbol of the program has this name.
            #[unsafe(no_mangle)]
            #[inline(never)]
            fn $name($($argument: $Type),+) $(-> $Result)? $body
        )+
    };
}
