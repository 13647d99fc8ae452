//! Layers of networks.

use crate::Push;
use crate::tile::{Buffered, Double, Quadruple, Shape, Shared, ShortShared, Single, Subgroup, Tiles};
use crate::unchecked::{Endless, store};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::fetch::Fetch;
use viewfuse_kernels::network::convolve::{ConvolveBlock, convolved, patch_value};
use viewfuse_kernels::network::depthwise::{DepthwiseBlock, depthwise_element};
use viewfuse_kernels::network::resample::{PoolBlock, UpsampleBlock, pooled_element, upsampled_element};
use viewfuse_kernels::network::transpose::TransposedBlock;

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn convolution(
    id: UVec3,
    push: &Push<ConvolveBlock>,
    inputs: &[f32],
    weights: &[f32],
    bias: &[f32],
    residual: &[f32],
    outputs: &mut [f32],
    tiles: impl Tiles,
) {
    let block = &push.parameters;
    let channels = block.out_channels;
    let (inputs, weights, bias, residual) = (Endless(inputs), Endless(weights), Endless(bias), Endless(residual));
    tiles.multiply(
        push.piece.first + id.x,
        Shape { row_count: block.pixel_count(), inner_count: block.patch_len(), column_count: channels },
        move |pixel, inner| patch_value(&inputs, block, pixel, inner),
        move |inner, channel| weights.fetch((inner * channels + channel) as usize),
        move |pixel, channel, sum| {
            let value = convolved(&bias, &residual, block, pixel, channel, sum);
            store(outputs, block.place(pixel, channel), value);
        },
    );
}

/// A part of a tile of pixels and output channels: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<ConvolveBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
) {
    convolution(id, push, inputs, weights, bias, residual, outputs, Single { rows, columns });
}

/// A part of two tiles of pixels and output channels: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_double"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_double(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<ConvolveBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    convolution(id, push, inputs, weights, bias, residual, outputs, Double { rows, columns, more_columns });
}

/// A part of four tiles of pixels and output channels: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_quadruple"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_quadruple(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<ConvolveBlock>,
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
    convolution(
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

/// A part of two tiles of pixels and output channels, double-buffered: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_buffered"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_buffered(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<ConvolveBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    convolution(id, push, inputs, weights, bias, residual, outputs, Buffered { rows, columns, more_columns });
}

/// A part of a tile of pixels and output channels, by subgroups: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_subgroup"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_subgroup(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(subgroup_id)] subgroup: u32,
    #[spirv(subgroup_local_invocation_id)] lane: u32,
    #[spirv(spec_constant(id = 1, default = 32))] size: u32,
    #[spirv(push_constant)] push: &Push<ConvolveBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
) {
    convolution(id, push, inputs, weights, bias, residual, outputs, Subgroup { size, subgroup, lane });
}

/// Channel of an output pixel number `first + id.x`, flat in `[row][column][channel]`.
#[spirv(compute(threads(64), entry_point_name = "convolve_depthwise"))]
pub fn convolve_depthwise(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<DepthwiseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] outputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    outputs[element] = depthwise_element(inputs, weights, &push.parameters, element);
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn transposed_convolution(
    id: UVec3,
    push: &Push<TransposedBlock>,
    inputs: &[f32],
    weights: &[f32],
    bias: &[f32],
    outputs: &mut [f32],
    tiles: impl Tiles,
) {
    let block = &push.parameters;
    let column_count = block.column_count();
    let (inputs, weights, bias) = (Endless(inputs), Endless(weights), Endless(bias));
    tiles.multiply(
        push.piece.first + id.x,
        Shape { row_count: block.pixel_count(), inner_count: block.in_channels, column_count },
        move |pixel, inner| block.input(&inputs, pixel, inner),
        move |inner, column| weights.fetch((inner * column_count + column) as usize),
        move |pixel, column, sum| store(outputs, block.place(pixel, column), block.output(&bias, column, sum)),
    );
}

/// A part of a tile of input pixels and what they become: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_transposed"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<TransposedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
) {
    transposed_convolution(id, push, inputs, weights, bias, outputs, Single { rows, columns });
}

/// A part of two tiles of input pixels and what they become: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_transposed_double"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed_double(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<TransposedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    transposed_convolution(id, push, inputs, weights, bias, outputs, Double { rows, columns, more_columns });
}

/// A part of four tiles of input pixels and what they become: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_transposed_quadruple"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed_quadruple(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<TransposedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut ShortShared,
    #[spirv(workgroup)] more_rows: &mut ShortShared,
    #[spirv(workgroup)] columns: &mut ShortShared,
    #[spirv(workgroup)] more_columns: &mut ShortShared,
) {
    transposed_convolution(
        id,
        push,
        inputs,
        weights,
        bias,
        outputs,
        Quadruple { rows, more_rows, columns, more_columns },
    );
}

/// A part of two tiles of input pixels and what they become, double-buffered: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_transposed_buffered"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed_buffered(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<TransposedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] outputs: &mut [f32],
    #[spirv(workgroup)] rows: &mut Shared,
    #[spirv(workgroup)] columns: &mut Shared,
    #[spirv(workgroup)] more_columns: &mut Shared,
) {
    transposed_convolution(id, push, inputs, weights, bias, outputs, Buffered { rows, columns, more_columns });
}

/// A part of a tile of input pixels and what they become, by subgroups: invocation `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "convolve_transposed_subgroup"))]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed_subgroup(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(subgroup_id)] subgroup: u32,
    #[spirv(subgroup_local_invocation_id)] lane: u32,
    #[spirv(spec_constant(id = 1, default = 32))] size: u32,
    #[spirv(push_constant)] push: &Push<TransposedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] outputs: &mut [f32],
) {
    transposed_convolution(id, push, inputs, weights, bias, outputs, Subgroup { size, subgroup, lane });
}

/// Channel of an output pixel number `first + id.x`, flat in `[row][column][channel]`.
#[spirv(compute(threads(64), entry_point_name = "max_pool"))]
pub fn max_pool(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<PoolBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] outputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    outputs[element] = pooled_element(inputs, &push.parameters, element);
}

/// Input channel of an output pixel number `first + id.x`, flat in `[row][column][channel]`.
#[spirv(compute(threads(64), entry_point_name = "upsample"))]
pub fn upsample(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<UpsampleBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] outputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = (push.piece.first + id.x) as usize;
    outputs[block.place(element)] = upsampled_element(inputs, block, element);
}
