//! Makes a module's bytes depend on the sources only, and its arithmetic exactly that of the sources.
//!
//! - Names, lines and files are removed: they hold paths.
//! - The result of every float operation that a device could fuse with another is decorated `NoContraction`: sums and
//!   products with their rounding errors (`viewfuse_core::math::two_sum`) mean nothing otherwise.

use crate::legalise::legalise;
use crate::share::share;
use rspirv::binary::{Assemble, ParseState};
use rspirv::dr::{Instruction, Module, Operand, load_bytes};
use rspirv::spirv::{Decoration, Op};

/// Why a module could not be refined.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// It is not SPIR-V.
    #[error("the module is not SPIR-V: {0}")]
    NotSpirv(ParseState),
}

/// Whether an operation is float arithmetic that `NoContraction` applies to.
pub fn is_float_arithmetic(operation: Op) -> bool {
    matches!(
        operation,
        Op::FNegate
            | Op::FAdd
            | Op::FSub
            | Op::FMul
            | Op::FDiv
            | Op::FRem
            | Op::FMod
            | Op::VectorTimesScalar
            | Op::MatrixTimesScalar
            | Op::VectorTimesMatrix
            | Op::MatrixTimesVector
            | Op::MatrixTimesMatrix
            | Op::OuterProduct
            | Op::Dot
    )
}

/// Refines a module, bytes to bytes.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn refine(bytes: &[u8]) -> Result<Vec<u8>, RefineError> {
    let mut module = read(bytes)?;
    leave_out_names(&mut module);
    legalise(&mut module);
    share(&mut module);
    forbid_contraction(&mut module);
    Ok(module.assemble().iter().flat_map(|word| word.to_le_bytes()).collect())
}

/// A module from its bytes.
///
/// # Errors
/// If the bytes are not SPIR-V.
pub fn read(bytes: &[u8]) -> Result<Module, RefineError> {
    load_bytes(bytes).map_err(RefineError::NotSpirv)
}

fn leave_out_names(module: &mut Module) {
    module.debug_string_source.clear();
    module.debug_names.clear();
    module.debug_module_processed.clear();
    let is_line = |instruction: &Instruction| matches!(instruction.class.opcode, Op::Line | Op::NoLine);
    module.types_global_values.retain(|instruction| !is_line(instruction));
    for block in module.functions.iter_mut().flat_map(|function| &mut function.blocks) {
        block.instructions.retain(|instruction| !is_line(instruction));
    }
}

fn forbid_contraction(module: &mut Module) {
    let is_mark = |instruction: &Instruction| {
        instruction.class.opcode == Op::Decorate
            && instruction.operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction))
    };
    module.annotations.retain(|instruction| !is_mark(instruction));
    let results: Vec<u32> = module
        .functions
        .iter()
        .flat_map(|function| &function.blocks)
        .flat_map(|block| &block.instructions)
        .filter(|instruction| is_float_arithmetic(instruction.class.opcode))
        .filter_map(|instruction| instruction.result_id)
        .collect();
    module.annotations.extend(results.into_iter().map(|result| {
        let operands = vec![Operand::IdRef(result), Operand::Decoration(Decoration::NoContraction)];
        Instruction::new(Op::Decorate, None, None, operands)
    }));
}
