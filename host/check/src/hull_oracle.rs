//! The kernels of [`viewfuse_kernels::visual_hull`] evaluated in `f64` from their documentation, with bounds on the
//! error of `f32`.
//!
//! `None` means undecided: a value lies so near to a threshold that `f32` may fall on either side of it.

mod shade;
mod sweep;

pub use shade::{Colour, Pixel, depth_at, march_ray, sample};
pub use sweep::{match_cost, mean_column, pick_depth, sum_row};

use crate::bounded::{Bounded, ROUNDING};
use crate::camera_oracle::{BoundedProjection, Vector, along, bilinear, centre, project, tents, towards};
use viewfuse_core::camera::CameraBlock;
use viewfuse_kernels::visual_hull::hull::{ENTRY_ALPHA, ENTRY_STEP, MIN_ALPHA};
use viewfuse_kernels::visual_hull::{NO_SURFACE, ObjectBlock};

/// The depth of a pixel without a surface; the same number in both precisions.
pub const NOWHERE: Bounded = Bounded { value: NO_SURFACE as f64, error: 0.0 };

/// Visibility at `b` widths behind a surface: `(1 - b^2 / 4)^4`, 0 from two widths on.
pub(crate) fn bell(b: Bounded) -> Bounded {
    (Bounded::ONE - b.squared() / Bounded::from(4.0)).greater(Bounded::ZERO).squared().squared()
}

/// The views and the object of the kernels.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The box.
    pub object: &'a ObjectBlock,
    /// The cameras.
    pub views: &'a [CameraBlock],
    /// All images behind one another.
    pub texels: &'a [[f32; 4]],
}

/// Bilinear look-up of premultiplied RGBA.
fn look_up(camera: &CameraBlock, texels: &[[f32; 4]], x: Bounded, y: Bounded) -> [Bounded; 4] {
    std::array::from_fn(|channel| {
        let node = |row: usize, column: usize| {
            texels[camera.first_texel as usize + row * camera.width as usize + column][channel]
        };
        bilinear(node, &tents(x, camera.width), &tents(y, camera.height))
    })
}

/// Half the diagonal of the box.
fn radius(object: &ObjectBlock) -> Bounded {
    let squares = (0..3).map(|axis| (f64::from(object.high[axis]) - f64::from(object.low[axis])).powi(2));
    let value = squares.sum::<f64>().sqrt() / 2.0;
    Bounded { value, error: 4.0 * ROUNDING * value }
}

/// Where a ray enters and leaves the box (slabs); `enter >= leave` if it misses it.
fn interval(object: &ObjectBlock, origin: Vector, direction: Vector) -> (Bounded, Bounded) {
    let (mut enter, mut leave) = (Bounded::ZERO, NOWHERE);
    for axis in 0..3 {
        let low = (Bounded::from(object.low[axis]) - origin[axis]) / direction[axis];
        let high = (Bounded::from(object.high[axis]) - origin[axis]) / direction[axis];
        enter = enter.greater(low.lesser(high));
        leave = leave.lesser(low.greater(high));
    }
    (enter, leave)
}

/// Least alpha over the views that have a point in front of them; 0 if below `least` or if too few contain it.
pub fn hull_alpha(scene: &Scene, point_world: Vector, least: f32) -> Option<Bounded> {
    let mut alpha = Bounded::ONE;
    let (mut sure, mut unsure, mut undecided) = (0, 0, false);
    for view in scene.views {
        let seen = project(view, point_world);
        if seen.in_front == Some(false) {
            continue;
        }
        // Beyond the image that of its border.
        let here = look_up(view, scene.texels, seen.x, seen.y)[3];
        match (seen.in_front, here.below(least.into())) {
            // One view that surely says no is enough, whatever the others say.
            (Some(true), Some(true)) => return Some(Bounded::ZERO),
            (Some(true), Some(false)) => {}
            _ => undecided = true,
        }
        match seen.in_image {
            Some(true) => sure += 1,
            Some(false) => {}
            None => (unsure, undecided) = (unsure + 1, true),
        }
        alpha = alpha.lesser(here);
    }
    if sure + unsure < scene.object.least_containing {
        return Some(Bounded::ZERO);
    }
    (!undecided && sure >= scene.object.least_containing).then_some(alpha)
}

/// Depth of the first of the points, a step apart, at which the ray of a pixel is inside the hull.
pub fn hull_entry(scene: &Scene, view: u32, pixel: u32) -> Option<Bounded> {
    let camera = &scene.views[view as usize];
    if scene.texels[(camera.first_texel + pixel) as usize][3] < MIN_ALPHA {
        return Some(NOWHERE);
    }
    let at = [(pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5];
    let (origin, direction) = (centre(camera), towards(camera, at));
    let (enter, leave) = interval(scene.object, origin, direction);
    let step = Bounded::from(ENTRY_STEP) * (enter + leave) / (Bounded::from(2.0) * Bounded::from(camera.intrinsics[0]));
    let mut depth = enter;
    while depth.below(leave)? {
        if hull_alpha(scene, along(origin, direction, depth), ENTRY_ALPHA)?.value > 0.0 {
            return Some(depth);
        }
        depth = depth + step;
    }
    Some(NOWHERE)
}
