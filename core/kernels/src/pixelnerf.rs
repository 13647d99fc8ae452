//! PixelNeRF's own arithmetic around its network: the inputs at a point, and radiance from the outputs.
//!
//! Source: Yu, Ye, Tancik, Kanazawa: "pixelNeRF", CVPR 2021, `src/model/models.py`, `encoder.py`, `code.py`. A row of
//! the network's input is a point as one view has it; rows are `[view][point]`, so that the views of a point can be
//! fused by [`viewfuse_core::fuse::fuse_element`].

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::split;
use viewfuse_core::math::{exact_power_of_two, exp, max, sin_cos};
use viewfuse_core::rays::RayPoint;

/// A dispatch of [`embedded_value`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct EmbedBlock {
    /// How many points there are.
    pub point_count: u32,
    /// How many octaves of sines and cosines.
    pub frequency_count: u32,
    /// Lowest angular frequency, radians a world unit.
    pub frequency: f32,
}

impl EmbedBlock {
    /// Numbers in a row: the point, a sine and a cosine of each coordinate an octave, the direction.
    #[inline]
    pub fn row_len(&self) -> u32 {
        6 + 6 * self.frequency_count
    }
}

/// Value number `element` of `[view][point][feature]`: the features of a point in the axes of a view. They are the
/// point *rotated* into the view's axes (not moved to its centre), then for octave `i` the sines and the cosines of the
/// three coordinates times `2^i frequency`, then the ray's direction rotated alike. Axes as published: x right, y up,
/// z backward.
#[inline]
pub fn embedded_value(
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    block: &EmbedBlock,
    element: usize,
) -> f32 {
    let (row, feature) = (element / block.row_len() as usize, element % block.row_len() as usize);
    let (view, point) = (row / block.point_count as usize, row % block.point_count as usize);
    let point = points.fetch(point);
    let last = block.row_len() as usize - 3;
    let vector = if feature < last { point.position } else { point.direction };
    let coordinate = in_view_axes(&views.fetch(view), vector)[feature % 3];
    if feature < 3 || feature >= last {
        return coordinate;
    }
    let wave = (feature - 3) / 3;
    let (sine, cosine) = waves(coordinate, (wave / 2) as u32, block);
    if wave % 2 == 0 { sine } else { cosine }
}

/// Components of a world vector along a view's axes as published: x right, y up, z backward.
#[inline]
pub fn in_view_axes(view: &CameraBlock, vector_world: [f32; 3]) -> [f32; 3] {
    let rotated = view.pose.rotate_to_camera(Vec3::new(vector_world[0], vector_world[1], vector_world[2]));
    [rotated.x, -rotated.y, -rotated.z]
}

/// Sine and cosine of a coordinate in an octave.
#[inline]
pub fn waves(coordinate: f32, octave: u32, block: &EmbedBlock) -> (f32, f32) {
    sin_cos(coordinate * (block.frequency * exact_power_of_two(octave as i32)))
}

/// A view's weight at a point, renormalised over the views that have the point in front of them; if none has, its
/// weight unchanged. Views behind which a point lies would see its mirror image.
#[inline]
pub fn visible_weight(
    views: &(impl Fetch<CameraBlock> + ?Sized),
    weights: &(impl Fetch<f32> + ?Sized),
    view_count: u32,
    point: &RayPoint,
    view: u32,
) -> f32 {
    let position = Vec3::from_array(point.position);
    let (mut of_view, mut all, mut seen) = (0.0, 0.0, 0);
    let mut other = 0;
    while other < view_count {
        if is_in_front(&views.fetch(other as usize), position) {
            let weight = weights.fetch(other as usize);
            all += weight;
            seen += 1;
            if other == view {
                of_view = weight;
            }
        }
        other += 1;
    }
    if seen == view_count || !(all > 0.0) {
        return weights.fetch(view as usize);
    }
    of_view / all
}

