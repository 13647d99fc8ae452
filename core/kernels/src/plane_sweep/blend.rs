//! A target's pixel: a softmax over planes of the colours of the views that see the point.

use super::evidence::planes_behind;
use super::frustum::{SweptView, Track};
use super::path::CostBlock;
use super::{MAX_GROUPS, PLANES, Planes, least_of, lessen};
use crate::visual_hull::fade;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::{bilinear_from, split};
use viewfuse_core::math::{exp, max, min};

/// Planes whose share is below `e^-CUTOFF` of the best one's are left out: together they change a channel by at most
/// their number times that.
pub const CUTOFF: f32 = 8.0;
/// Share of a view that does not see a point, so that a point seen by none gets the colour at the edge of the seen
/// surface.
pub const HIDDEN_SHARE: f32 = 1.0e-4;

/// A target and its planes, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BlendBlock {
    /// The target camera, of the picture's size.
    pub target: CameraBlock,
    /// Disparity of plane 0.
    pub far_disparity: f32,
    /// From a plane's disparity to the next one's.
    pub disparity_step: f32,
    /// Columns of the volume of costs.
    pub volume_width: u32,
    /// Its rows.
    pub volume_height: u32,
    /// Groups of planes.
    pub group_count: u32,
    /// Source views.
    pub view_count: u32,
    /// Inverse temperature of the softmax.
    pub sharpness: f32,
    /// 1 if alpha is a silhouette.
    pub has_silhouettes: u32,
}

const _: () = assert!(size_of::<BlendBlock>() == 112);

/// A pixel of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blended {
    /// Red, green, blue, premultiplied, and opacity.
    pub colour: [f32; 4],
    /// Depth along the principal axis in world units, 0 where there is no surface.
    pub depth: f32,
    /// Confidence in the pixel, in `[0, 1]`.
    pub confidence: f32,
}

/// Visibility of a point of this disparity in a view, by its own map: 1 at the surface it sees or in front of that.
#[inline(always)]
pub fn visibility(
    view: &SweptView,
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    x: f32,
    y: f32,
    disparity: f32,
) -> f32 {
    if !(view.disparity_step > 0.0) {
        return 1.0;
    }
    let to_map = |at: f32, size: u32, map: u32| at * (map as f32 / size as f32);
    let (left, right, share_x) = split(to_map(x, view.camera.width, view.map_width), view.map_width);
    let (top, bottom, share_y) = split(to_map(y, view.camera.height, view.map_height), view.map_height);
    let first = view.first_disparity as usize;
    let (top, bottom) = (first + top * view.map_width as usize, first + bottom * view.map_width as usize);
    let density = 0.5 / view.disparity_step;
    let at = |index: usize| {
        let [surface, confidence] = disparities.fetch(index);
        let behind = max(planes_behind(surface, disparity, density) - 1.0, 0.0);
        1.0 - confidence * (1.0 - fade(0.707_106_77 * behind))
    };
    let upper = at(top + left) * (1.0 - share_x) + at(top + right) * share_x;
    let lower = at(bottom + left) * (1.0 - share_x) + at(bottom + right) * share_x;
    upper * (1.0 - share_y) + lower * share_y
}

/// The pixel at the image coordinate `at`, from `costs[row][column][group]` of a volume of any size.
#[inline(always)]
pub fn blend(
    block: &BlendBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    costs: &(impl Fetch<Planes> + ?Sized),
    at: [f32; 2],
) -> Blended {
    let groups = block.group_count as usize;
    let here = pixel_costs(block, costs, at);
    let least = least_cost(&here, groups);
    let mut sums = BlendSums::NONE;
    let mut group = 0;
    while group < groups {
        let mut plane = 0;
        while plane < PLANES {
            let excess = (here[group][plane] - least) * block.sharpness;
            if excess <= CUTOFF {
                let share = exp(-excess);
                let disparity = block.disparity(group * PLANES + plane);
                let mut sum = [0.0; 3];
                let mut weight = 0.0;
                let mut hull = 1.0;
                let mut index = 0;
                while index < block.view_count as usize {
                    let view = &views.fetch(index);
                    let camera = &view.camera;
                    let seen = Track::new(&block.target, camera, at[0], at[1]).at(disparity);
                    let first = camera.first_texel as usize;
                    let texel = bilinear_from(texels, first, camera.width, camera.height, seen.x, seen.y);
                    let mut part = view.weight * HIDDEN_SHARE;
                    if seen.in_image {
                        let there = disparity * seen.disparity_ratio;
                        part += view.weight * visibility(view, disparities, seen.x, seen.y, there);
                        sums.seen_weight += share * view.weight;
                    }
                    if block.has_silhouettes != 0 {
                        hull *= if seen.in_image { texel[3] } else { 0.0 };
                    }
                    let mut channel = 0;
                    while channel < 3 {
                        sum[channel] += part * texel[channel] * view.gain[channel];
                        channel += 1;
                    }
                    weight += part * texel[3];
                    index += 1;
                }
                sums.add(share, disparity, &sum, weight, hull);
            }
            plane += 1;
        }
        group += 1;
    }
    sums.pixel(block, least)
}

