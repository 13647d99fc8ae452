//! Projections and grid look-ups in `f64`, with bounds on the error of `f32`.

use super::bounded::{Bounded, ROUNDING};
use viewfuse_core::camera::CameraBlock;

/// A point or a direction.
pub type Vector = [Bounded; 3];

/// A point without error.
pub fn point(coordinates: [f32; 3]) -> Vector {
    coordinates.map(Bounded::from)
}

/// Scalar product.
pub fn dot(a: Vector, b: Vector) -> Bounded {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `origin + direction * t`.
pub fn along(origin: Vector, direction: Vector, t: Bounded) -> Vector {
    [0, 1, 2].map(|axis| origin[axis] + direction[axis] * t)
}

/// A camera's centre.
pub fn centre(camera: &CameraBlock) -> Vector {
    point([camera.pose.right[3], camera.pose.down[3], camera.pose.forward[3]])
}

/// Right, down and forward in world coordinates.
pub fn axes(camera: &CameraBlock) -> [Vector; 3] {
    [camera.pose.right, camera.pose.down, camera.pose.forward].map(|axis| point([axis[0], axis[1], axis[2]]))
}

/// World direction through an image coordinate, 1 along the principal axis.
pub fn towards(camera: &CameraBlock, at: [f32; 2]) -> Vector {
    let [focal_x, focal_y, middle_x, middle_y] = camera.intrinsics.map(Bounded::from);
    let across = (Bounded::from(at[0]) - middle_x) / focal_x;
    let below = (Bounded::from(at[1]) - middle_y) / focal_y;
    let [right, down, forward] = axes(camera);
    [0, 1, 2].map(|axis| right[axis] * across + down[axis] * below + forward[axis])
}

/// Image coordinates and depth of a point.
#[derive(Clone, Copy, Debug)]
pub struct BoundedProjection {
    /// To the right, pixels.
    pub x: Bounded,
    /// Downwards, pixels.
    pub y: Bounded,
    /// Along the principal axis.
    pub depth: Bounded,
    /// Whether the point is in front of the camera.
    pub in_front: Option<bool>,
    /// Whether it is in front of the camera and inside its image.
    pub in_image: Option<bool>,
}

/// The projection of a point.
pub fn project(camera: &CameraBlock, point_world: Vector) -> BoundedProjection {
    let origin = centre(camera);
    let offset = [0, 1, 2].map(|axis| point_world[axis] - origin[axis]);
    let [right, down, forward] = axes(camera);
    let depth = dot(forward, offset);
    let [focal_x, focal_y, middle_x, middle_y] = camera.intrinsics.map(Bounded::from);
    // In homogeneous coordinates: the intrinsics first, then one division.
    let x = (focal_x * dot(right, offset) + middle_x * depth) / depth;
    let y = (focal_y * dot(down, offset) + middle_y * depth) / depth;
    let in_front = Bounded::ZERO.below(depth);
    BoundedProjection { x, y, depth, in_front, in_image: inside(camera, in_front, x, y) }
}

/// Whether a point that is projected to these image coordinates is in front of the camera and inside its image; the
/// border counts. `None` if an error of a number may change the answer.
pub fn inside(camera: &CameraBlock, in_front: Option<bool>, x: Bounded, y: Bounded) -> Option<bool> {
    let is_out = [
        in_front.map(|front| !front),
        x.below(Bounded::ZERO),
        y.below(Bounded::ZERO),
        Bounded::from(camera.width).below(x),
        Bounded::from(camera.height).below(y),
    ];
    any(is_out.into_iter()).map(|out| !out)
}

/// Nodes of one axis of a grid around a coordinate, within its error.
#[derive(Clone, Debug)]
pub struct Tents {
    /// Each with its linear weight at the coordinate.
    pub nodes: Vec<(usize, f64)>,
    /// The error of those weights.
    pub error: f64,
}

/// The nodes around a coordinate (centres at halves) among `count`.
pub fn tents(coordinate: Bounded, count: u32) -> Tents {
    let last = f64::from(count - 1);
    let at = |position: f64| position.clamp(0.0, last);
    let centred = coordinate.value - 0.5;
    let reach = coordinate.error + ROUNDING * (centred.abs() + 1.0);
    // Beyond the border an error changes nothing.
    let (low, position, high) = (at(centred - reach), at(centred), at(centred + reach));
    let tent = |node: usize| (node, (1.0 - (position - node as f64).abs()).max(0.0));
    Tents {
        nodes: (low.floor() as usize..=high.ceil() as usize).map(tent).collect(),
        error: (position - low).max(high - position),
    }
}

/// Bilinear look-up of `node(row, column)`. An error of the coordinates contributes the grid's change over it.
pub fn bilinear(node: impl Fn(usize, usize) -> f32, columns: &Tents, rows: &Tents) -> Bounded {
    let (mut value, mut least, mut greatest) = (0.0, f64::MAX, f64::MIN);
    for (row, height) in &rows.nodes {
        for (column, width) in &columns.nodes {
            let node = f64::from(node(*row, *column));
            value += width * height * node;
            least = node.min(least);
            greatest = node.max(greatest);
        }
    }
    // Each of two mixtures rounds a difference, a product and a sum.
    let mixed = 2.0 * ROUNDING * (greatest - least) + ROUNDING * least.abs().max(greatest.abs());
    Bounded { value, error: (columns.error + rows.error) * (greatest - least) + mixed }
}

/// Whether any is true; `None` if it depends on undecided ones.
pub(crate) fn any(answers: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    let answers: Vec<Option<bool>> = answers.collect();
    if answers.contains(&Some(true)) {
        Some(true)
    } else if answers.contains(&None) {
        None
    } else {
        Some(false)
    }
}

/// The coordinates of a window along an axis.
pub(crate) fn window(at: u32, reach: u32, count: u32) -> std::ops::RangeInclusive<u32> {
    at.saturating_sub(reach)..=(at + reach).min(count - 1)
}

/// The pixel of a coordinate inside the image, if it does not depend on rounding.
pub(crate) fn cell(coordinate: Bounded, count: u32) -> Option<usize> {
    let index = |value: f64| value.floor().clamp(0.0, f64::from(count - 1)) as usize;
    let low = index(coordinate.value - coordinate.error);
    (low == index(coordinate.value + coordinate.error)).then_some(low)
}
