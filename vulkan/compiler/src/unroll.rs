//! Asks drivers to unroll innermost loops: the hint `Unroll`, where no barrier is inside.

use crate::refine::{RefineError, read};
use rspirv::binary::Assemble;
use rspirv::dr::{Block, Function, Operand};
use rspirv::spirv::{LoopControl, Op};
use std::collections::{HashMap, HashSet};

/// Hints the loops of the entry points whose names are chosen, bytes to bytes.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn unroll(bytes: &[u8], is_chosen: impl Fn(&str) -> bool) -> Result<Vec<u8>, RefineError> {
    let mut module = read(bytes)?;
    let chosen = crate::phis::entries(&module, is_chosen);
    for function in
        module.functions.iter_mut().filter(|function| function.def_id().is_some_and(|id| chosen.contains(&id)))
    {
        for header in innermost(function) {
            for instruction in &mut function.blocks[header].instructions {
                if instruction.class.opcode == Op::LoopMerge {
                    instruction.operands[2] = Operand::LoopControl(LoopControl::UNROLL);
                }
            }
        }
    }
    Ok(module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect())
}

/// The headers of loops that have neither a loop nor a barrier inside.
fn innermost(function: &Function) -> Vec<usize> {
    let labels: HashMap<u32, usize> =
        function.blocks.iter().enumerate().filter_map(|(place, block)| Some((block.label_id()?, place))).collect();
    let merge = |block: &Block| {
        let instruction = block.instructions.iter().find(|instruction| instruction.class.opcode == Op::LoopMerge)?;
        instruction.operands.first().and_then(Operand::id_ref_any)
    };
    let is_innermost = |header: usize, merge_label: u32| {
        let (mut seen, mut open) = (HashSet::new(), vec![header]);
        while let Some(place) = open.pop() {
            if !seen.insert(place) {
                continue;
            }
            let block = &function.blocks[place];
            let has = |wanted: Op| block.instructions.iter().any(|instruction| instruction.class.opcode == wanted);
            if has(Op::ControlBarrier) || place != header && has(Op::LoopMerge) {
                return false;
            }
            let ends = block.instructions.last().map(|end| &end.operands[..]).unwrap_or_default();
            let next = ends.iter().filter_map(Operand::id_ref_any).filter(|label| *label != merge_label);
            open.extend(next.filter_map(|label| labels.get(&label)));
        }
        true
    };
    let headers = function.blocks.iter().enumerate().filter_map(|(place, block)| Some((place, merge(block)?)));
    headers.filter(|(place, label)| is_innermost(*place, *label)).map(|(place, _)| place).collect()
}
