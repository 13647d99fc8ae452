//! Removes composites that hold pointers.
//!
//! A slice is a pointer and a length, `viewfuse_core::pages::Pages` are several slices: rust-gpu makes them composites of
//! pointers, which a module with logical addressing must not have. It only constructs such a composite and extracts its
//! members, so each extracted member is replaced by the inserted value, and unused instructions are
//! removed.

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::Op;
use std::collections::{HashMap, HashSet};

/// Replaces members of composites by the values they were constructed from, and removes unused instructions.
pub fn legalise(module: &mut Module) {
    // Not vectors: those can be made of vectors, and then their members are not operands.
    let is_aggregate = |kind: &&Instruction| matches!(kind.class.opcode, Op::TypeStruct | Op::TypeArray);
    let aggregates = module.types_global_values.iter().filter(is_aggregate).filter_map(|kind| kind.result_id).collect();
    for function in &mut module.functions {
        // What was taken out of a composite may be one itself, whose members are seen only then.
        while forward_members(function, &aggregates) {
            leave_out_unneeded(function);
        }
    }
    leave_out_unneeded_globals(module);
}

/// How a composite was constructed.
enum Made {
    /// One member was replaced: the object, the composite before, the path to the member.
    Inserted { object: u32, before: u32, path: Vec<u32> },
    /// All members were given.
    Constructed(Vec<u32>),
}

fn instructions(function: &Function) -> impl Iterator<Item = &Instruction> {
    function.blocks.iter().flat_map(|block| &block.instructions)
}

fn ids(instruction: &Instruction) -> impl Iterator<Item = u32> {
    instruction.result_type.into_iter().chain(instruction.operands.iter().filter_map(Operand::id_ref_any))
}

fn id(operand: Option<&Operand>) -> Option<u32> {
    operand.and_then(Operand::id_ref_any)
}

fn path(operands: &[Operand]) -> Vec<u32> {
    let index = |operand: &Operand| if let Operand::LiteralBit32(index) = operand { Some(*index) } else { None };
    operands.iter().filter_map(index).collect()
}

/// Returns whether it found anything to replace.
fn forward_members(function: &mut Function, aggregates: &HashSet<u32>) -> bool {
    let mut made = HashMap::new();
    for instruction in instructions(function) {
        let (Some(result), operands) = (instruction.result_id, &instruction.operands) else { continue };
        match (instruction.class.opcode, id(operands.first()), id(operands.get(1))) {
            (Op::CompositeInsert, Some(object), Some(before)) => {
                made.insert(result, Made::Inserted { object, before, path: path(&operands[2..]) });
            }
            (Op::CompositeConstruct, ..) if instruction.result_type.is_some_and(|kind| aggregates.contains(&kind)) => {
                made.insert(result, Made::Constructed(operands.iter().filter_map(Operand::id_ref_any).collect()));
            }
            _ => {}
        }
    }
    let mut replaced = HashMap::new();
    let mut shortened = false;
    for block in &mut function.blocks {
        for instruction in &mut block.instructions {
            if instruction.class.opcode != Op::CompositeExtract {
                continue;
            }
            let (Some(result), Some(composite)) = (instruction.result_id, id(instruction.operands.first())) else {
                continue;
            };
            let (source, rest) = source_of(&made, composite, path(&instruction.operands[1..]));
            if rest.is_empty() {
                replaced.insert(result, source);
            } else if source != composite {
                shortened = true;
                instruction.operands = vec![Operand::IdRef(source)];
                instruction.operands.extend(rest.into_iter().map(Operand::LiteralBit32));
            }
        }
    }
    let resolve = |mut id: u32| {
        while let Some(next) = replaced.get(&id) {
            id = *next;
        }
        id
    };
    for instruction in function.blocks.iter_mut().flat_map(|block| &mut block.instructions) {
        for operand in &mut instruction.operands {
            if let Operand::IdRef(id) = operand {
                *id = resolve(*id);
            }
        }
    }
    shortened || !replaced.is_empty()
}

/// Follows a path into a composite as far back as its construction is known.
fn source_of(made: &HashMap<u32, Made>, mut composite: u32, mut rest: Vec<u32>) -> (u32, Vec<u32>) {
    while !rest.is_empty() {
        match made.get(&composite) {
            Some(Made::Inserted { object, path, .. }) if rest.starts_with(path) => {
                composite = *object;
                rest.drain(..path.len());
            }
            // Something inside of what is taken out was replaced: it has to be put together first.
            Some(Made::Inserted { path, .. }) if path.starts_with(&rest) => break,
            Some(Made::Inserted { before, .. }) => composite = *before,
            Some(Made::Constructed(members)) => {
                let Some(member) = members.get(rest[0] as usize) else { break };
                composite = *member;
                rest.remove(0);
            }
            _ => break,
        }
    }
    (composite, rest)
}

/// Whether an instruction has no effect but its result.
fn is_pure(operation: Op) -> bool {
    !matches!(operation, Op::FunctionCall | Op::Variable | Op::Label) && !format!("{operation:?}").starts_with("Atomic")
}

fn leave_out_unneeded(function: &mut Function) {
    let makers: HashMap<u32, Vec<u32>> = instructions(function)
        .filter_map(|instruction| Some((instruction.result_id?, ids(instruction).collect())))
        .collect();
    let is_root = |instruction: &&Instruction| instruction.result_id.is_none() || !is_pure(instruction.class.opcode);
    let mut open: Vec<u32> = instructions(function).filter(is_root).flat_map(ids).collect();
    let mut needed = HashSet::new();
    while let Some(id) = open.pop() {
        if needed.insert(id) {
            open.extend(makers.get(&id).into_iter().flatten());
        }
    }
    for block in &mut function.blocks {
        block.instructions.retain(|instruction| {
            is_root(&instruction) || instruction.result_id.is_some_and(|result| needed.contains(&result))
        });
    }
}

fn leave_out_unneeded_globals(module: &mut Module) {
    loop {
        let used: HashSet<u32> = module
            .entry_points
            .iter()
            .chain(&module.execution_modes)
            .chain(&module.types_global_values)
            .chain(module.functions.iter().flat_map(|function| function.all_inst_iter()))
            .flat_map(ids)
            .collect();
        let count = module.types_global_values.len();
        module.types_global_values.retain(|instruction| instruction.result_id.is_none_or(|id| used.contains(&id)));
        if module.types_global_values.len() == count {
            break;
        }
    }
    let defined: HashSet<u32> = module.all_inst_iter().filter_map(|instruction| instruction.result_id).collect();
    module.annotations.retain(|mark| id(mark.operands.first()).is_none_or(|target| defined.contains(&target)));
}