/// Whether a world point is in front of a view, whose weight is 0 there if it is not; not for NaN.
#[inline]
pub fn is_in_front(camera: &CameraBlock, position: Vec3) -> bool {
    camera.pose.rotate_to_camera(position - camera.centre_world()).z > MIN_DEPTH
}

/// As in [`CameraBlock::project`].
const MIN_DEPTH: f32 = 1.0e-20;

/// Latents where points appear in a view, as plain data: `[point][channel]`, the view's grid `[row][column][channel]`
/// there ([`GridPlace`]), plus the residual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GatherBlock {
    /// Which view's grid it is.
    pub view: u32,
    /// How many points there are.
    pub point_count: u32,
    /// Channels of the grid.
    pub channel_count: u32,
    /// Rows of the grid.
    pub height: u32,
    /// Columns of the grid.
    pub width: u32,
    /// 1 if there is a residual, 0 if not.
    pub has_residual: u32,
    /// Where in a pixel its centre is, as in [`viewfuse_core::rays::CastBlock`].
    pub pixel_centre: f32,
}

impl GatherBlock {
    /// Numbers of a view: where its part of `[view][point][channel]` starts.
    #[inline]
    pub fn first(&self) -> usize {
        self.view as usize * self.point_count as usize * self.channel_count as usize
    }

    /// Fours of a point's channels, the last of which may be fewer.
    #[inline]
    pub fn four_count(&self) -> u32 {
        self.channel_count.div_ceil(4)
    }
}

/// Where a view's grid is looked up for a point: nodes and shares of columns and of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPlace {
    /// Indices of the first numbers of the nodes: upper left, upper right, lower left, lower right.
    pub nodes: [usize; 4],
    /// Share of the right nodes.
    pub share_x: f32,
    /// Share of the lower nodes.
    pub share_y: f32,
}

impl GridPlace {
    /// The place where a point appears in a view. Grid node `i` lies over image column `i * image width / grid width`
    /// (the published convention); outside the image the border's value is used. A point that is not in front of
    /// the view gets the first node.
    #[inline]
    pub fn of(camera: &CameraBlock, point: &RayPoint, block: &GatherBlock) -> GridPlace {
        let seen = camera.project(Vec3::from_array(point.position));
        let x = (seen.x - block.pixel_centre) * (block.width as f32 / camera.width as f32);
        let y = (seen.y - block.pixel_centre) * (block.height as f32 / camera.height as f32);
        let (left, right, share_x) = split(x + 0.5, block.width);
        let (top, bottom, share_y) = split(y + 0.5, block.height);
        let (width, channels) = (block.width as usize, block.channel_count as usize);
        let node = |row: usize, column: usize| (row * width + column) * channels;
        GridPlace {
            nodes: [node(top, left), node(top, right), node(bottom, left), node(bottom, right)],
            share_x,
            share_y,
        }
    }

    /// One channel there, columns mixed first.
    #[inline]
    pub fn value(&self, grid: &(impl Fetch<f32> + ?Sized), channel: usize) -> f32 {
        let [upper_left, upper_right, lower_left, lower_right] = self.nodes;
        let (left, right) = (grid.fetch(upper_left + channel), grid.fetch(upper_right + channel));
        let upper = left + (right - left) * self.share_x;
        let (left, right) = (grid.fetch(lower_left + channel), grid.fetch(lower_right + channel));
        let lower = left + (right - left) * self.share_x;
        upper + (lower - upper) * self.share_y
    }
}

/// Radiance from the network's four outputs `raw[channel]` at a point: red, green, blue in `[0, 1]` (logistic function,
/// 1 for NaN), and optical depth: density (rectified; NaN counts as 0) times the length of ray that the point
/// represents.
#[inline]
pub fn radiance(raw: &(impl Fetch<f32> + ?Sized), point: &RayPoint) -> [f32; 4] {
    let colour = |channel: usize| 1.0 / (1.0 + exp(-raw.fetch(channel)));
    [colour(0), colour(1), colour(2), max(raw.fetch(3), 0.0) * point.length]
}
