//! What measured calls took, from the emulator's trace.
//!
//! The trace has, for each instruction, a line with its address, then the registers before it. A call is counted from
//! the first instruction of a function named `measured_...` to the one that returns from it, both included, by
//! comparing addresses with the return address that the link register held at the start. Nothing in the program
//! measures, so nothing is to be subtracted.

use super::image::Image;
use std::collections::BTreeSet;
use std::io::BufRead;

/// What names of measured functions begin with.
const MEASURED: &str = "measured_";

/// What one call of a measured function took.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// The function's name behind `measured_`.
    pub name: String,
    /// Instructions executed, those of the functions called within included.
    pub instructions: u64,
    /// How far the stack pointer went below where it was before the call, in bytes.
    pub stack: u32,
    /// Bytes of the functions that ran, each whole and once.
    pub code: u64,
}

struct Open {
    name: String,
    return_address: u32,
    instructions: u64,
    stack_before: u32,
    lowest_stack: u32,
    functions: BTreeSet<usize>,
}

/// The measured calls of a trace, in their order.
///
/// # Errors
/// A line that is not understood, an instruction outside any function, a call that does not return.
pub fn calls(trace: impl BufRead, image: &Image) -> Result<Vec<Call>, String> {
    let mut calls = Vec::new();
    let mut open: Option<Open> = None;
    for line in trace.lines() {
        let line = line.map_err(|error| error.to_string())?;
        // The third line of registers is the one with the stack pointer, the link register and the address.
        let Some(registers) = line.strip_prefix("R12=") else { continue };
        let not_understood = || format!("not understood: {line}");
        let register = |name: &str| {
            let (_, behind) = registers.split_once(name)?;
            u32::from_str_radix(behind.get(..8)?, 16).ok()
        };
        let stack = register("R13=").ok_or_else(not_understood)?;
        let link = register("R14=").ok_or_else(not_understood)? & !1;
        let address = register("R15=").ok_or_else(not_understood)?;
        if open.as_ref().is_some_and(|call| call.return_address == address && call.stack_before == stack) {
            calls.extend(open.take().map(|call| call.closed(image)));
        }
        let function = || image.function_at(address).ok_or_else(|| format!("no function at {address:#x}"));
        if let Some(call) = &mut open {
            call.instructions += 1;
            call.lowest_stack = call.lowest_stack.min(stack);
            call.functions.insert(function()?);
        } else {
            let Some(index) = image.function_at(address) else { continue };
            let entered = &image.functions[index];
            if entered.address == address
                && let Some(name) = entered.name.strip_prefix(MEASURED)
            {
                open = Some(Open {
                    name: name.to_owned(),
                    return_address: link,
                    instructions: 1,
                    stack_before: stack,
                    lowest_stack: stack,
                    functions: BTreeSet::from([index]),
                });
            }
        }
    }
    match open {
        Some(call) => Err(format!("{} does not return", call.name)),
        None => Ok(calls),
    }
}

impl Open {
    fn closed(self, image: &Image) -> Call {
        let code = self.functions.iter().map(|index| u64::from(image.functions[*index].size)).sum();
        let stack = self.stack_before - self.lowest_stack;
        Call { name: self.name, instructions: self.instructions, stack, code }
    }
}
