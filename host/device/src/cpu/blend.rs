//! A target's pixels blended from the planes of a sweep, the planes that have a share some at a time. The sums are
//! those of the body, in their order, so the results are the same bits; a view's track is made once for a pixel, not
//! for every plane.

use super::tracks::{Corners, Points, image, map};
use crate::parallel::{Rest, for_each_piece};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;
use viewfuse_core::math::{exp, max};
use viewfuse_kernels::plane_sweep::blend::{
    BlendBlock, BlendSums, Blended, CUTOFF, HIDDEN_SHARE, least_cost, pixel_costs,
};
use viewfuse_kernels::plane_sweep::evidence::planes_behind;
use viewfuse_kernels::plane_sweep::frustum::{SweptView, Track};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};
use viewfuse_kernels::store::Store;
use viewfuse_kernels::visual_hull::fade;

/// Planes at a time: fewer than a group has, since few have a share.
const LANES: usize = 8;
type Lanes = [f32; LANES];

#[expect(clippy::too_many_arguments, reason = "the kernel's row")]
pub(super) fn blend_planes(
    block: &BlendBlock,
    first_row: u32,
    row_count: u32,
    views: &[SweptView],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    costs: &[Planes],
    colours: &mut [[f32; 4]],
    pixel_depths: &mut [f32],
    confidences: &mut [f32],
) {
    let width = block.target.width;
    let blending = Blending { block, views: &views[..block.view_count as usize], texels, disparities, costs };
    let (mut colours, mut depths) = (Rest::new(colours), Rest::new(pixel_depths));
    let mut confidences = Rest::new(confidences);
    let take = move |pixels: Range<u32>| {
        let (start, end) = (pixels.start as usize, pixels.end as usize);
        (colours.take(start, end), depths.take(start, end), confidences.take(start, end))
    };
    for_each_piece(first_row * width..(first_row + row_count) * width, 64, take, |pixels, part| {
        let (mut colours, mut depths, mut confidences) = part;
        let store = |pixel: u32, seen: Blended| {
            colours.store(pixel as usize, seen.colour);
            depths.store(pixel as usize, seen.depth);
            confidences.store(pixel as usize, seen.confidence);
        };
        Arch::new().dispatch(Piece { blending: &blending, pixels, store });
    });
}

/// Pixels that are blended.
struct Piece<'a, F> {
    blending: &'a Blending<'a>,
    pixels: Range<u32>,
    store: F,
}

impl<F: FnMut(u32, Blended)> WithSimd for Piece<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Piece { blending, pixels, mut store } = self;
        let mut views: Vec<SeenView> = Vec::with_capacity(blending.views.len());
        for pixel in pixels {
            store(pixel, blending.pixel(pixel, &mut views));
        }
    }
}

/// What is shared by all pixels.
struct Blending<'a> {
    block: &'a BlendBlock,
    views: &'a [SweptView],
    texels: &'a [[f32; 4]],
    disparities: &'a [[f32; 2]],
    costs: &'a [Planes],
}

/// A pixel's ray in a view, and which of its points of some planes lie in the view's image.
struct SeenView {
    track: Track,
    in_image: Lanes,
}

/// Planes of a pixel that have a share; lanes from `count` on are no planes.
struct Batch {
    shares: Lanes,
    disparities: Lanes,
    count: usize,
}

