//! Takes the entry points apart into modules by what a device must have for them.
//!
//! A device must have every capability of a module, whichever entry points it runs. Not every device has operations of
//! subgroups, and few have matrix units.

use crate::refine::{RefineError, read};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Capability, Op};
use spirv_builder::Capability as Enabled;
use std::collections::HashSet;

/// What the sources are compiled with for the sake of some entry points.
pub const CAPABILITIES: [Enabled; 5] = [
    Enabled::GroupNonUniform,
    Enabled::GroupNonUniformBallot,
    Enabled::GroupNonUniformShuffle,
    Enabled::Float16,
    Enabled::CooperativeMatrixKHR,
];
/// The extension of SPIR-V for matrix units.
pub const MATRIX_EXTENSION: &str = "SPV_KHR_cooperative_matrix";

/// What stands before the names of entry points for arrays in fours, which are forms of the kernels that follow.
const IN_FOURS: &str = "in_fours::";
/// The forms of those that every device may run.
pub const FORMS_IN_FOURS: [&str; 4] = ["large", "small", "tiny", "least"];

/// The compiled kernels, as bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modules {
    /// Those for every device.
    pub kernels: Vec<u8>,
    /// Those for devices with the operations of subgroups.
    pub subgroups: Vec<u8>,
    /// Those for devices with matrix units.
    pub matrices: Vec<u8>,
    /// The same with plain arithmetic in the place of matrix units, by which these are tested on every device.
    pub stand_ins: Vec<u8>,
}

/// The modules, in the order of [`Modules`].
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Kernels,
    Subgroups,
    Matrices,
    StandIns,
}

impl Part {
    /// That of an entry point.
    fn of(name: &str) -> Part {
        let (_, form) = name.split_once("::").unwrap_or((name, ""));
        match form {
            "subgroup" => Part::Subgroups,
            _ if form.ends_with("_stand_in") => Part::StandIns,
            _ if form.starts_with("half") || form.starts_with("two_halves") => Part::Matrices,
            _ => Part::Kernels,
        }
    }

    /// Whether it keeps a capability that [`CAPABILITIES`] has.
    fn keeps(self, capability: Capability) -> bool {
        match capability {
            Capability::GroupNonUniform => matches!(self, Part::Subgroups | Part::Matrices),
            Capability::GroupNonUniformBallot | Capability::GroupNonUniformShuffle => self == Part::Subgroups,
            Capability::Float16 | Capability::CooperativeMatrixKHR => self == Part::Matrices,
            _ => true,
        }
    }
}

/// Splits a module. Types and constants that a part does not need are left for [`refine`](crate::refine::refine) to
/// remove.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn split(bytes: &[u8]) -> Result<Modules, RefineError> {
    let mut whole = read(bytes)?;
    for entry in &mut whole.entry_points {
        if let Some(Operand::LiteralString(name)) = entry.operands.get_mut(2)
            && let Some(rest) = name.strip_prefix(IN_FOURS)
        {
            *name = rest.to_owned();
        }
    }
    let take = |part: Part| -> Vec<u8> {
        let mut module = whole.clone();
        retain(&mut module, |name| Part::of(name) == part);
        module.capabilities.retain(|capability| match capability.operands.first() {
            Some(Operand::Capability(capability)) => part.keeps(*capability),
            _ => true,
        });
        let is_of_matrices = |extension: &Instruction| {
            matches!(extension.operands.first(),
            Some(Operand::LiteralString(name)) if name == MATRIX_EXTENSION)
        };
        module.extensions.retain(|extension| part == Part::Matrices || !is_of_matrices(extension));
        module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect()
    };
    Ok(Modules {
        kernels: take(Part::Kernels),
        subgroups: take(Part::Subgroups),
        matrices: take(Part::Matrices),
        stand_ins: take(Part::StandIns),
    })
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