/// Sums over the planes of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct BlendSums {
    colour: [f32; 3],
    all_share: f32,
    seen_share: f32,
    disparity: f32,
    hull_max: f32,
    /// The weights of the views whose images the points lie in, times the planes' shares: added by the caller.
    pub seen_weight: f32,
}

impl BlendSums {
    /// Of no planes.
    pub const NONE: BlendSums = BlendSums {
        colour: [0.0; 3],
        all_share: 0.0,
        seen_share: 0.0,
        disparity: 0.0,
        hull_max: 0.0,
        seen_weight: 0.0,
    };

    /// Adds a plane, of which the views' colours, their weights and their product of alphas are known.
    #[inline(always)]
    pub fn add(&mut self, share: f32, disparity: f32, sum: &[f32; 3], weight: f32, hull: f32) {
        let inverse = share / max(weight, 1.0e-12);
        let mut channel = 0;
        while channel < 3 {
            self.colour[channel] += sum[channel] * inverse;
            channel += 1;
        }
        self.hull_max = max(hull, self.hull_max);
        self.disparity += share * disparity;
        self.all_share += share;
        self.seen_share += share * min(weight, 1.0);
    }

    /// The pixel, whose best plane has the cost `least`.
    #[inline(always)]
    pub fn pixel(&self, block: &BlendBlock, least: f32) -> Blended {
        let inverse = 1.0 / self.all_share;
        let opacity = if block.has_silhouettes != 0 {
            self.hull_max / (1.0 + exp(min((least - 0.25) * (1.0 / 0.03), 80.0)))
        } else {
            1.0
        };
        let disparity = self.disparity * inverse;
        let depth = if opacity < 0.5 { 0.0 } else { 1.0 / max(disparity, 1.0e-6) };
        let confidence = min(self.seen_weight * inverse, 1.0) * min(self.seen_share * inverse, 1.0)
            / (1.0 + exp(min((least - 0.12) * 50.0, 80.0)));
        let scale = inverse * opacity;
        let colour = [self.colour[0] * scale, self.colour[1] * scale, self.colour[2] * scale, opacity];
        Blended { colour, depth, confidence }
    }
}

/// The least cost of the planes in the first so many groups.
#[inline(always)]
pub fn least_cost(costs: &[Planes; MAX_GROUPS], groups: usize) -> f32 {
    let mut least = [f32::MAX; PLANES];
    let mut group = 0;
    while group < groups {
        lessen(&mut least, &costs[group]);
        group += 1;
    }
    least_of(&least)
}

/// The costs of all planes at an image coordinate of the target: bilinear in the volume.
#[inline(always)]
pub fn pixel_costs(block: &BlendBlock, costs: &(impl Fetch<Planes> + ?Sized), at: [f32; 2]) -> [Planes; MAX_GROUPS] {
    let (width, height) = (block.volume_width, block.volume_height);
    let groups = block.group_count as usize;
    let (left, right, share_x) = split(at[0] * (width as f32 / block.target.width as f32), width);
    let (top, bottom, share_y) = split(at[1] * (height as f32 / block.target.height as f32), height);
    let place = |column: usize, row: usize| (row * width as usize + column) * groups;
    let corners = [place(left, top), place(right, top), place(left, bottom), place(right, bottom)];
    let shares =
        [(1.0 - share_x) * (1.0 - share_y), share_x * (1.0 - share_y), (1.0 - share_x) * share_y, share_x * share_y];
    let mut here = [[0.0; PLANES]; MAX_GROUPS];
    let mut group = 0;
    while group < groups {
        let mut corner = 0;
        while corner < 4 {
            let there = costs.fetch(corners[corner] + group);
            let mut plane = 0;
            while plane < PLANES {
                here[group][plane] += shares[corner] * there[plane];
                plane += 1;
            }
            corner += 1;
        }
        group += 1;
    }
    here
}

impl BlendBlock {
    /// Disparity of a plane.
    #[inline(always)]
    pub fn disparity(&self, plane: usize) -> f32 {
        self.far_disparity + plane as f32 * self.disparity_step
    }

    /// The shape of its volume of costs.
    pub fn volume(&self) -> CostBlock {
        CostBlock { width: self.volume_width, height: self.volume_height, group_count: self.group_count, padding: 0 }
    }
}
