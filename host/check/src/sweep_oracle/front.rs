//! Opacities of planes, and the preference for the first opaque one.

use super::{BEHIND, disparity, project_plane};
use crate::bounded::Bounded;
use crate::camera_oracle::cell;
use crate::hull_oracle::bell;
use viewfuse_kernels::plane_sweep::front::{
    FREE_PLANES, FrontBlock, GUARD, HIDES_MOST, HIDES_NOTHING, MAX_HIDDEN, SEEN_THROUGH, TRANSPARENT,
};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Opacities of a group of planes at a pixel of the whole image.
pub fn plane_opacity(
    frustum: &FrustumBlock,
    views: &[SweptView],
    disparities: &[[f32; 2]],
    pixel: u32,
    group: u32,
) -> [Option<Bounded>; PLANES] {
    std::array::from_fn(|plane| {
        let number = group as usize * PLANES + plane;
        let (mut support, mut violation) = (Bounded::ZERO, Bounded::ZERO);
        for view in views.iter().filter(|view| view.disparity_step > 0.0) {
            if let Some([supporting, against]) = of_view(frustum, view, disparities, pixel, number)? {
                support = support + supporting;
                violation = violation + against;
            }
        }
        let against = Bounded::from(SEEN_THROUGH) * violation + Bounded::from(TRANSPARENT);
        Some(support / (support + against))
    })
}

/// A view's support and its free-space violation. The outer `None` is undecided, the inner one outside the view.
fn of_view(
    frustum: &FrustumBlock,
    view: &SweptView,
    disparities: &[[f32; 2]],
    pixel: u32,
    plane: usize,
) -> Option<Option<[Bounded; 2]>> {
    let width = frustum.camera.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let disparity = disparity(frustum.far_disparity, frustum.disparity_step, plane);
    let seen = project_plane(&frustum.camera, &view.camera, at, disparity);
    if !seen.in_image? {
        return Some(None);
    }
    let (column, row) = (cell(seen.x, view.camera.width)?, cell(seen.y, view.camera.height)?);
    let texel = view.first_disparity as usize + row * view.map_width as usize + column;
    let [surface, confidence] = disparities[texel].map(Bounded::from);
    let behind = (surface - disparity / seen.depth_ratio) / Bounded::from(view.disparity_step);
    let free = (-behind - Bounded::from(FREE_PLANES)).greater(Bounded::ZERO);
    let shape = |planes: Bounded| bell(Bounded::from(BEHIND) * planes);
    Some(Some([confidence * shape(behind), confidence * (Bounded::ONE - shape(free))]))
}

/// The costs of a pixel's planes with the preference, from `opacities[row][column][group]` and
/// `costs[row][column][group]`.
pub fn front_cost(block: &FrontBlock, opacities: &[Planes], costs: &[Planes], pixel: u32) -> Vec<Bounded> {
    let groups = block.group_count as usize;
    let (column, row) = (pixel % block.width, pixel / block.width);
    let around = |at: u32, count: u32| at.saturating_sub(1)..(at + 2).min(count);
    let window: Vec<usize> = around(row, block.height)
        .flat_map(|y| around(column, block.width).map(move |x| (y * block.width + x) as usize * groups))
        .collect();
    let opacity = |plane: usize| {
        let values = window.iter().map(|first| Bounded::from(opacities[first + plane / PLANES][plane % PLANES]));
        values.fold(Bounded::ZERO, |sum, value| sum + value) / Bounded::from(window.len() as u32)
    };
    let opacity: Vec<Bounded> = (0..groups * PLANES).map(opacity).collect();
    let costs = costs[pixel as usize * groups..][..groups].as_flattened();
    let (nothing, most) = (Bounded::from(HIDES_NOTHING), Bounded::from(HIDES_MOST));
    (0..groups * PLANES)
        .map(|plane| {
            let hides = |before: &Bounded| ((*before - nothing) / (most - nothing)).clamped(0.0, 1.0);
            let before = opacity.iter().skip(plane + GUARD).map(hides);
            let hidden = before.fold(Bounded::ZERO, |most, hides| most.greater(hides)) * MAX_HIDDEN.into();
            let seen = (Bounded::ONE - hidden) * opacity[plane];
            Bounded::from(costs[plane]) + Bounded::from(block.front_share) * (Bounded::ONE - seen)
        })
        .collect()
}
