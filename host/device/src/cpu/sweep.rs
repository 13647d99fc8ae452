//! The plane sweep's views compared on a group of planes at a time. The sums are those of the bodies, in their order,
//! so the results are the same bits; what the bodies do for one plane after the other is done here for all planes of a
//! group: projections, places and shares of a look-up first, in vectors, then the loads, then what follows from the
//! texels.
#![expect(
    clippy::needless_range_loop,
    reason = "loops over the planes of a group index several arrays, and become vectors"
)]

use super::tracks::{Corners, Points, image, map, whole};
use crate::parallel::for_each_row;
use pulp::{Arch, Simd, WithSimd};
use std::sync::Mutex;
use viewfuse_core::math::{abs, clamp, max, min};
use viewfuse_kernels::plane_sweep::evidence::{MAX_DIFFERENCE, MIN_ALPHA, UNSEEN, ViewPair, planes_behind};
use viewfuse_kernels::plane_sweep::front::{FREE_PLANES, opacity_of};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView, Track};
use viewfuse_kernels::plane_sweep::{MAX_GROUPS, MAX_MATCHED, PLANES, Planes};
use viewfuse_kernels::visual_hull::fade;

/// What is shared by all groups of a frustum.
struct Comparison<'a> {
    block: &'a FrustumBlock,
    views: &'a [SweptView],
    pairs: &'a [ViewPair],
    texels: &'a [[f32; 4]],
    disparities: &'a [[f32; 2]],
}

/// A group's sums over the views.
struct Sums {
    colours: [[Planes; 3]; MAX_MATCHED],
    grey: [Planes; MAX_MATCHED],
    hull: Planes,
    dissent: Planes,
    informed: Planes,
}

pub(super) fn compare_views(
    block: &FrustumBlock,
    views: &[SweptView],
    pairs: &[ViewPair],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    grey: &mut [Planes],
    evidence: &mut [Planes],
) {
    let groups = block.group_count as usize;
    let row_len = block.camera.width as usize * groups;
    let slice = block.row_count as usize * row_len;
    let (views, pairs) = (&views[..block.view_count as usize], &pairs[..block.pair_count as usize]);
    let comparison = Comparison { block, views, pairs, texels, disparities };
    // A row of the evidence, and the same row of each view's grey.
    let mut views_of_row: Vec<Vec<&mut [Planes]>> = (0..block.row_count).map(|_| Vec::new()).collect();
    for view in grey[..slice * views.len()].chunks_exact_mut(slice) {
        views_of_row.iter_mut().zip(view.chunks_exact_mut(row_len)).for_each(|(rows, row)| rows.push(row));
    }
    let views_of_row: Vec<Mutex<Vec<&mut [Planes]>>> = views_of_row.into_iter().map(Mutex::new).collect();
    for_each_row(&mut evidence[..4 * slice], 4 * row_len, 512, |row, evidence| {
        let Ok(mut grey) = views_of_row[row].lock() else { return };
        Arch::new().dispatch(Compared { comparison: &comparison, row, grey: &mut grey, evidence });
    });
}

/// A row of a band that is compared.
struct Compared<'a, 'g> {
    comparison: &'a Comparison<'a>,
    row: usize,
    grey: &'a mut [&'g mut [Planes]],
    evidence: &'a mut [Planes],
}

impl WithSimd for Compared<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.comparison.row(self.row, self.grey, self.evidence);
    }
}

