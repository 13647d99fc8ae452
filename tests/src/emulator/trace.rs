//! What measured calls took, from the emulator's trace.
//!
//! The trace has each block of instructions, which nothing enters but at its beginning and nothing leaves but at its
//! end, when it is translated, and the registers before every run of a block, its address among them. A call is counted
//! from the block that begins a function named `measured_...` to the last one before the address that the processor
//! held as its return address then. Nothing in the program measures, so nothing is to be subtracted.

use super::board::Registers;
use super::image::Image;
use std::collections::{BTreeMap, BTreeSet};
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

/// A block of instructions: how many, and how far they lower the stack pointer, bytes. What is still lowered behind the
/// block the registers say; this is for functions of one block, which raise it again.
#[derive(Clone, Copy, Default)]
struct Block {
    instructions: u64,
    lowered: u32,
}

/// What the registers say before a block.
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

/// How far an instruction lowers the stack pointer, bytes.
fn lowered(line: &str) -> u32 {
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).unwrap_or(0),
        None => text.parse().unwrap_or(0),
    };
    let of_list = |list: &str| list.split(',').count() as u32 * if list.starts_with('d') { 8 } else { 4 };
    if let Some((_, list)) = line.split_once('{')
        && (line.contains("push") || line.contains("stmdb") && line.contains("sp!"))
    {
        return of_list(list);
    }
    // `sub sp, #8`, `sub.w sp, sp, #0x10`, `str r0, [sp, #-4]!`, `addi sp,sp,-16`.
    let behind = match line.contains("sub") && line.contains(" sp, ") {
        true => line.rsplit_once('#'),
        false => line.split_once("[sp, #-").or_else(|| line.split_once(" sp,sp,-")),
    };
    behind.map_or(0, |(_, text)| number(text.trim_end_matches([']', '!'])))
}

/// The measured calls of a trace, in their order.
///
/// # Errors
/// A line that is not understood, a block that was not listed or lies outside any function, a call that does not
/// return.
pub fn calls(mut trace: impl BufRead, registers: Registers, image: &Image) -> Result<Vec<Call>, String> {
    let mut calls = Vec::new();
    let mut open: Option<Open> = None;
    let mut blocks: BTreeMap<u32, Block> = BTreeMap::new();
    let (mut line, mut state) = (String::new(), State::default());
    // The block that is being listed.
    let mut listed = 0;
    loop {
        line.clear();
        if trace.read_line(&mut line).map_err(|error| error.to_string())? == 0 {
            break;
        }
        let text = line.trim_end();
        if text.starts_with("IN:") {
            listed = 0;
        } else if let Some(instruction) = text.strip_prefix("0x") {
            let address = instruction.get(..8).and_then(|digits| u32::from_str_radix(digits, 16).ok());
            let address = address.ok_or_else(|| format!("not understood: {text}"))?;
            if listed == 0 {
                listed = address;
                blocks.insert(address, Block::default());
            }
            let block = blocks.entry(listed).or_default();
            block.instructions += 1;
            block.lowered += lowered(text);
        }
        if !registers.take(text, &mut state).ok_or_else(|| format!("not understood: {text}"))? {
            continue;
        }
        let State { address, stack, link } = state;
        if open.as_ref().is_some_and(|call| call.return_address == address && call.stack_before == stack) {
            calls.extend(open.take().map(|call| call.closed(image)));
        }
        let index = image.function_at(address);
        if open.is_none()
            && let Some(function) = index.map(|index| &image.functions[index])
            && function.address == address
            && let Some(name) = function.name.strip_prefix(MEASURED)
        {
            open = Some(Open {
                name: name.to_owned(),
                return_address: link,
                instructions: 0,
                stack_before: stack,
                lowest_stack: stack,
                functions: BTreeSet::new(),
            });
        }
        if let Some(call) = &mut open {
            let block = blocks.get(&address).ok_or_else(|| format!("no block at {address:#x}"))?;
            call.instructions += block.instructions;
            call.lowest_stack = call.lowest_stack.min(stack - block.lowered);
            call.functions.insert(index.ok_or_else(|| format!("no function at {address:#x}"))?);
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
