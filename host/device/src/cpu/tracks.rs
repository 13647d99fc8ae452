//! Points of a ray in a view, some planes at a time: in vectors what is computed for each plane, then the loads. The
//! numbers are those of `Track::at` and `viewfuse_core::lookup`, the same bits.
#![expect(clippy::needless_range_loop, reason = "loops over planes index several arrays, and become vectors")]

use viewfuse_core::math::clamp;
use viewfuse_kernels::plane_sweep::frustum::{SweptView, Track};

/// Where points lie in a view.
pub(super) struct Points<const N: usize> {
    pub(super) x: [f32; N],
    pub(super) y: [f32; N],
    pub(super) disparity_ratio: [f32; N],
    /// 1 where the point is in the image, 0 elsewhere.
    pub(super) in_image: [f32; N],
}

impl<const N: usize> Points<N> {
    /// The points of these disparities.
    #[inline(always)]
    pub(super) fn new(track: &Track, disparities: &[f32; N]) -> Points<N> {
        let mut points = Points { x: [0.0; N], y: [0.0; N], disparity_ratio: [0.0; N], in_image: [0.0; N] };
        for plane in 0..N {
            let seen = track.at(disparities[plane]);
            points.x[plane] = seen.x;
            points.y[plane] = seen.y;
            points.disparity_ratio[plane] = seen.disparity_ratio;
            points.in_image[plane] = if seen.in_image { 1.0 } else { 0.0 };
        }
        points
    }

    /// Whether the view's map says anything about the points: tracks leave an image for good, often before they reach
    /// it.
    #[inline(always)]
    pub(super) fn are_any_in_image(&self) -> bool {
        self.in_image.iter().fold(false, |any, in_image| any | (*in_image > 0.0))
    }
}

/// The four nodes around coordinates in a grid, and the shares of the second ones, as `viewfuse_core::lookup::split`.
pub(super) struct Corners<const N: usize> {
    upper: [i32; N],
    right: [i32; N],
    down: [i32; N],
    share_x: [f32; N],
    share_y: [f32; N],
}

impl<const N: usize> Corners<N> {
    #[inline(always)]
    pub(super) fn new(x: &[f32; N], y: &[f32; N], width: u32, height: u32) -> Corners<N> {
        let (width, last_column, last_row) = (width as i32, width as i32 - 1, height as i32 - 1);
        let mut corners = Corners { upper: [0; N], right: [0; N], down: [0; N], share_x: [0.0; N], share_y: [0.0; N] };
        for plane in 0..N {
            let x = clamp(x[plane] - 0.5, 0.0, last_column as f32);
            let y = clamp(y[plane] - 0.5, 0.0, last_row as f32);
            let (column, row) = (whole(x), whole(y));
            corners.upper[plane] = row * width + column;
            corners.right[plane] = if column < last_column { 1 } else { 0 };
            corners.down[plane] = if row < last_row { width } else { 0 };
            corners.share_x[plane] = x - column as f32;
            corners.share_y[plane] = y - row as f32;
        }
        corners
    }

    /// The nodes of a point: the upper two, then the lower two.
    #[inline(always)]
    pub(super) fn nodes<T: Copy>(&self, grid: &[T], plane: usize) -> [T; 4] {
        let at = self.upper[plane] as usize;
        let (right, down) = (self.right[plane] as usize, self.down[plane] as usize);
        [grid[at], grid[at + right], grid[at + down], grid[at + down + right]]
    }

    /// Columns are mixed first, then rows.
    #[inline(always)]
    pub(super) fn mixed(&self, grid: &[[f32; 4]], plane: usize) -> [f32; 4] {
        let nodes = self.nodes(grid, plane);
        let above = mix(&nodes[0], &nodes[1], self.share_x[plane]);
        let below = mix(&nodes[2], &nodes[3], self.share_x[plane]);
        mix(&above, &below, self.share_y[plane])
    }

    /// One number a node, by the shares of all four: the columns' first.
    #[inline(always)]
    pub(super) fn weighted(&self, nodes: &[[f32; N]; 4]) -> [f32; N] {
        let mut sums = [0.0; N];
        for plane in 0..N {
            let (share_x, share_y) = (self.share_x[plane], self.share_y[plane]);
            let upper = nodes[0][plane] * (1.0 - share_x) + nodes[1][plane] * share_x;
            let lower = nodes[2][plane] * (1.0 - share_x) + nodes[3][plane] * share_x;
            sums[plane] = upper * (1.0 - share_y) + lower * share_y;
        }
        sums
    }
}

/// A view's texels.
#[inline(always)]
pub(super) fn image<'a>(view: &SweptView, texels: &'a [[f32; 4]]) -> &'a [[f32; 4]] {
    &texels[view.camera.first_texel as usize..][..(view.camera.width * view.camera.height) as usize]
}

/// A view's own map of disparities and confidences.
#[inline(always)]
pub(super) fn map<'a>(view: &SweptView, disparities: &'a [[f32; 2]]) -> &'a [[f32; 2]] {
    &disparities[view.first_disparity as usize..][..(view.map_width * view.map_height) as usize]
}

/// The whole part of a number from 0 to 2^22, such as a coordinate in an image; for -1 a negative number. A cast, which
/// saturates and knows NaN, would leave the vectors and convert one number after the other: that took a third of the
/// time of opacities.
#[inline(always)]
pub(super) fn whole(at: f32) -> i32 {
    // From here on floats are 1 apart: a sum is rounded to a whole number, and its bits count up from these.
    const WHOLE: f32 = 8_388_608.0;
    let nearest = at + WHOLE;
    let above = nearest - WHOLE > at;
    nearest.to_bits() as i32 - WHOLE.to_bits() as i32 - i32::from(above)
}

#[inline(always)]
fn mix(a: &[f32; 4], b: &[f32; 4], share: f32) -> [f32; 4] {
    std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * share)
}
