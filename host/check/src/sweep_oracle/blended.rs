//! A target's pixel.

use super::picked::logistic;
use super::{BEHIND, PlaneProjection, disparity, look_up, mixed, project_plane};
use crate::bounded::Bounded;
use crate::camera_oracle::tents;
use crate::hull_oracle::bell;
use viewfuse_kernels::plane_sweep::blend::{BlendBlock, CUTOFF, HIDDEN_SHARE};
use viewfuse_kernels::plane_sweep::frustum::SweptView;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// A pixel of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Red, green, blue, premultiplied, and opacity.
    pub colour: [Bounded; 4],
    /// Depth; 0 if the opacity is below a half. `None` if that depends on rounding.
    pub depth: Option<Bounded>,
    /// How far the pixel can be relied on.
    pub confidence: Bounded,
}

/// The costs of all planes at an image coordinate of the target.
fn costs_at(block: &BlendBlock, costs: &[Planes], at: [f32; 2]) -> Vec<Bounded> {
    let (width, height) = (block.volume_width, block.volume_height);
    let scaled = |at: f32, size: u32, whole: u32| Bounded::from(at) * (Bounded::from(size) / Bounded::from(whole));
    let columns = tents(scaled(at[0], width, block.target.width), width);
    let rows = tents(scaled(at[1], height, block.target.height), height);
    let groups = block.group_count as usize;
    let cost = |plane: usize| {
        let node = |row: usize, column: usize| {
            costs[(row * width as usize + column) * groups + plane / PLANES][plane % PLANES].into()
        };
        mixed(node, &columns, &rows)
    };
    (0..groups * PLANES).map(cost).collect()
}

/// How far a view sees a point, by its own map.
fn visibility(view: &SweptView, disparities: &[[f32; 2]], seen: &PlaneProjection, disparity: Bounded) -> Bounded {
    if !(view.disparity_step > 0.0) {
        return Bounded::ONE;
    }
    let scaled = |at: Bounded, map: u32, whole: u32| at * (Bounded::from(map) / Bounded::from(whole));
    let columns = tents(scaled(seen.x, view.map_width, view.camera.width), view.map_width);
    let rows = tents(scaled(seen.y, view.map_height, view.camera.height), view.map_height);
    let node = |row: usize, column: usize| {
        let at = view.first_disparity as usize + row * view.map_width as usize + column;
        let [surface, confidence] = disparities[at].map(Bounded::from);
        let behind = (surface - disparity) / Bounded::from(2.0 * view.disparity_step);
        let behind = (behind - Bounded::ONE).greater(Bounded::ZERO);
        Bounded::ONE - confidence * (Bounded::ONE - bell(Bounded::from(BEHIND) * behind))
    };
    mixed(node, &columns, &rows)
}

/// What the views show at a plane: the mean colour, the sum of their parts, the weight of those that have it in the
/// image, and how far the silhouettes contain it.
struct PlaneColour {
    colour: [Bounded; 3],
    weight: Bounded,
    in_images: Bounded,
    hull: Bounded,
}

fn plane_colour(
    block: &BlendBlock,
    views: &[SweptView],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    at: [f32; 2],
    disparity: Bounded,
) -> Option<PlaneColour> {
    let mut sum = [Bounded::ZERO; 3];
    let (mut weight, mut in_images, mut hull) = (Bounded::ZERO, Bounded::ZERO, Bounded::ONE);
    for view in views {
        let seen = project_plane(&block.target, &view.camera, at, disparity);
        let in_image = seen.in_image?;
        let texel = look_up(&view.camera, texels, seen.x, seen.y);
        let share = Bounded::from(view.weight);
        let mut part = share * Bounded::from(HIDDEN_SHARE);
        if in_image {
            part = part + share * visibility(view, disparities, &seen, disparity / seen.depth_ratio);
            in_images = in_images + share;
        }
        if block.has_silhouettes != 0 {
            hull = if in_image { hull * texel[3] } else { Bounded::ZERO };
        }
        for channel in 0..3 {
            sum[channel] = sum[channel] + part * texel[channel] * Bounded::from(view.gain[channel]);
        }
        weight = weight + part * texel[3];
    }
    Some(PlaneColour { colour: sum.map(|sum| sum / weight.greater(1.0e-12.into())), weight, in_images, hull })
}

/// The pixel at the image coordinate `at`.
pub fn blend(
    block: &BlendBlock,
    views: &[SweptView],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    costs: &[Planes],
    at: [f32; 2],
) -> Option<Pixel> {
    let here = costs_at(block, costs, at);
    let least = here.iter().copied().reduce(Bounded::lesser)?;
    let mut colour = [Bounded::ZERO; 3];
    let (mut all, mut seen_share, mut in_images) = (Bounded::ZERO, Bounded::ZERO, Bounded::ZERO);
    let (mut disparities_sum, mut hull) = (Bounded::ZERO, Bounded::ZERO);
    for (plane, cost) in here.into_iter().enumerate() {
        let excess = (cost - least) * Bounded::from(block.sharpness);
        if Bounded::from(CUTOFF).below(excess)? {
            continue;
        }
        let share = (-excess).exp();
        let disparity = disparity(block.far_disparity, block.disparity_step, plane);
        let shown = plane_colour(block, views, texels, disparities, at, disparity)?;
        for (sum, shown) in colour.iter_mut().zip(shown.colour) {
            *sum = *sum + share * shown;
        }
        hull = hull.greater(shown.hull);
        disparities_sum = disparities_sum + share * disparity;
        all = all + share;
        seen_share = seen_share + share * shown.weight.lesser(Bounded::ONE);
        in_images = in_images + share * shown.in_images;
    }
    let opacity = if block.has_silhouettes != 0 { hull * logistic(least, 0.25, 0.03) } else { Bounded::ONE };
    let depth = match opacity.below(Bounded::from(0.5)) {
        Some(true) => Some(Bounded::ZERO),
        Some(false) => Some(Bounded::ONE / (disparities_sum / all).greater(1.0e-6.into())),
        None => None,
    };
    let confidence =
        (in_images / all).lesser(Bounded::ONE) * (seen_share / all).lesser(Bounded::ONE) * logistic(least, 0.12, 0.02);
    // Nothing is left of any colour where nothing is opaque.
    let [red, green, blue] =
        if opacity == Bounded::ZERO { [Bounded::ZERO; 3] } else { colour.map(|sum| sum / all * opacity) };
    Some(Pixel { colour: [red, green, blue, opacity], depth, confidence })
}
