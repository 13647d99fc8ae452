//! What measured calls took, from the emulator's trace.
//!
//! The trace has, for each instruction, the registers before it, its address among them. A call is counted from
//! the first instruction of a function named `measured_...` to the one that returns from it, both included, by
//! comparing addresses with the return address that the processor held at the start. Nothing in the program
//! measures, so nothing is to be subtracted.

use super::board::Registers;
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

/// What the registers say before an instruction.
#[derive(Clone, Copy, Default)]
struct State {
    address: u32,
    stack: u32,
    /// Where a function that was just called returns to.
    link: u32,
}

/// Eight hexadecimal digits behind a name.
fn register(line: &str, name: &str) -> Option<u32> {
    let (_, behind) = line.split_once(name)?;
    u32::from_str_radix(behind.trim_start().get(..8)?, 16).ok()
}

impl Registers {
    /// Takes what a line says; `Some(true)` if the state is whole with it, `None` if it is not understood.
    fn take(self, line: &str, state: &mut State) -> Option<bool> {
        match self {
            Registers::Arm if line.starts_with("R12=") => {
                state.stack = register(line, "R13=")?;
                state.link = register(line, "R14=")? & !1;
                state.address = register(line, "R15=")?;
                Some(true)
            }
            Registers::RiscV if line.starts_with(" pc ") => {
                state.address = register(line, " pc ")?;
                Some(false)
            }
            Registers::RiscV if line.starts_with(" x0/zero") => {
                state.link = register(line, "x1/ra")?;
                state.stack = register(line, "x2/sp")?;
                Some(true)
            }
            _ => Some(false),
        }
    }
}

/// The measured calls of a trace, in their order.
///
/// # Errors
/// A line that is not understood, an instruction outside any function, a call that does not return.
pub fn calls(mut trace: impl BufRead, registers: Registers, image: &Image) -> Result<Vec<Call>, String> {
    let mut calls = Vec::new();
    let mut open: Option<Open> = None;
    let (mut line, mut state) = (String::new(), State::default());
    loop {
        line.clear();
        if trace.read_line(&mut line).map_err(|error| error.to_string())? == 0 {
            break;
        }
        if !registers.take(&line, &mut state).ok_or_else(|| format!("not understood: {line}"))? {
            continue;
        }
        let State { address, stack, link } = state;
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
