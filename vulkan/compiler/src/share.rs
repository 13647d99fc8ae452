//! Makes an invocation's writes to workgroup memory visible to the others.
//!
//! In Vulkan's memory model, accesses are private to an invocation, despite barriers, unless each instruction is
//! marked. rust-gpu sets no marks. Here every access to workgroup memory gets the mark `NonPrivatePointer`; the
//! barriers in `viewfuse-shaders` do the rest.

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{MemoryAccess, Op, StorageClass};
use std::collections::HashSet;

/// Marks every access to workgroup memory.
pub fn share(module: &mut Module) {
    let is_shared = |kind: &&Instruction| {
        kind.class.opcode == Op::TypePointer
            && kind.operands.first() == Some(&Operand::StorageClass(StorageClass::Workgroup))
    };
    let kinds: HashSet<u32> =
        module.types_global_values.iter().filter(is_shared).filter_map(|kind| kind.result_id).collect();
    let pointers: HashSet<u32> = module
        .all_inst_iter()
        .filter(|instruction| instruction.result_type.is_some_and(|kind| kinds.contains(&kind)))
        .filter_map(|instruction| instruction.result_id)
        .collect();
    let blocks = module.functions.iter_mut().flat_map(|function| &mut function.blocks);
    for instruction in blocks.flat_map(|block| &mut block.instructions) {
        // What lies before the access in the instruction.
        let operands = match instruction.class.opcode {
            Op::Load => 1,
            Op::Store => 2,
            Op::CooperativeMatrixLoadKHR => 3,
            Op::CooperativeMatrixStoreKHR => 4,
            _ => continue,
        };
        let pointer = instruction.operands.first().and_then(Operand::id_ref_any);
        if !pointer.is_some_and(|pointer| pointers.contains(&pointer)) {
            continue;
        }
        match instruction.operands.get_mut(operands) {
            Some(Operand::MemoryAccess(access)) => *access |= MemoryAccess::NON_PRIVATE_POINTER,
            _ => instruction.operands.push(Operand::MemoryAccess(MemoryAccess::NON_PRIVATE_POINTER)),
        }
    }
}
