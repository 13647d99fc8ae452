//! Replaces each phi of an array or struct by phis of its members: what a device keeps in registers.
//!
//! An array of sums that a loop carries joins as a whole in what rust-gpu writes. Drivers keep matrices in registers
//! only if they join one by one.

use crate::refine::{RefineError, read};
use rspirv::binary::Assemble;
use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::Op;
use std::collections::HashMap;

/// The types of the members of each array and struct whose length is known.
type Members = HashMap<u32, Vec<u32>>;

/// Splits the phis of the entry points whose names are chosen, bytes to bytes.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn split_phis(bytes: &[u8], is_chosen: impl Fn(&str) -> bool) -> Result<Vec<u8>, RefineError> {
    let mut module = read(bytes)?;
    let chosen = entries(&module, is_chosen);
    let members = members(&module);
    let mut bound = module.header.as_ref().map_or(0, |header| header.bound);
    let mut fresh = || {
        bound += 1;
        bound - 1
    };
    let functions = module.functions.iter_mut();
    for function in functions.filter(|function| function.def_id().is_some_and(|id| chosen.contains(&id))) {
        while split_one(function, &members, &mut fresh).is_some() {}
    }
    if let Some(header) = &mut module.header {
        header.bound = bound;
    }
    Ok(module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect())
}

/// The functions of the entry points whose names are chosen.
pub(crate) fn entries(module: &Module, is_chosen: impl Fn(&str) -> bool) -> Vec<u32> {
    let chosen = module.entry_points.iter().filter_map(|entry| match &entry.operands[..] {
        [_, function, Operand::LiteralString(name), ..] if is_chosen(name) => function.id_ref_any(),
        _ => None,
    });
    chosen.collect()
}

fn members(module: &Module) -> Members {
    let (mut lengths, mut members) = (HashMap::new(), Members::new());
    let ids = |operands: &[Operand]| operands.iter().filter_map(Operand::id_ref_any).collect::<Vec<u32>>();
    for kind in &module.types_global_values {
        let Some(result) = kind.result_id else { continue };
        match (kind.class.opcode, &kind.operands[..]) {
            (Op::Constant, [Operand::LiteralBit32(length)]) => _ = lengths.insert(result, *length as usize),
            (Op::TypeArray, operands) => {
                if let [member, length] = ids(operands)[..]
                    && let Some(length) = lengths.get(&length)
                {
                    members.insert(result, vec![member; *length]);
                }
            }
            (Op::TypeStruct, operands) => _ = members.insert(result, ids(operands)),
            _ => {}
        }
    }
    members
}

/// Splits the first phi of an aggregate; `None` if there is none.
fn split_one(function: &mut Function, members: &Members, fresh: &mut impl FnMut() -> u32) -> Option<()> {
    let is_aggregate = |instruction: &Instruction| {
        instruction.class.opcode == Op::Phi && instruction.result_type.is_some_and(|kind| members.contains_key(&kind))
    };
    let (place, at) = function
        .blocks
        .iter()
        .enumerate()
        .find_map(|(place, block)| Some((place, block.instructions.iter().position(is_aggregate)?)))?;
    let labels: HashMap<u32, usize> =
        function.blocks.iter().enumerate().filter_map(|(place, block)| Some((block.label_id()?, place))).collect();
    let phi = function.blocks[place].instructions.remove(at);
    let kind = phi.result_type?;
    let sources: Vec<(u32, u32)> =
        phi.operands.chunks_exact(2).filter_map(|pair| Some((pair[0].id_ref_any()?, pair[1].id_ref_any()?))).collect();
    let mut found = Vec::new();
    leaves(members, kind, &mut Vec::new(), &mut found);
    let mut parts = Vec::new();
    for (path, kind) in found {
        let mut operands = Vec::new();
        for (value, from) in &sources {
            let part = fresh();
            let block = &mut function.blocks[*labels.get(from)?].instructions;
            // Before the branch, and before the merge that belongs to it.
            let is_end =
                |instruction: &Instruction| matches!(instruction.class.opcode, Op::SelectionMerge | Op::LoopMerge);
            let end = block.iter().position(is_end).unwrap_or(block.len() - 1);
            let path = path.iter().map(|member| Operand::LiteralBit32(*member));
            let of = std::iter::once(Operand::IdRef(*value)).chain(path).collect();
            block.insert(end, Instruction::new(Op::CompositeExtract, Some(kind), Some(part), of));
            operands.extend([Operand::IdRef(part), Operand::IdRef(*from)]);
        }
        let part = fresh();
        // The block may be its own predecessor, but not before its phis.
        function.blocks[place].instructions.insert(at, Instruction::new(Op::Phi, Some(kind), Some(part), operands));
        parts.push(part);
    }
    let block = &mut function.blocks[place].instructions;
    let after = block.iter().position(|instruction| instruction.class.opcode != Op::Phi)?;
    let mut built = Vec::new();
    build(members, kind, phi.result_id, &mut parts.into_iter(), fresh, &mut built);
    block.splice(after..after, built);
    Some(())
}

/// The paths to the members that are no arrays or structs, and their types.
fn leaves(members: &Members, kind: u32, path: &mut Vec<u32>, found: &mut Vec<(Vec<u32>, u32)>) {
    let Some(parts) = members.get(&kind) else {
        found.push((path.clone(), kind));
        return;
    };
    for (member, part) in (0..).zip(parts) {
        path.push(member);
        leaves(members, *part, path, found);
        path.pop();
    }
}

/// Puts members together.
fn build(
    members: &Members,
    kind: u32,
    result: Option<u32>,
    parts: &mut impl Iterator<Item = u32>,
    fresh: &mut impl FnMut() -> u32,
    built: &mut Vec<Instruction>,
) -> u32 {
    let Some(kinds) = members.get(&kind) else { return parts.next().unwrap_or_default() };
    let operands = kinds.iter().map(|kind| Operand::IdRef(build(members, *kind, None, parts, fresh, built))).collect();
    let id = result.unwrap_or_else(fresh);
    built.push(Instruction::new(Op::CompositeConstruct, Some(kind), Some(id), operands));
    id
}
