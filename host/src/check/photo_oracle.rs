//! The kernels of [`viewfuse_core::photo`] evaluated in `f64` from their documentation, with bounds on what `f32` may
//! make of them.
//!
//! `None` means that rounding decides: a value lies so near to a threshold that `f32` may fall on either side of it.

mod shade;
mod sweep;

pub use shade::{Colour, Pixel, depth_at, march, sample};
pub use sweep::{match_cost, mean_column, pick_depth, sum_row};

use crate::check::bounded::{Bounded, ROUNDING};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::photo::hull::{ENTRY_ALPHA, ENTRY_STEP, LEAST_ALPHA};
use viewfuse_core::photo::{NO_SURFACE, ObjectBlock};

/// What nothing is seen at; the same number in both precisions.
pub const NOWHERE: Bounded = Bounded { value: NO_SURFACE as f64, error: 0.0 };

/// A point or a direction.
pub type Vector = [Bounded; 3];

/// A point known exactly.
pub fn point(coordinates: [f32; 3]) -> Vector {
    coordinates.map(Bounded::from)
}

/// Visibility at `b` widths behind a surface: `(1 - b^2 / 4)^4`, 0 from two widths on.
fn bell(b: Bounded) -> Bounded {
    (Bounded::ONE - b.squared() / Bounded::from(4.0)).greater(Bounded::ZERO).squared().squared()
}

fn dot(a: Vector, b: Vector) -> Bounded {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `origin + direction * t`.
fn along(origin: Vector, direction: Vector, t: Bounded) -> Vector {
    [0, 1, 2].map(|axis| origin[axis] + direction[axis] * t)
}

/// The views and the object that kernels look at.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The box.
    pub object: &'a ObjectBlock,
    /// The cameras.
    pub views: &'a [CameraBlock],
    /// All images behind one another.
    pub texels: &'a [[f32; 4]],
}

fn centre(camera: &CameraBlock) -> Vector {
    point([camera.pose.right[3], camera.pose.down[3], camera.pose.forward[3]])
}

fn axes(camera: &CameraBlock) -> [Vector; 3] {
    [camera.pose.right, camera.pose.down, camera.pose.forward].map(|axis| point([axis[0], axis[1], axis[2]]))
}

/// World direction through an image coordinate, 1 along the principal axis.
fn towards(camera: &CameraBlock, at: [f32; 2]) -> Vector {
    let [focal_x, focal_y, middle_x, middle_y] = camera.intrinsics.map(Bounded::from);
    let across = (Bounded::from(at[0]) - middle_x) / focal_x;
    let below = (Bounded::from(at[1]) - middle_y) / focal_y;
    let [right, down, forward] = axes(camera);
    [0, 1, 2].map(|axis| right[axis] * across + down[axis] * below + forward[axis])
}

/// Image coordinates and depth of a point.
#[derive(Clone, Copy, Debug)]
struct Seen {
    x: Bounded,
    y: Bounded,
    depth: Bounded,
    /// Whether the point is in front of the camera and inside its image.
    in_image: Option<bool>,
}

fn project(camera: &CameraBlock, point_world: Vector) -> Seen {
    let origin = centre(camera);
    let offset = [0, 1, 2].map(|axis| point_world[axis] - origin[axis]);
    let [right, down, forward] = axes(camera);
    let depth = dot(forward, offset);
    let [focal_x, focal_y, middle_x, middle_y] = camera.intrinsics.map(Bounded::from);
    // In homogeneous coordinates: the intrinsics first, then one division.
    let x = (focal_x * dot(right, offset) + middle_x * depth) / depth;
    let y = (focal_y * dot(down, offset) + middle_y * depth) / depth;
    let answers = [
        Bounded::ZERO.below(depth),
        x.below(Bounded::ZERO).map(|out| !out),
        y.below(Bounded::ZERO).map(|out| !out),
        Bounded::from(camera.width).below(x).map(|out| !out),
        Bounded::from(camera.height).below(y).map(|out| !out),
    ];
    let in_image = if answers.contains(&Some(false)) {
        Some(false)
    } else if answers.contains(&None) {
        None
    } else {
        Some(true)
    };
    Seen { x, y, depth, in_image }
}

/// Nodes of a grid that a coordinate may touch, each with its tent's height; and the error of those heights.
fn tents(coordinate: Bounded, count: u32) -> (Vec<(usize, f64)>, f64) {
    let last = f64::from(count - 1);
    let position = (coordinate.value - 0.5).clamp(0.0, last);
    let error = coordinate.error + ROUNDING * (position + 1.0);
    let low = (coordinate.value - 0.5 - error).clamp(0.0, last).floor();
    let high = (coordinate.value - 0.5 + error).clamp(0.0, last).ceil();
    let tent = |node: usize| (node, (1.0 - (position - node as f64).abs()).max(0.0));
    ((low as usize..=high as usize).map(tent).collect(), error)
}

/// Bilinear look-up of premultiplied RGBA. An error of the coordinates costs as much as the image changes over it.
fn look_up(camera: &CameraBlock, texels: &[[f32; 4]], x: Bounded, y: Bounded) -> [Bounded; 4] {
    let ((columns, error_x), (rows, error_y)) = (tents(x, camera.width), tents(y, camera.height));
    std::array::from_fn(|channel| {
        let (mut value, mut least, mut greatest) = (0.0, f64::MAX, f64::MIN);
        for (row, height) in &rows {
            for (column, width) in &columns {
                let at = camera.first_texel as usize + row * camera.width as usize + column;
                let node = f64::from(texels[at][channel]);
                value += width * height * node;
                least = node.min(least);
                greatest = node.max(greatest);
            }
        }
        let error = (error_x + error_y) * (greatest - least) + 4.0 * ROUNDING * least.abs().max(greatest.abs());
        Bounded { value, error }
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

/// Least alpha over the views that contain a point; 0 if below `least` or if too few contain it.
pub fn hull_alpha(scene: &Scene, point_world: Vector, least: f32) -> Option<Bounded> {
    let mut alpha = Bounded::ONE;
    let (mut sure, mut unsure, mut undecided) = (0, 0, false);
    for view in scene.views {
        let seen = project(view, point_world);
        if seen.in_image == Some(false) {
            continue;
        }
        let here = look_up(view, scene.texels, seen.x, seen.y)[3];
        match (seen.in_image, here.below(least.into())) {
            // One view that surely says no is enough, whatever the others say.
            (Some(true), Some(true)) => return Some(Bounded::ZERO),
            (Some(true), Some(false)) => sure += 1,
            (Some(true), None) => (sure, undecided) = (sure + 1, true),
            _ => (unsure, undecided) = (unsure + 1, true),
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
    if scene.texels[(camera.first_texel + pixel) as usize][3] < LEAST_ALPHA {
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
