//! Linear layers.

use crate::Push;
use crate::tile::{Buffered, Double, Quadruple, Shape, Shared, ShortShared, Single, Subgroup, Tiles};
use crate::unchecked::{Endless, store};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::fetch::Fetch;
use viewfuse_kernels::network::linear::{LinearBlock, first_of_sum, input_value, rectified};

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn linear_layer(
    id: UVec3,
    push: &Push<LinearBlock>,
    inputs: &[f32],
    weights: &[f32],
    bias: &[f32],
    residual: &[f32],
    outputs: &mut [f32],
    tiles: impl Tiles,
) {
    let block = &push.parameters;
    let column_count = block.column_count;
    let (inputs, weights, bias, residual) = (Endless(inputs), Endless(weights), Endless(bias), Endless(residual));
    tiles.multiply(
        push.piece.first + id.x,
        Shape { row_count: block.row_count, inner_count: block.inner_count, column_count },
        move |row, inner| input_value(&inputs, block, row as usize, inner as usize),
        move |inner, column| weights.fetch((inner * column_count + column) as usize),
        move |row, column, sum| {
            let element = (row * column_count + column) as usize;
            let first = first_of_sum(&bias, &residual, block.has_residual, element, column as usize);
            store(outputs, element, rectified(first + sum, block.relu_outputs));
        },
    );
}

/// A part of a tile of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "linear"))]
#[allow(clippy::too_many_arguments)]
pub fn linear(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<LinearBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
) {
    linear_layer(id, push, inputs, weights, bias, residual, outputs, Single { rows, columns });
}

/// A part of two tiles of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "linear_double"))]
#[allow(clippy::too_many_arguments)]
pub fn linear_double(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<LinearBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    linear_layer(id, push, inputs, weights, bias, residual, outputs, Double { rows, columns, more_columns });
}

/// A part of four tiles of rows and columns: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "linear_quadruple"))]
#[allow(clippy::too_many_arguments)]
pub fn linear_quadruple(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<LinearBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut ShortShared,
    #[spirv(workgroup)] more_rows: &mut ShortShared,
    #[spirv(workgroup)] columns: &mut ShortShared,
    #[spirv(workgroup)] more_columns: &mut ShortShared,
) {
    linear_layer(
        id,
        push,
        inputs,
        weights,
        bias,
        residual,
        outputs,
        Quadruple { rows, more_rows, columns, more_columns },
    );
}

/// A part of two tiles of rows and columns, double-buffered: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "linear_buffered"))]
#[allow(clippy::too_many_arguments)]
pub fn linear_buffered(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<LinearBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    linear_layer(id, push, inputs, weights, bias, residual, outputs, Buffered { rows, columns, more_columns });
}

/// A part of a tile of rows and columns, by subgroups: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "linear_subgroup"))]
#[allow(clippy::too_many_arguments)]
pub fn linear_subgroup(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(subgroup_id)] subgroup: u32,
    #[spirv(subgroup_local_invocation_id)] lane: u32,
    #[spirv(spec_constant(id = 1, default = 32))] size: u32,
    #[spirv(push_constant)] push: &Push<LinearBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
) {
    linear_layer(id, push, inputs, weights, bias, residual, outputs, Subgroup { size, subgroup, lane });
}
