//! What the sources show on a target's planes, as the blend of the training-free field reads it.

use super::TargetPlanes;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::lookup::{bilinear_from, split};
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_kernels::plane_sweep::blend::{HIDDEN_SHARE, visibility};
use viewfuse_kernels::plane_sweep::frustum::{SweptView, Track};

/// Red, green, blue.
pub(crate) type Colour = [f32; 3];

/// A source at a point of the target's ray.
#[derive(Clone, Copy, Default)]
pub(crate) struct Sample {
    /// Not premultiplied, exposure equalised.
    pub(crate) colour: Colour,
    /// The source's alpha there.
    pub(crate) alpha: f32,
    /// Whether the point is in the source's image.
    pub(crate) in_image: bool,
    /// By the source's own disparities.
    pub(crate) visibility: f32,
    /// Camera weight times visibility, as the blend uses it.
    pub(crate) part: f32,
    /// Where in the source, in pixels, and the depth there in world units.
    pub(crate) at: [f32; 3],
}

/// Samples of all sources at each pixel: `[view][pixel]`.
pub(crate) type Samples = Vec<Vec<Sample>>;

/// The samples at one disparity a pixel; disparities in inverse world units.
pub(crate) fn samples(planes: &TargetPlanes, disparity: impl Fn(usize) -> f32) -> Samples {
    let block = &planes.block;
    let width = block.target.width as usize;
    let of_view = |view: &SweptView| {
        let camera = &view.camera;
        let sample = |pixel: usize| {
            let (x, y) = ((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
            let disparity = disparity(pixel);
            let seen = Track::new(&block.target, camera, x, y).at(disparity);
            let first = camera.first_texel as usize;
            let texel = bilinear_from(&planes.texels[..], first, camera.width, camera.height, seen.x, seen.y);
            let there = disparity * seen.disparity_ratio;
            let visible =
                if seen.in_image { visibility(view, &planes.disparities[..], seen.x, seen.y, there) } else { 0.0 };
            let straight = 1.0 / texel[3].max(1.0e-6);
            Sample {
                colour: [0, 1, 2].map(|channel| texel[channel] * straight * view.gain[channel]),
                alpha: texel[3],
                in_image: seen.in_image,
                visibility: visible,
                part: view.weight * (HIDDEN_SHARE + visible),
                at: [seen.x, seen.y, 1.0 / (seen.disparity_ratio * disparity.max(1.0e-9))],
            }
        };
        (0..width * block.target.height as usize).map(sample).collect()
    };
    planes.views.iter().map(of_view).collect()
}

/// The weighted mean of samples at a pixel; each weight is multiplied by the source's alpha. Black without any.
pub(crate) fn mean(samples: &Samples, pixel: usize, weight: impl Fn(usize, &Sample) -> f32) -> Colour {
    let (mut sum, mut all) = ([0.0; 3], 0.0);
    for (view, own) in samples.iter().enumerate() {
        let sample = &own[pixel];
        let part = weight(view, sample) * sample.alpha;
        (0..3).for_each(|channel| sum[channel] += part * sample.colour[channel]);
        all += part;
    }
    sum.map(|value| value / all.max(1.0e-12))
}

/// The disparity of a plane, in inverse world units.
pub(crate) fn disparity(planes: &TargetPlanes, plane: usize) -> f32 {
    planes.block.far_disparity + plane as f32 * planes.block.disparity_step
}

/// How many planes there are.
pub(crate) fn plane_count(planes: &TargetPlanes) -> usize {
    planes.block.group_count as usize * PLANES
}

/// The costs of all planes above the least one at each pixel of the picture, `[pixel][plane]`, and the least: bilinear in the
/// volume, as the blend reads it.
pub(crate) fn excesses(planes: &TargetPlanes) -> (Vec<Vec<f32>>, Vec<f32>) {
    let block = &planes.block;
    let (width, height, groups) = (block.volume_width, block.volume_height, block.group_count as usize);
    let CameraBlock { width: columns, height: rows, .. } = block.target;
    let (mut all, mut leasts) = (Vec::new(), Vec::new());
    for pixel in 0..columns * rows {
        let (x, y) = ((pixel % columns) as f32 + 0.5, (pixel / columns) as f32 + 0.5);
        let (left, right, share_x) = split(x * (width as f32 / columns as f32), width);
        let (top, bottom, share_y) = split(y * (height as f32 / rows as f32), height);
        let cost = |column: usize, row: usize, plane: usize| {
            planes.costs[(row * width as usize + column) * groups + plane / PLANES][plane % PLANES]
        };
        let costs: Vec<f32> = (0..groups * PLANES)
            .map(|plane| {
                let upper = cost(left, top, plane) * (1.0 - share_x) + cost(right, top, plane) * share_x;
                let lower = cost(left, bottom, plane) * (1.0 - share_x) + cost(right, bottom, plane) * share_x;
                upper * (1.0 - share_y) + lower * share_y
            })
            .collect();
        let least = costs.iter().copied().fold(f32::MAX, f32::min);
        all.push(costs.into_iter().map(|cost| cost - least).collect());
        leasts.push(least);
    }
    (all, leasts)
}
