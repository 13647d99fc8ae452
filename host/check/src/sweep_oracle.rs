//! The kernels of [`viewfuse_kernels::plane_sweep`] evaluated in `f64` from their documentation, with bounds on the
//! error of `f32`.
//!
//! `None` means undecided: a value lies so near to a threshold that `f32` may fall on either side of it.

mod blended;
mod consistency;
mod costs;
mod evidence;
mod front;
mod paths;
mod picked;

pub use blended::{Pixel, blend};
pub use consistency::confirmed;
pub use costs::{census_cost, row_sums, window_cost};
pub use evidence::{Found, evidence};
pub use front::{front_cost, plane_opacity};
pub use paths::{follow_path, joined_cost};
pub use picked::pick_disparity;

use crate::bounded::{Bounded, ROUNDING};
use crate::camera_oracle::{Tents, Vector, along, axes, centre, dot, inside, tents, towards};
use viewfuse_core::camera::CameraBlock;
use viewfuse_kernels::plane_sweep::frustum::MIN_DEPTH;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// A number for each of some neighbouring planes.
pub type BoundedPlanes = [Bounded; PLANES];

/// The share of the width of a bell that a plane behind is: one over the square root of 2.
const BEHIND: f32 = 0.707_106_77;

/// Disparity of a plane.
fn disparity(far_disparity: f32, disparity_step: f32, plane: usize) -> Bounded {
    Bounded::from(far_disparity) + Bounded::from(plane as u32) * Bounded::from(disparity_step)
}

/// Where a point of a frustum appears in a view.
#[derive(Clone, Copy, Debug)]
struct PlaneProjection {
    x: Bounded,
    y: Bounded,
    /// The depth in the view over that in the frustum.
    depth_ratio: Bounded,
    /// Whether it is in front of the view and inside its image.
    in_image: Option<bool>,
}

/// Where the point of this disparity on the ray through `at` appears.
fn project_plane(camera: &CameraBlock, view: &CameraBlock, at: [f32; 2], disparity: Bounded) -> PlaneProjection {
    let (origin, other) = (centre(camera), centre(view));
    let axes = axes(view);
    let in_view = |vector: Vector| axes.map(|axis| dot(axis, vector));
    let far = in_view(towards(camera, at));
    let slope = in_view([0, 1, 2].map(|axis| origin[axis] - other[axis]));
    let place = along(far, slope, disparity);
    let least = Bounded::from(MIN_DEPTH);
    let depth_ratio = place[2].greater(least);
    let [focal_x, focal_y, principal_x, principal_y] = view.intrinsics.map(Bounded::from);
    let inverse = Bounded::ONE / depth_ratio;
    let x = focal_x * (place[0] * inverse) + principal_x;
    let y = focal_y * (place[1] * inverse) + principal_y;
    PlaneProjection { x, y, depth_ratio, in_image: inside(view, least.below(place[2]), x, y) }
}

/// Bilinear mixture of numbers that have errors themselves, however it is written: by differences or by shares.
fn mixed(node: impl Fn(usize, usize) -> Bounded, columns: &Tents, rows: &Tents) -> Bounded {
    let (mut value, mut least, mut greatest, mut brought) = (0.0, f64::MAX, f64::MIN, 0.0_f64);
    for (row, height) in &rows.nodes {
        for (column, width) in &columns.nodes {
            let node = node(*row, *column);
            value += width * height * node.value;
            least = node.value.min(least);
            greatest = node.value.max(greatest);
            brought = node.error.max(brought);
        }
    }
    // Two shares and their product, a product and three sums.
    let rounding = 6.0 * ROUNDING * least.abs().max(greatest.abs());
    Bounded { value, error: (columns.error + rows.error) * (greatest - least + 2.0 * brought) + brought + rounding }
}

/// Bilinear look-up of premultiplied RGBA.
fn look_up(camera: &CameraBlock, texels: &[[f32; 4]], x: Bounded, y: Bounded) -> [Bounded; 4] {
    let (columns, rows) = (tents(x, camera.width), tents(y, camera.height));
    let at = |row: usize, column: usize| camera.first_texel as usize + row * camera.width as usize + column;
    std::array::from_fn(|channel| mixed(|row, column| texels[at(row, column)][channel].into(), &columns, &rows))
}

/// Numbers without error.
fn exact(planes: &Planes) -> BoundedPlanes {
    planes.map(Bounded::from)
}
