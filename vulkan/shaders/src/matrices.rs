//! Matrix products of two computed matrices, and softmax.

use crate::Push;
use crate::tile::{Buffered, Double, Quadruple, Shape, Shared, ShortShared, Single, Subgroup, Tiles};
use crate::unchecked::{Endless, store};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_kernels::network::attend::{MatrixBlock, softmax_scale, softmax_value};

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn product_of(
    id: UVec3,
    push: &Push<MatrixBlock>,
    left: &[f32],
    right: &[f32],
    outputs: &mut [f32],
    tiles: impl Tiles,
) {
    let block = &push.parameters;
    let column_count = block.column_count;
    let (left, right) = (Endless(left), Endless(right));
    tiles.multiply(
        push.piece.first + id.x,
        Shape { row_count: block.row_count, inner_count: block.inner_count, column_count },
        move |row, inner| block.left(&left, row, inner),
        move |inner, column| block.right(&right, inner, column),
        move |row, column, sum| store(outputs, (row * column_count + column) as usize, sum * block.scale),
    );
}

/// A part of a tile of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "matrix_product"))]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MatrixBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
) {
    product_of(id, push, left, right, outputs, Single { rows, columns });
}

/// A part of two tiles of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "matrix_product_double"))]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product_double(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MatrixBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    product_of(id, push, left, right, outputs, Double { rows, columns, more_columns });
}

/// A part of four tiles of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "matrix_product_quadruple"))]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product_quadruple(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MatrixBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut ShortShared,
    #[spirv(workgroup)] more_rows: &mut ShortShared,
    #[spirv(workgroup)] columns: &mut ShortShared,
    #[spirv(workgroup)] more_columns: &mut ShortShared,
) {
    product_of(id, push, left, right, outputs, Quadruple { rows, more_rows, columns, more_columns });
}

/// A part of two tiles of rows and columns, double-buffered: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "matrix_product_buffered"))]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product_buffered(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MatrixBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    product_of(id, push, left, right, outputs, Buffered { rows, columns, more_columns });
}

/// A part of a tile of rows and columns, by subgroups: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "matrix_product_subgroup"))]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product_subgroup(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(subgroup_id)] subgroup: u32,
    #[spirv(subgroup_local_invocation_id)] lane: u32,
    #[spirv(spec_constant(id = 1, default = 32))] size: u32,
    #[spirv(push_constant)] push: &Push<MatrixBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] left: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] right: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
) {
    product_of(id, push, left, right, outputs, Subgroup { size, subgroup, lane });
}

/// Weights of the scores in row number `first + id.x`; the parameter is how many columns a row has.
#[spirv(compute(threads(64), entry_point_name = "softmax_rows"))]
pub fn softmax_rows(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] scores: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let column_count = push.parameters;
    let first = ((push.piece.first + id.x) * column_count) as usize;
    let scale = softmax_scale(scores, first, column_count);
    let mut at = first;
    while at < first + column_count as usize {
        weights[at] = softmax_value(scores[at], scale);
        at += 1;
    }
}
