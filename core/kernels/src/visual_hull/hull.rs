//! The visual hull: the points inside the silhouettes of all views.

use super::{NO_SURFACE, ObjectBlock};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::{bilinear_channel_from, bilinear_from};
use viewfuse_core::math::max;

/// Least alpha at which a pixel can show the object: such a source pixel gets a depth.
pub const MIN_ALPHA: f32 = 0.1;
/// A point of the swept hull must have at least this alpha in every view that has it in front.
pub const SWEPT_ALPHA: f32 = 0.3;
/// A source ray enters the hull at this alpha: below [`SWEPT_ALPHA`], so that the boundary itself is swept.
pub const ENTRY_ALPHA: f32 = 0.6 * SWEPT_ALPHA;
/// Step of the search for the entry, in footprints.
pub const ENTRY_STEP: f32 = 2.0;
/// Most steps of that search. Only a view of a sliver of the object, at a very long focal length, would need more: its
/// steps are longer.
pub const MAX_ENTRY_STEPS: f32 = 8192.0;

/// A view's premultiplied colour and alpha at an image coordinate.
#[inline]
pub fn look_up(view: &CameraBlock, texels: &(impl Fetch<[f32; 4]> + ?Sized), x: f32, y: f32) -> [f32; 4] {
    bilinear_from(texels, view.first_texel as usize, view.width, view.height, x, y)
}

/// A view's alpha alone at an image coordinate.
#[inline]
pub fn look_up_alpha(view: &CameraBlock, texels: &(impl Fetch<[f32; 4]> + ?Sized), x: f32, y: f32) -> f32 {
    bilinear_channel_from(texels, view.first_texel as usize, view.width, view.height, x, y, 3)
}

/// How far the silhouettes allow a point to belong to the object: the least alpha over the views that have it in front
/// of them, in `[0, 1]`. Beyond a view's image its border's alpha goes on: an image with background at its border says
/// that the object is not there. 0 if the alpha falls below `least`, or if too few images contain the point.
#[inline]
pub fn hull_alpha(
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    point_world: Vec3,
    least: f32,
) -> f32 {
    let mut alpha = 1.0;
    let mut containing = 0;
    let mut view = 0;
    while view < object.view_count as usize {
        let camera = views.fetch(view);
        let seen = camera.project(point_world);
        if seen.in_front {
            containing += u32::from(seen.in_image);
            let here = look_up_alpha(&camera, texels, seen.x, seen.y);
            if here < alpha {
                alpha = here;
                if alpha < least {
                    return 0.0;
                }
            }
        }
        view += 1;
    }
    if containing < object.least_containing { 0.0 } else { alpha }
}

/// Depth at which the ray of a source pixel enters the hull; [`NO_SURFACE`] where it misses it or the pixel shows
/// background. `pixel` is the flat index in the view's image.
#[inline]
pub fn hull_entry(
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    view: u32,
    pixel: u32,
) -> f32 {
    let camera = views.fetch(view as usize);
    if texels.fetch((camera.first_texel + pixel) as usize)[3] < MIN_ALPHA {
        return NO_SURFACE;
    }
    let column = pixel % camera.width;
    let row = pixel / camera.width;
    let origin = camera.centre_world();
    let direction = camera.towards(column as f32 + 0.5, row as f32 + 0.5);
    let (enter, leave) = object.interval(origin, direction);
    let wanted = ENTRY_STEP * 0.5 * (enter + leave) / camera.intrinsics[0];
    let step = max(wanted, (leave - enter) / MAX_ENTRY_STEPS);
    let mut depth = enter;
    while depth < leave {
        if hull_alpha(object, views, texels, origin + direction * depth, ENTRY_ALPHA) > 0.0 {
            return depth;
        }
        // So far away that a step is below the rounding error of the depth: nothing can be found there.
        if !(depth + step > depth) {
            break;
        }
        depth += step;
    }
    NO_SURFACE
}