impl Comparison<'_> {
    /// A row of the band.
    #[inline(always)]
    fn row(&self, row: usize, grey: &mut [&mut [Planes]], evidence: &mut [Planes]) {
        let Comparison { block, views, .. } = self;
        let groups = block.group_count as usize;
        let mut tracks: Vec<Track> = Vec::with_capacity(views.len());
        let mut sums = Sums::new();
        for column in 0..block.camera.width as usize {
            let pixel = (block.first_row as usize + row) * block.camera.width as usize + column;
            tracks.clear();
            tracks.extend(views.iter().map(|view| block.track(&view.camera, pixel as u32)));
            for group in 0..groups {
                let at = column * groups + group;
                self.group(&tracks, group, &mut sums, &mut evidence[4 * at..][..4]);
                grey.iter_mut().zip(&sums.grey).for_each(|(row, grey)| row[at] = *grey);
            }
        }
    }

    /// A group of planes of a pixel: difference, weight, dissent, hull.
    #[inline(always)]
    fn group(&self, tracks: &[Track], group: usize, sums: &mut Sums, evidence: &mut [Planes]) {
        let planes = planes(self.block, group);
        (sums.hull, sums.dissent, sums.informed) = ([1.0; PLANES], [0.0; PLANES], [0.0; PLANES]);
        for (slot, (view, track)) in self.views.iter().zip(tracks).enumerate() {
            let points = Points::new(track, &planes);
            if !points.are_any_in_image() {
                sums.add_unseen(slot, self.block.has_silhouettes != 0);
                continue;
            }
            self.add_colours(view, slot, &points, sums);
            if view.disparity_step > 0.0 {
                self.add_dissent(view, &planes, &points, sums);
            }
        }
        let [difference, weight, dissent, hull] = evidence else { return };
        (*difference, *weight) = self.compare(sums);
        for plane in 0..PLANES {
            dissent[plane] = sums.dissent[plane] / max(sums.informed[plane], 1.0e-6);
        }
        *hull = sums.hull;
    }

    /// A view's colours and grey, and its part of the hull.
    #[inline(always)]
    fn add_colours(&self, view: &SweptView, slot: usize, points: &Points<PLANES>, sums: &mut Sums) {
        let looked = look_up(view, self.texels, points);
        let mut alpha = [0.0; PLANES];
        for plane in 0..PLANES {
            alpha[plane] = looked[plane][3];
        }
        if self.block.has_silhouettes != 0 {
            for plane in 0..PLANES {
                sums.hull[plane] *= alpha[plane];
            }
        }
        let colours = &mut sums.colours[slot];
        // Most photographs are opaque: a division by 1 changes nothing.
        if alpha.iter().fold(true, |opaque, alpha| opaque & (*alpha == 1.0)) {
            for channel in 0..3 {
                for plane in 0..PLANES {
                    colours[channel][plane] = looked[plane][channel] * view.gain[channel];
                }
            }
        } else {
            for channel in 0..3 {
                for plane in 0..PLANES {
                    let divisor = if alpha[plane] >= MIN_ALPHA { alpha[plane] } else { 1.0 };
                    colours[channel][plane] = looked[plane][channel] / divisor * view.gain[channel];
                }
            }
        }
        let grey = &mut sums.grey[slot];
        for plane in 0..PLANES {
            let mean = (colours[0][plane] + colours[1][plane] + colours[2][plane]) * (1.0 / 3.0);
            grey[plane] = if alpha[plane] >= MIN_ALPHA { mean } else { UNSEEN };
        }
    }

    /// How far the points contradict a view's own disparities.
    #[inline(always)]
    fn add_dissent(&self, view: &SweptView, planes: &Planes, points: &Points<PLANES>, sums: &mut Sums) {
        let (surfaces, confidences) = surfaces(view, self.disparities, points);
        let density = 0.5 / view.disparity_step;
        for plane in 0..PLANES {
            let disparity = planes[plane] * points.disparity_ratio[plane];
            let behind = planes_behind(surfaces[plane], disparity, density);
            let doubt = 1.0 - fade(0.707_106_77 * behind);
            sums.dissent[plane] += view.weight * confidences[plane] * doubt;
            sums.informed[plane] += view.weight * points.in_image[plane];
        }
    }

    /// The pairs' differences, weighted and summed, and their weights.
    #[inline(always)]
    fn compare(&self, sums: &Sums) -> (Planes, Planes) {
        let mut difference = [0.0; PLANES];
        let mut weight = [0.0; PLANES];
        for pair in self.pairs {
            let (first, second) = (pair.first as usize, pair.second as usize);
            let (a, b) = (&sums.colours[first], &sums.colours[second]);
            let (grey_a, grey_b) = (&sums.grey[first], &sums.grey[second]);
            // Read once: a load under a condition would keep the loop from becoming vectors.
            let both_weight = pair.weight;
            for plane in 0..PLANES {
                let seen = if min(grey_a[plane], grey_b[plane]) >= 0.0 { both_weight } else { 0.0 };
                let sum =
                    abs(a[0][plane] - b[0][plane]) + abs(a[1][plane] - b[1][plane]) + abs(a[2][plane] - b[2][plane]);
                difference[plane] += seen * min(sum * (1.0 / 3.0), MAX_DIFFERENCE);
                weight[plane] += seen;
            }
        }
        (difference, weight)
    }
}

impl Sums {
    fn new() -> Sums {
        let none = [0.0; PLANES];
        Sums {
            colours: [[none; 3]; MAX_MATCHED],
            grey: [[UNSEEN; PLANES]; MAX_MATCHED],
            hull: none,
            dissent: none,
            informed: none,
        }
    }