impl Blending<'_> {
    #[inline(always)]
    fn pixel(&self, pixel: u32, views: &mut Vec<SeenView>) -> Blended {
        let Blending { block, .. } = self;
        let at = [(pixel % block.target.width) as f32 + 0.5, (pixel / block.target.width) as f32 + 0.5];
        let groups = block.group_count as usize;
        let costs = pixel_costs(block, self.costs, at);
        let least = least_cost(&costs, groups);
        views.clear();
        views.extend(self.views.iter().map(|view| SeenView {
            track: Track::new(&block.target, &view.camera, at[0], at[1]),
            in_image: [0.0; LANES],
        }));
        let mut sums = BlendSums::NONE;
        let mut batch = Batch { shares: [0.0; LANES], disparities: [0.0; LANES], count: 0 };
        for plane in 0..groups * PLANES {
            let excess = (costs[plane / PLANES][plane % PLANES] - least) * block.sharpness;
            if excess <= CUTOFF {
                batch.shares[batch.count] = exp(-excess);
                batch.disparities[batch.count] = block.disparity(plane);
                batch.count += 1;
            }
            if batch.count == LANES || (batch.count > 0 && plane + 1 == groups * PLANES) {
                self.add(&batch, views, &mut sums);
                batch.count = 0;
            }
        }
        sums.pixel(block, least)
    }

    /// Adds planes.
    #[inline(always)]
    fn add(&self, batch: &Batch, views: &mut [SeenView], sums: &mut BlendSums) {
        let mut seen = [[0.0; 4]; LANES];
        let mut hull = [1.0; LANES];
        for (view, SeenView { track, in_image }) in self.views.iter().zip(&mut *views) {
            let points = Points::new(track, &batch.disparities);
            *in_image = points.in_image;
            let mut parts = [view.weight * HIDDEN_SHARE; LANES];
            if points.are_any_in_image() {
                let visible = self.visibility(view, &points, &batch.disparities);
                for lane in 0..LANES {
                    let part = parts[lane] + view.weight * visible[lane];
                    parts[lane] = if points.in_image[lane] > 0.0 { part } else { parts[lane] };
                }
            }
            let image = image(view, self.texels);
            let corners = Corners::new(&points.x, &points.y, view.camera.width, view.camera.height);
            // The fourth channel is the weight, to which gains do not apply.
            let gain = [view.gain[0], view.gain[1], view.gain[2], 1.0];
            for lane in 0..batch.count {
                let texel = corners.mixed(image, lane);
                for channel in 0..4 {
                    seen[lane][channel] += parts[lane] * texel[channel] * gain[channel];
                }
                hull[lane] *= if points.in_image[lane] > 0.0 { texel[3] } else { 0.0 };
            }
        }
        for lane in 0..batch.count {
            let share = batch.shares[lane];
            for (view, SeenView { in_image, .. }) in self.views.iter().zip(&*views) {
                if in_image[lane] > 0.0 {
                    sums.seen_weight += share * view.weight;
                }
            }
            let [red, green, blue, weight] = seen[lane];
            let hull = if self.block.has_silhouettes != 0 { hull[lane] } else { 1.0 };
            sums.add(share, batch.disparities[lane], &[red, green, blue], weight, hull);
        }
    }

    /// As the body's `visibility`; no number where a point is outside the image.
    #[inline(always)]
    fn visibility(&self, view: &SweptView, points: &Points<LANES>, disparities: &Lanes) -> Lanes {
        if !(view.disparity_step > 0.0) {
            return [1.0; LANES];
        }
        let scales =
            [view.map_width as f32 / view.camera.width as f32, view.map_height as f32 / view.camera.height as f32];
        let (x, y) = (points.x.map(|x| x * scales[0]), points.y.map(|y| y * scales[1]));
        let corners = Corners::new(&x, &y, view.map_width, view.map_height);
        let map = map(view, self.disparities);
        let (mut surfaces, mut visible) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
        for lane in 0..LANES {
            let nodes = corners.nodes(map, lane);
            for node in 0..4 {
                [surfaces[node][lane], visible[node][lane]] = nodes[node];
            }
        }
        let density = 0.5 / view.disparity_step;
        for node in 0..4 {
            for lane in 0..LANES {
                let disparity = disparities[lane] * points.disparity_ratio[lane];
                let behind = max(planes_behind(surfaces[node][lane], disparity, density) - 1.0, 0.0);
                visible[node][lane] = 1.0 - visible[node][lane] * (1.0 - fade(0.707_106_77 * behind));
            }
        }
        corners.weighted(&visible)
    }
}
