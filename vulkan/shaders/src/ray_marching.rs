//! Ray marching for a target pixel.

use crate::Push;
use crate::loads::{CameraWords, Cameras, Fours};
use spirv_std::glam::{UVec3, Vec4};
use spirv_std::spirv;
use viewfuse_kernels::pages::{Pages, PagesMut};
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_kernels::visual_hull::ray_marching::MarchBlock;

/// The ray of pixel number `first + id.x` of the target through the solid.
#[spirv(compute(threads(64), entry_point_name = "march_rays"))]
#[allow(clippy::too_many_arguments)]
pub fn march_rays(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MarchBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] object: &ObjectBlock,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] footprints: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] texels_a: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] texels_b: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] texels_c: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 6)] texels_d: &[Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 7)] depths_a: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 8)] depths_b: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 9)] depths_c: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 10)] depths_d: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 11)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 12)] colours_a: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 13)] colours_b: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 14)] colours_c: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 15)] colours_d: &mut [Vec4],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 16)] pixel_depths_a: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 17)] pixel_depths_b: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 18)] pixel_depths_c: &mut [f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 19)] pixel_depths_d: &mut [f32],
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
    let depths = Pages { a: depths_a, b: depths_b, c: depths_c, d: depths_d, shift: page_shift };
    let mut colours = PagesMut { a: colours_a, b: colours_b, c: colours_c, d: colours_d, shift: page_shift };
    let mut pixel_depths =
        PagesMut { a: pixel_depths_a, b: pixel_depths_b, c: pixel_depths_c, d: pixel_depths_d, shift: page_shift };
    let seen = viewfuse_kernels::visual_hull::ray_marching::march_ray(
        object,
        &Cameras(views),
        footprints,
        &Fours(&texels),
        &depths,
        weights,
        block,
        at,
    );
    colours.store(pixel as usize, Vec4::new(seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity));
    pixel_depths.store(pixel as usize, seen.depth);
}
