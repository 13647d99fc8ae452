//! Takes the entry points that need operations of subgroups out of a module, into one of their own.
//!
//! A device must have every capability of a module, whichever entry points it runs. Not every device has these
//! operations.

use crate::refine::{RefineError, read};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Capability, Op};
use spirv_builder::Capability as Enabled;
use std::collections::HashSet;

/// How the names of entry points end that need operations of subgroups.
pub const SUFFIX: &str = "::subgroup";
/// What the sources are compiled with for their sake.
pub const CAPABILITIES: [Enabled; 3] =
    [Enabled::GroupNonUniform, Enabled::GroupNonUniformBallot, Enabled::GroupNonUniformShuffle];

/// The compiled kernels, as bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modules {
    /// Those for every device.
    pub kernels: Vec<u8>,
    /// Those for devices with the operations of subgroups.
    pub subgroups: Vec<u8>,
}

/// Splits a module. Types and constants that a part does not need are left for [`refine`](crate::refine::refine) to
/// remove.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn split(bytes: &[u8]) -> Result<Modules, RefineError> {
    let whole = read(bytes)?;
    let mut kernels = whole.clone();
    retain(&mut kernels, |name| !name.ends_with(SUFFIX));
    let is_of_subgroups = |capability: &Instruction| {
        matches!(
            capability.operands.first(),
            Some(Operand::Capability(
                Capability::GroupNonUniform | Capability::GroupNonUniformBallot | Capability::GroupNonUniformShuffle
            ))
        )
    };
    kernels.capabilities.retain(|capability| !is_of_subgroups(capability));
    let mut subgroups = whole;
    retain(&mut subgroups, |name| name.ends_with(SUFFIX));
    let bytes = |module: &Module| module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect();
    Ok(Modules { kernels: bytes(&kernels), subgroups: bytes(&subgroups) })
}

/// Retains some entry points and the functions that they call.
fn retain(module: &mut Module, is_kept: impl Fn(&str) -> bool) {
    module.entry_points.retain(|entry| match entry.operands.get(2) {
        Some(Operand::LiteralString(name)) => is_kept(name),
        _ => false,
    });
    let id = |operand: Option<&Operand>| operand.and_then(Operand::id_ref_any);
    let entries: HashSet<u32> = module.entry_points.iter().filter_map(|entry| id(entry.operands.get(1))).collect();
    module.execution_modes.retain(|mode| id(mode.operands.first()).is_some_and(|entry| entries.contains(&entry)));
    let (mut called, mut open) = (HashSet::new(), Vec::from_iter(entries));
    while let Some(function) = open.pop() {
        if called.insert(function) {
            let body = module.functions.iter().find(|body| body.def_id() == Some(function));
            let calls = body.into_iter().flat_map(|body| body.all_inst_iter());
            let calls = calls.filter(|instruction| instruction.class.opcode == Op::FunctionCall);
            open.extend(calls.filter_map(|call| id(call.operands.first())));
        }
    }
    module.functions.retain(|function| function.def_id().is_some_and(|id| called.contains(&id)));
    let defined: HashSet<u32> = module.all_inst_iter().filter_map(|instruction| instruction.result_id).collect();
    module.debug_names.clear();
    module.annotations.retain(|mark| id(mark.operands.first()).is_none_or(|target| defined.contains(&target)));
}
