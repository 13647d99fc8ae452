//! Lists of samples, and whether numbers are finite.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_kernels::compact;
use viewfuse_kernels::finite;

/// Run number `first + id.x` of the elements.
#[spirv(compute(threads(64), entry_point_name = "count_marked"))]
pub fn count_marked(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] mask: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] counts: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let run = push.piece.first + id.x;
    counts[run as usize] = compact::marked_in_run(mask, push.parameters, run);
}

/// All runs: there is one invocation.
#[spirv(compute(threads(64), entry_point_name = "sum_counts"))]
pub fn sum_counts(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] counts: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] offsets: &mut [u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] total: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    compact::run_offsets(counts, push.parameters, |run, offset| {
        offsets[run] = offset;
        total[0] = offset;
    });
}

/// Run number `first + id.x` of the elements.
#[spirv(compute(threads(64), entry_point_name = "list_marked"))]
pub fn list_marked(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] mask: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] offsets: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] list: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let run = push.piece.first + id.x;
    compact::list_run(mask, offsets, push.parameters, run, |place, element| list[place] = element);
}

/// Run number `first + id.x` of the numbers.
#[spirv(compute(threads(64), entry_point_name = "find_non_finite"))]
pub fn find_non_finite(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] values: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] firsts: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let run = push.piece.first + id.x;
    firsts[run as usize] = finite::first_non_finite(values, push.parameters, run);
}
