//! What a device can do at most.

use crate::loads::Fours;
use crate::{Piece, Push};
use spirv_std::glam::{UVec3, Vec4};
use spirv_std::spirv;
use viewfuse_kernels::limits::{ChainBlock, chained, copied};

/// Four numbers, number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "copy_numbers"))]
pub fn copy_numbers(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] piece: &Piece,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] numbers: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] copies: &mut [Vec4],
) {
    if id.x >= piece.count {
        return;
    }
    let element = (piece.first + id.x) as usize;
    copies[element] = Vec4::from_array(copied(&Fours(numbers), element));
}

/// The chains of element number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "multiply_add"))]
pub fn multiply_add(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<ChainBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] starts: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] ends: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    ends[element] = chained(&push.parameters, starts[element]);
}
