//! A target pixel's ray through the solid.

use super::ObjectBlock;
use super::shade::sample;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{clamp, floor_to_i32};

/// Length of a step, in footprints of the target.
pub const STEP: f32 = 1.0;
/// Most steps of a ray.
pub const MAX_STEPS: u32 = 1024;

/// A target whose rays are marched, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MarchBlock {
    /// The target camera.
    pub target: CameraBlock,
    /// The background's colour, red green blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Transmittance at which a ray may end early.
    pub termination: f32,
}

const _: () = assert!(size_of::<MarchBlock>() == 96);

/// Colour, depth along the principal axis and opacity of the target's ray through the image coordinate `(x, y)`.
///
/// The ray is marched through the object's box in equal steps of at most a footprint; it ends where the transmittance
/// is at most `block.termination` (early termination), which changes no channel by more than that. The depth of a ray
/// that is less than half hidden is 0: its mean depth is not meaningful.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn march_ray(
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    footprints: &[f32],
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    depths: &(impl Fetch<f32> + ?Sized),
    weights: &[f32],
    block: &MarchBlock,
    at: [f32; 2],
) -> Composite<3> {
    let target = &block.target;
    let mut ray = Compositor::<3>::START;
    let origin = target.centre_world();
    let direction = target.towards(at[0], at[1]);
    let (enter, leave) = object.interval(origin, direction);
    if enter < leave {
        let footprint = 0.5 * (enter + leave) / target.intrinsics[0];
        let wanted = clamp((leave - enter) / (STEP * footprint), 1.0, (MAX_STEPS - 1) as f32);
        let step_count = floor_to_i32(wanted) as u32 + 1;
        let step = (leave - enter) / step_count as f32;
        let mut index = 0;
        while index < step_count && !ray.is_terminated(block.termination) {
            let depth = enter + (index as f32 + 0.5) * step;
            let here = sample(object, views, footprints, texels, depths, weights, origin + direction * depth);
            ray.add_solid(&here.colour, here.occupancy, depth);
            index += 1;
        }
    }
    let seen = ray.finish(&block.background, 0.0);
    if seen.opacity < 0.5 { Composite { depth: 0.0, ..seen } } else { seen }
}