    /// A view outside whose image all points lie.
    #[inline(always)]
    fn add_unseen(&mut self, slot: usize, has_silhouettes: bool) {
        self.colours[slot] = [[0.0; PLANES]; 3];
        self.grey[slot] = [UNSEEN; PLANES];
        if has_silhouettes {
            self.hull = [0.0; PLANES];
        }
    }
}

/// Bilinear look-ups of a group's points in a view, as `viewfuse_core::lookup::bilinear`; zeros outside its image.
#[inline(always)]
fn look_up(view: &SweptView, texels: &[[f32; 4]], points: &Points<PLANES>) -> [[f32; 4]; PLANES] {
    let image = image(view, texels);
    let corners = Corners::new(&points.x, &points.y, view.camera.width, view.camera.height);
    let mut looked = [[0.0; 4]; PLANES];
    for plane in 0..PLANES {
        if points.in_image[plane] > 0.0 {
            looked[plane] = corners.mixed(image, plane);
        }
    }
    looked
}

/// Disparity and confidence of the surfaces that a view's own map has there; zeros outside its image.
#[inline(always)]
fn surfaces(view: &SweptView, disparities: &[[f32; 2]], points: &Points<PLANES>) -> (Planes, Planes) {
    let (last_column, last_row) = (view.camera.width as f32 - 1.0, view.camera.height as f32 - 1.0);
    let mut at = [0; PLANES];
    for plane in 0..PLANES {
        // Points outside the image may lie anywhere.
        let column = whole(clamp(points.x[plane], 0.0, last_column));
        let row = whole(clamp(points.y[plane], 0.0, last_row));
        at[plane] = row * view.map_width as i32 + column;
    }
    let map = map(view, disparities);
    let (mut surfaces, mut confidences) = ([0.0; PLANES], [0.0; PLANES]);
    for plane in 0..PLANES {
        [surfaces[plane], confidences[plane]] = map[at[plane] as usize];
    }
    for plane in 0..PLANES {
        confidences[plane] *= points.in_image[plane];
    }
    (surfaces, confidences)
}

pub(super) fn plane_opacity(
    block: &FrustumBlock,
    views: &[SweptView],
    disparities: &[[f32; 2]],
    opacities: &mut [Planes],
) {
    let row_len = (block.camera.width * block.group_count) as usize;
    let views = &views[..block.view_count as usize];
    for_each_row(&mut opacities[..block.camera.height as usize * row_len], row_len, 128, |row, opacities| {
        Arch::new().dispatch(Opaque { block, views, disparities, row, opacities });
    });
}

/// A row of a volume whose opacities are sought.
struct Opaque<'a> {
    block: &'a FrustumBlock,
    views: &'a [SweptView],
    disparities: &'a [[f32; 2]],
    row: usize,
    opacities: &'a mut [Planes],
}

impl WithSimd for Opaque<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Opaque { block, views, disparities, row, opacities } = self;
        for (column, groups) in opacities.chunks_exact_mut(block.group_count as usize).enumerate() {
            let pixel = row * block.camera.width as usize + column;
            let (mut support, mut violation) = ([[0.0; PLANES]; MAX_GROUPS], [[0.0; PLANES]; MAX_GROUPS]);
            for view in views.iter().filter(|view| view.disparity_step > 0.0) {
                let track = block.track(&view.camera, pixel as u32);
                let density = 1.0 / view.disparity_step;
                for group in 0..groups.len() {
                    let planes = planes(block, group);
                    let points = Points::new(&track, &planes);
                    if !points.are_any_in_image() {
                        continue;
                    }
                    let (surfaces, confidences) = surfaces(view, disparities, &points);
                    for plane in 0..PLANES {
                        let disparity = planes[plane] * points.disparity_ratio[plane];
                        let behind = planes_behind(surfaces[plane], disparity, density);
                        support[group][plane] += confidences[plane] * fade(0.707_106_77 * behind);
                        let free = max(-behind - FREE_PLANES, 0.0);
                        violation[group][plane] += confidences[plane] * (1.0 - fade(0.707_106_77 * free));
                    }
                }
            }
            for (group, opacity) in groups.iter_mut().enumerate() {
                *opacity = opacity_of(&support[group], &violation[group]);
            }
        }
    }
}

/// The disparities of a group.
#[inline(always)]
fn planes(block: &FrustumBlock, group: usize) -> Planes {
    std::array::from_fn(|plane| block.disparity(group * PLANES + plane))
}
