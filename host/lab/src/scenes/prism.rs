//! Prisms: a side view with corners, given a width that may shrink towards the top and towards the ends.
//!
//! What cars, seats and signs are made of. The outline lies in the plane `y = 0` of the prism's own coordinates and may
//! have notches (wheel arches); the width is that of the finished shape,
//!
//! ```text
//! w(x, z) = half_width - lean * max(z - waist, 0) - nose * t^2,  t = clamp((|x| - shoulder) / (reach - shoulder), 0, 1)
//! ```
//!
//! The distance to an outline is Quilez's (Inigo Quilez, "2D distance functions": the nearest of the edges, its sign by
//! counting crossings).

use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, clamp, max, min, sqrt};

/// Most corners of an outline.
pub const MAX_CORNER_COUNT: usize = 32;

/// Farther away than this from the box around a prism, in world units, the distance to the box is near enough.
const FAR: f32 = 0.02;

/// How wide a prism is. Lengths are in world units, coordinates are the prism's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Width {
    /// Half of the largest width.
    pub half_width: f32,
    /// Height above which it narrows.
    pub waist: f32,
    /// How much each side comes in per unit of height above the waist.
    pub lean: f32,
    /// Distance from the middle, along x, beyond which it narrows.
    pub shoulder: f32,
    /// How much each side comes in at the ends.
    pub nose: f32,
    /// Radius of the edges between outline and sides.
    pub rounding: f32,
}

impl Width {
    /// The same width everywhere.
    pub const fn constant(half_width: f32, rounding: f32) -> Width {
        Width { half_width, waist: 0.0, lean: 0.0, shoulder: 0.0, nose: 0.0, rounding }
    }
}

/// Edges that are looked at together: as many as the narrowest vector instructions take.
const EDGES_TOGETHER: usize = 4;

/// Edges of an outline, each from a corner to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edges {
    start_x: [f32; EDGES_TOGETHER],
    start_z: [f32; EDGES_TOGETHER],
    along_x: [f32; EDGES_TOGETHER],
    along_z: [f32; EDGES_TOGETHER],
    inverse_square: [f32; EDGES_TOGETHER],
}

impl Edges {
    /// Edges without length, far away from everything.
    const NOTHING: Edges = Edges {
        start_x: [1.0e9; EDGES_TOGETHER],
        start_z: [1.0e9; EDGES_TOGETHER],
        along_x: [0.0; EDGES_TOGETHER],
        along_z: [0.0; EDGES_TOGETHER],
        inverse_square: [0.0; EDGES_TOGETHER],
    };
}

/// An outline with a width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prism {
    edges: [Edges; MAX_CORNER_COUNT / EDGES_TOGETHER],
    corner_count: usize,
    width: Width,
    /// Largest `|x|`, `|y|` and `|z|`.
    half_box: Vec3,
    /// Makes the distance a lower bound where width and outline change together.
    scale: f32,
}

impl Prism {
    /// The prism over the outline with these corners (x and z, in either sense, each once), which rounding then widens
    /// on all sides. The outline must not cross itself.
    pub fn new(corners: &[[f32; 2]], width: Width) -> Prism {
        let mut edges = [Edges::NOTHING; MAX_CORNER_COUNT / EDGES_TOGETHER];
        let mut reach = [0.0_f32; 2];
        for (index, &[x, z]) in corners.iter().enumerate() {
            let (edges, lane) = (&mut edges[index / EDGES_TOGETHER], index % EDGES_TOGETHER);
            let end = corners[(index + 1) % corners.len()];
            let along = [end[0] - x, end[1] - z];
            let squared_length = along[0] * along[0] + along[1] * along[1];
            (edges.start_x[lane], edges.start_z[lane]) = (x, z);
            [edges.along_x[lane], edges.along_z[lane]] = along;
            edges.inverse_square[lane] = 1.0 / squared_length;
            reach = [max(reach[0], abs(x)), max(reach[1], abs(z))];
        }
        let half_box = Vec3::new(reach[0] + width.rounding, width.half_width, reach[1] + width.rounding);
        let end_slope = if width.nose > 0.0 { 2.0 * width.nose / (half_box.x - width.shoulder) } else { 0.0 };
        // The gradients of outline and width are not perpendicular where the width changes along the outline; this is
        // the largest singular value of the two, for the steepest change there is.
        let slope_squared = width.lean * width.lean + end_slope * end_slope;
        let steepest = 0.5 * (2.0 + slope_squared + sqrt(slope_squared * (slope_squared + 4.0)));
        Prism { edges, corner_count: corners.len(), width, half_box, scale: 1.0 / sqrt(steepest) }
    }

    /// Half of the extent along each axis of a box around the local origin that holds the prism.
    pub fn half_box(&self) -> Vec3 {
        self.half_box
    }

    /// Signed distance (world units) from `point_local` to the surface, or a lower bound of it in magnitude.
    pub fn distance(&self, point_local: Vec3) -> f32 {
        let p = point_local;
        let beyond = Vec3::new(abs(p.x), abs(p.y), abs(p.z)) - self.half_box;
        let from_box = Vec3::new(max(beyond.x, 0.0), max(beyond.y, 0.0), max(beyond.z, 0.0));
        let squared = from_box.dot(from_box);
        if squared > FAR * FAR {
            return sqrt(squared);
        }
        let rounding = self.width.rounding;
        let around = self.outline_distance(p.x, p.z);
        let side = abs(p.y) - self.half_width_at(p.x, p.z) + rounding;
        let outside = max(around, 0.0) * max(around, 0.0) + max(side, 0.0) * max(side, 0.0);
        (sqrt(outside) + min(max(around, side), 0.0) - rounding) * self.scale
    }

    fn half_width_at(&self, x: f32, z: f32) -> f32 {
        let Width { half_width, waist, lean, shoulder, nose, .. } = self.width;
        let mut width = half_width - lean * max(z - waist, 0.0);
        if nose > 0.0 {
            let t = clamp((abs(x) - shoulder) / (self.half_box.x - shoulder), 0.0, 1.0);
            width -= nose * t * t;
        }
        width
    }

    /// Signed distance to the outline in its plane, negative inside.
    fn outline_distance(&self, x: f32, z: f32) -> f32 {
        let mut nearest = [f32::MAX; EDGES_TOGETHER];
        let mut crossings = [0_u32; EDGES_TOGETHER];
        let count = self.corner_count.div_ceil(EDGES_TOGETHER);
        for edges in &self.edges[..count] {
            for lane in 0..EDGES_TOGETHER {
                let (along_x, along_z) = (edges.along_x[lane], edges.along_z[lane]);
                let (from_x, from_z) = (x - edges.start_x[lane], z - edges.start_z[lane]);
                let t = clamp((from_x * along_x + from_z * along_z) * edges.inverse_square[lane], 0.0, 1.0);
                let (off_x, off_z) = (from_x - along_x * t, from_z - along_z * t);
                nearest[lane] = min(nearest[lane], off_x * off_x + off_z * off_z);
                // Whether the level line from the point towards growing x meets the edge.
                let spans = (from_z >= 0.0) != (from_z >= along_z);
                let before = (along_x * from_z > along_z * from_x) == (along_z > 0.0);
                crossings[lane] ^= u32::from(spans & before);
            }
        }
        let distance = sqrt(nearest.into_iter().fold(f32::MAX, min));
        if crossings.into_iter().fold(0, |sum, crossing| sum ^ crossing) == 1 { -distance } else { distance }
    }
}
