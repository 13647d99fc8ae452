//! The plane sweep: views compared on planes, costs averaged and joined along lines, disparities picked, pixels blended.

use crate::Push;
use crate::loads::{Fours, Groups, PlaneVectors, Twos, ViewWords, Views, plane_vectors};
use spirv_std::glam::{UVec3, Vec2, Vec4};
use spirv_std::spirv;
use viewfuse_kernels::pages::{Pages, PagesMut};
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::{self, BlendBlock};
use viewfuse_kernels::plane_sweep::census;
use viewfuse_kernels::plane_sweep::disparity;
use viewfuse_kernels::plane_sweep::evidence::{self, ViewPair};
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::path::{self, CostBlock, Line};
use viewfuse_kernels::plane_sweep::window::{self, WindowBlock};

/// What the views show on group and pixel number `first + id.x` of the band.
#[spirv(compute(threads(64), entry_point_name = "compare_views"))]
#[allow(clippy::too_many_arguments)]
pub fn compare_views(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FrustumBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[ViewWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] pairs: &[ViewPair],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] texels: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] disparities: &[Vec2],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] grey: &mut [PlaneVectors],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] evidence: &mut [PlaneVectors],
) {
    if id.x >= push.piece.count {
        return;
    }
    let frustum = &push.parameters;
    let element = push.piece.first + id.x;
    let band = frustum.row_count * frustum.camera.width * frustum.group_count;
    let pixel = frustum.first_row * frustum.camera.width + element / frustum.group_count;
    let group = element % frustum.group_count;
    let found = evidence::evidence(frustum, &Views(views), pairs, &Fours(texels), &Twos(disparities), pixel, group);
    let mut view = 0;
    while view < frustum.view_count {
        grey[(view * band + element) as usize] = plane_vectors(&found.grey[view as usize]);
        view += 1;
    }
    let at = 4 * element as usize;
    evidence[at] = plane_vectors(&found.difference);
    evidence[at + 1] = plane_vectors(&found.weight);
    evidence[at + 2] = plane_vectors(&found.dissent);
    evidence[at + 3] = plane_vectors(&found.hull);
}

/// The costs of group and pixel number `first + id.x` of the band.
#[spirv(compute(threads(64), entry_point_name = "census_cost"))]
pub fn census_cost(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FrustumBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] pairs: &[ViewPair],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] grey: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] evidence: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] costs: &mut [Planes],
) {
    if id.x >= push.piece.count {
        return;
    }
    let frustum = &push.parameters;
    let element = push.piece.first + id.x;
    let (pixel, group) = (element / frustum.group_count, element % frustum.group_count);
    let [cost, weight] = census::census_cost(frustum, pairs, grey, evidence, pixel, group);
    let first = frustum.first_row * frustum.camera.width * frustum.group_count;
    let at = 2 * (first + element) as usize;
    costs[at] = cost;
    costs[at + 1] = weight;
}

/// Costs summed over a row's part of the windows around group and pixel number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "row_sums"))]
pub fn row_sums(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<WindowBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] costs: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] sums: &mut [Planes],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let found = window::row_sums(block, costs, element / block.group_count, element % block.group_count);
    let mut window = 0;
    while window < 3 {
        let at = 6 * element as usize + 2 * window;
        sums[at] = found[window][0];
        sums[at + 1] = found[window][1];
        window += 1;
    }
}

/// The cost of group and pixel number `first + id.x`, averaged over the windows.
#[spirv(compute(threads(64), entry_point_name = "window_cost"))]
pub fn window_cost(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<WindowBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] sums: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] means: &mut [Planes],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    means[element as usize] =
        window::window_cost(block, sums, element / block.group_count, element % block.group_count);
}

/// The joined costs of line number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "follow_paths"))]
pub fn follow_paths(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<CostBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] means: &[PlaneVectors],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] paths: &mut [PlaneVectors],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let groups = block.group_count as usize;
    let (direction, number, step_count) = block.line(push.piece.first + id.x);
    let line = (direction * block.width * block.height + number * step_count) as usize * groups;
    let mut state = Line::START;
    let mut step = 0;
    while step < step_count {
        state.advance(&Groups(means), block.pixel(direction, number, step) as usize * groups, groups);
        let mut group = 0;
        while group < groups {
            paths[line + step as usize * groups + group] = plane_vectors(&state.costs(group));
            group += 1;
        }
        step += 1;
    }
}

/// The cost of group and pixel number `first + id.x`: the mean of the directions' costs.
#[spirv(compute(threads(64), entry_point_name = "join_paths"))]
pub fn join_paths(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<CostBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] paths: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] costs: &mut [Planes],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    costs[element as usize] = path::joined_cost(block, paths, element / block.group_count, element % block.group_count);
}

/// Disparity and confidence of pixel number `first + id.x` of a view.
#[spirv(compute(threads(64), entry_point_name = "pick_disparity"))]
pub fn pick_disparity(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FrustumBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] costs: &[Planes],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] disparities: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let frustum = &push.parameters;
    let pixel = push.piece.first + id.x;
    disparities[(frustum.camera.first_texel + pixel) as usize] = disparity::pick_disparity(frustum, costs, pixel);
}

/// Pixel number `first + id.x` of the target, blended from the planes.
#[spirv(compute(threads(64), entry_point_name = "blend_planes"))]
#[allow(clippy::too_many_arguments)]
pub fn blend_planes(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<BlendBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[ViewWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] texels_a: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] texels_b: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] texels_c: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] texels_d: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] disparities: &[Vec2],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 6)] costs: &[PlaneVectors],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 7)] colours_a: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 8)] colours_b: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 9)] colours_c: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 10)] colours_d: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 11)] pixel_depths: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 12)] confidences: &mut [f32],
    #[spirv(spec_constant(id = 0, default = 0))] page_shift: u32,
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let pixel = push.piece.first + id.x;
    let width = block.target.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let texels = Pages { a: texels_a, b: texels_b, c: texels_c, d: texels_d, shift: page_shift };
    let mut colours = PagesMut { a: colours_a, b: colours_b, c: colours_c, d: colours_d, shift: page_shift };
    let seen = blend::blend(block, &Views(views), &Fours(&texels), &Twos(disparities), &Groups(costs), at);
    colours.store(pixel as usize, Vec4::from_array(seen.colour));
    pixel_depths[pixel as usize] = seen.depth;
    confidences[pixel as usize] = seen.confidence;
}
