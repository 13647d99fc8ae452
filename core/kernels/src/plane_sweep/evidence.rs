//! The views' colours on the planes, and how far they agree.

use super::frustum::{FrustumBlock, SweptView};
use super::{MAX_MATCHED, PLANES, Planes};
use crate::visual_hull::fade;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::bilinear_from;
use viewfuse_core::math::{abs, max, min};

/// A mean difference of colour at which the cost saturates.
pub const MAX_DIFFERENCE: f32 = 0.25;
/// Least alpha of a visible pixel.
pub const MIN_ALPHA: f32 = 0.3;
/// The grey of a point that a view does not see.
pub const UNSEEN: f32 = -1.0;

/// Two views that are compared, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ViewPair {
    /// Number of one among the frustum's views.
    pub first: u32,
    /// Number of the other.
    pub second: u32,
    /// The product of their weights, over the sum of all pairs' products.
    pub weight: f32,
    /// Zero.
    pub padding: u32,
}

/// The evidence for a group of planes at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Each view's colour, as the mean of red, green and blue; [`UNSEEN`] where it does not see the point.
    pub grey: [Planes; MAX_MATCHED],
    /// Differences of the pairs that see the point, weighted and summed...
    pub difference: Planes,
    /// ... and their weights.
    pub weight: Planes,
    /// How far the point contradicts the views' own disparities, in `[0, 1]`.
    pub dissent: Planes,
    /// How far all silhouettes contain the point, in `[0, 1]`; 1 without silhouettes.
    pub hull: Planes,
}

/// How far a point lies behind the surface that a view sees, in planes of which `density` fill a unit of disparity;
/// negative in front of it.
#[inline(always)]
pub fn planes_behind(surface: f32, disparity: f32, density: f32) -> f32 {
    (surface - disparity) * density
}

/// The evidence for a group of planes at a pixel. `disparities[view's map][row][column]` are disparity and confidence;
/// the views' texels are premultiplied.
#[inline(always)]
pub fn evidence(
    frustum: &FrustumBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    pairs: &[ViewPair],
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    pixel: u32,
    group: u32,
) -> Evidence {
    let mut colours = [[[0.0; 3]; PLANES]; MAX_MATCHED];
    let mut grey = [[UNSEEN; PLANES]; MAX_MATCHED];
    let mut hull = [1.0; PLANES];
    let mut dissent = [0.0; PLANES];
    let mut informed = [0.0; PLANES];
    let mut slot = 0;
    while slot < frustum.view_count as usize {
        let view = &views.fetch(slot);
        let track = frustum.track(&view.camera, pixel);
        let density = 0.5 / view.disparity_step;
        let mut plane = 0;
        while plane < PLANES {
            let disparity = frustum.disparity(group as usize * PLANES + plane);
            let seen = track.at(disparity);
            if seen.in_image {
                let camera = &view.camera;
                let first = camera.first_texel as usize;
                let texel = bilinear_from(texels, first, camera.width, camera.height, seen.x, seen.y);
                if frustum.has_silhouettes != 0 {
                    hull[plane] *= texel[3];
                }
                if texel[3] >= MIN_ALPHA {
                    let mut channel = 0;
                    while channel < 3 {
                        colours[slot][plane][channel] = texel[channel] / texel[3] * view.gain[channel];
                        channel += 1;
                    }
                    let [red, green, blue] = colours[slot][plane];
                    grey[slot][plane] = (red + green + blue) * (1.0 / 3.0);
                }
                if view.disparity_step > 0.0 {
                    let [surface, confidence] = disparities.fetch(view.map_texel(seen.x, seen.y));
                    let behind = planes_behind(surface, disparity * seen.disparity_ratio, density);
                    let doubt = 1.0 - fade(0.707_106_77 * behind);
                    dissent[plane] += view.weight * confidence * doubt;
                    informed[plane] += view.weight;
                }
            } else if frustum.has_silhouettes != 0 {
                hull[plane] = 0.0;
            }
            plane += 1;
        }
        slot += 1;
    }
    let mut difference = [0.0; PLANES];
    let mut weight = [0.0; PLANES];
    let mut index = 0;
    while index < frustum.pair_count as usize {
        let pair = &pairs[index];
        let (a, b) = (pair.first as usize, pair.second as usize);
        let mut plane = 0;
        while plane < PLANES {
            let seen = if grey[a][plane] >= 0.0 && grey[b][plane] >= 0.0 { pair.weight } else { 0.0 };
            let [a, b] = [&colours[a][plane], &colours[b][plane]];
            let sum = abs(a[0] - b[0]) + abs(a[1] - b[1]) + abs(a[2] - b[2]);
            difference[plane] += seen * min(sum * (1.0 / 3.0), MAX_DIFFERENCE);
            weight[plane] += seen;
            plane += 1;
        }
        index += 1;
    }
    let mut plane = 0;
    while plane < PLANES {
        dissent[plane] /= max(informed[plane], 1.0e-6);
        plane += 1;
    }
    Evidence { grey, difference, weight, dissent, hull }
}
