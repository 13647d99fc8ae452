//! The depths of source pixels: the entry of their rays into the visual hull, and the plane sweep behind it.

use crate::Push;
use crate::loads::{CameraWords, Cameras, Fours};
use spirv_std::glam::{UVec3, Vec4};
use spirv_std::spirv;
use viewfuse_core::fetch::{Fetch, StartingAt};
use viewfuse_kernels::pages::{Pages, PagesMut};
use viewfuse_kernels::visual_hull::sweep::{OUTSIDE, SweepBlock, SweptPixel};
use viewfuse_kernels::visual_hull::{ObjectBlock, hull, sweep};

/// Where the ray of pixel number `first + id.x` of a view, the parameter, enters the hull.
#[spirv(compute(threads(64), entry_point_name = "hull_entry"))]
#[allow(clippy::too_many_arguments)]
pub fn hull_entry(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] object: &ObjectBlock,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] texels_a: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] texels_b: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] texels_c: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] texels_d: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 6)] entries_a: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 7)] entries_b: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 8)] entries_c: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 9)] entries_d: &mut [f32],
    #[spirv(spec_constant(id = 0, default = 0))] page_shift: u32,
) {
    if id.x >= push.piece.count {
        return;
    }
    let views = Cameras(views);
    let view = push.parameters;
    let pixel = push.piece.first + id.x;
    let texels = Pages { a: texels_a, b: texels_b, c: texels_c, d: texels_d, shift: page_shift };
    let mut entries = PagesMut { a: entries_a, b: entries_b, c: entries_c, d: entries_d, shift: page_shift };
    let entry = hull::hull_entry(object, &views, &texels, view, pixel);
    entries.store((views.fetch(view as usize).first_texel + pixel) as usize, entry);
}

/// Matching costs of the other views at all planes of pixel number `first + id.x` of the band.
#[spirv(compute(threads(64), entry_point_name = "match_cost"))]
#[allow(clippy::too_many_arguments)]
pub fn match_cost(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<SweepBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] object: &ObjectBlock,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] texels_a: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] texels_b: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] texels_c: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] texels_d: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 6)] entries_a: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 7)] entries_b: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 8)] entries_c: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 9)] entries_d: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 10)] pair_weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 11)] costs: &mut [f32],
    #[spirv(spec_constant(id = 0, default = 0))] page_shift: u32,
) {
    if id.x >= push.piece.count {
        return;
    }
    let sweep = &push.parameters;
    let pixel = push.piece.first + id.x;
    let texels = Pages { a: texels_a, b: texels_b, c: texels_c, d: texels_d, shift: page_shift };
    let entries = Pages { a: entries_a, b: entries_b, c: entries_c, d: entries_d, shift: page_shift };
    let (views, texels) = (Cameras(views), Fours(&texels));
    let swept = SweptPixel::new(sweep, &views, &texels, &entries, sweep.first_row * sweep.width + pixel);
    let (first, end) = swept.planes(object, sweep);
    let costs_of_pixel = pixel * sweep.plane_count;
    let mut plane = 0;
    while plane < first {
        costs[(costs_of_pixel + plane) as usize] = OUTSIDE;
        plane += 1;
    }
    while plane < end {
        costs[(costs_of_pixel + plane) as usize] =
            swept.match_cost(object, sweep, &views, &texels, &entries, pair_weights, plane);
        plane += 1;
    }
    while plane < sweep.plane_count {
        costs[(costs_of_pixel + plane) as usize] = OUTSIDE;
        plane += 1;
    }
}

/// Costs summed over a window's columns at plane and pixel number `first + id.x` of the band.
#[spirv(compute(threads(64), entry_point_name = "sum_row"))]
pub fn sum_row(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<SweepBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] costs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] row_sums: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let sweep = &push.parameters;
    let element = push.piece.first + id.x;
    row_sums[element as usize] = sweep::sum_row(sweep, costs, element / sweep.plane_count, element % sweep.plane_count);
}

/// Costs averaged over a window at plane and pixel number `first + id.x` of the band.
#[spirv(compute(threads(64), entry_point_name = "mean_column"))]
pub fn mean_column(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<SweepBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] costs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] row_sums: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] means: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let sweep = &push.parameters;
    let element = push.piece.first + id.x;
    means[element as usize] =
        sweep::mean_column(sweep, costs, row_sums, element / sweep.plane_count, element % sweep.plane_count);
}

/// The depth of least cost of pixel number `first + id.x` of the band.
///
/// `entries`, `guess` and `picked` are maps of all views, of which the band is a part.
#[spirv(compute(threads(64), entry_point_name = "pick_depth"))]
#[allow(clippy::too_many_arguments)]
pub fn pick_depth(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<SweepBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] object: &ObjectBlock,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] means: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] entries_a: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] entries_b: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] entries_c: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 6)] entries_d: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 7)] guess_a: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 8)] guess_b: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 9)] guess_c: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 10)] guess_d: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 11)] picked_a: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 12)] picked_b: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 13)] picked_c: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 14)] picked_d: &mut [f32],
    #[spirv(spec_constant(id = 0, default = 0))] page_shift: u32,
) {
    if id.x >= push.piece.count {
        return;
    }
    let sweep = &push.parameters;
    let pixel = push.piece.first + id.x;
    let first = (Cameras(views).fetch(sweep.view as usize).first_texel + sweep.first_row * sweep.width) as usize;
    let entries = Pages { a: entries_a, b: entries_b, c: entries_c, d: entries_d, shift: page_shift };
    let guess = Pages { a: guess_a, b: guess_b, c: guess_c, d: guess_d, shift: page_shift };
    let mut picked = PagesMut { a: picked_a, b: picked_b, c: picked_c, d: picked_d, shift: page_shift };
    let depth = sweep::pick_depth(
        object,
        sweep,
        means,
        &StartingAt { all: &entries, first },
        &StartingAt { all: &guess, first },
        pixel,
    );
    picked.store(first + pixel as usize, depth);
}
