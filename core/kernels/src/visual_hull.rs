//! The training-free field inside silhouettes: a solid carved by silhouettes and by photo-consistency, coloured by
//! weighted fusion of the views' colours.
//!
//! Four stages, each a few data-parallel kernels; a kernel is a function of one output element.
//!
//! ```text
//! hull          the visual hull of the silhouettes                  hull_alpha, hull_entry
//! sweep         the depth of each source pixel: planes are swept    match_cost, sum_row, mean_column, pick_depth
//!               through the hull, colours compared across views
//! shade         occupancy and colour at a point                     sample
//! ray_marching  a target pixel's ray through the solid              march_ray
//! ```
//!
//! Published ideas: image-based visual hulls (Matusik et al. 2000), plane sweeping with a window (Collins 1996),
//! visibility-weighted votes (Penner and Zhang, "Soft 3D reconstruction", 2017), truncated signed distances (Curless
//! and Levoy 1996), blending by relevance (Buehler et al., "Unstructured lumigraph rendering", 2001). The camera
//! weights enter twice: a source's depth comes from the views most relevant *to that source*, and a target's point is
//! shaped and coloured by the views most relevant *to the target*.
//!
//! Images are premultiplied RGBA in `[0, 1]`, `texels[row][column]` of each view, concatenated; depth maps have the
//! same order. Depths are along the principal axis. Lengths scale with the scene: a *footprint* is the side of a pixel
//! of a view at the middle of the object.

pub mod hull;
pub mod ray_marching;
pub mod shade;
pub mod sweep;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// The depth of a pixel without a surface: larger than every depth, but finite.
pub const NO_SURFACE: f32 = 1.0e30;

/// Visibility of what lies behind a surface: 1 at the surface, falling in a bell curve with the distance behind it in
/// units of the curve's width, 0 from two widths on. `(1 - b^2 / 4)^4` follows `exp(-b^2)` to 0.075 and costs a quarter
/// of it.
#[inline(always)]
pub fn fade(behind: f32) -> f32 {
    let rest = viewfuse_core::math::max(1.0 - 0.25 * behind * behind, 0.0);
    let squared = rest * rest;
    squared * squared
}

/// The object and its views as a whole, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ObjectBlock {
    /// Least corner of a box around the object, world coordinates; the fourth number is unused.
    pub low: [f32; 4],
    /// Greatest corner of the box.
    pub high: [f32; 4],
    /// Number of views.
    pub view_count: u32,
    /// A point must lie inside the images of at least this many views to belong to the object.
    pub least_containing: u32,
    /// Half the diagonal of the box, world units.
    pub radius: f32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<ObjectBlock>() == 48);

impl ObjectBlock {
    /// An object inside the box from `low` to `high`, seen by `view_count` views. Half of the views, and at least two,
    /// must contain a point: some photographs crop the object, but points that most do not show are unknown.
    pub fn new(low: Vec3, high: Vec3, view_count: u32) -> ObjectBlock {
        ObjectBlock {
            low: [low.x, low.y, low.z, 0.0],
            high: [high.x, high.y, high.z, 0.0],
            view_count,
            least_containing: view_count.div_ceil(2).max(2),
            radius: 0.5 * (high - low).length(),
            padding: 0,
        }
    }

    /// The middle of the box.
    #[inline]
    pub fn middle(&self) -> Vec3 {
        Vec3::new(
            0.5 * (self.low[0] + self.high[0]),
            0.5 * (self.low[1] + self.high[1]),
            0.5 * (self.low[2] + self.high[2]),
        )
    }

    /// The eight corners; bit `k` of the index says whether coordinate `k` is the greatest.
    #[inline]
    pub fn corners(&self) -> [Vec3; 8] {
        let mut corners = [Vec3::ZERO; 8];
        let mut index = 0;
        while index < 8 {
            let pick = |axis: usize| if index >> axis & 1 == 0 { self.low[axis] } else { self.high[axis] };
            corners[index] = Vec3::new(pick(0), pick(1), pick(2));
            index += 1;
        }
        corners
    }

    /// The part of a line inside the box: parameters `(enter, leave)` of `origin + t * direction` with `t >= 0`;
    /// `enter >= leave` where the line misses it.
    #[inline]
    pub fn interval(&self, origin: Vec3, direction: Vec3) -> (f32, f32) {
        let origin = [origin.x, origin.y, origin.z];
        let direction = [direction.x, direction.y, direction.z];
        let (mut enter, mut leave) = (0.0_f32, NO_SURFACE);
        let mut axis = 0;
        while axis < 3 {
            if direction[axis] != 0.0 {
                let inverse = 1.0 / direction[axis];
                let first = (self.low[axis] - origin[axis]) * inverse;
                let second = (self.high[axis] - origin[axis]) * inverse;
                enter = viewfuse_core::math::max(viewfuse_core::math::min(first, second), enter);
                leave = viewfuse_core::math::min(viewfuse_core::math::max(first, second), leave);
            } else if origin[axis] < self.low[axis] || origin[axis] > self.high[axis] {
                leave = -1.0;
            }
            axis += 1;
        }
        (enter, leave)
    }
}
