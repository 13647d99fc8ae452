//! A picture from rays whose samples are interpolated between nodes: which nodes of which rays are evaluated.
//!
//! Grids of rays follow one another, the widest first. On a ray of the first grid all nodes are candidates, on the
//! others those that its neighbours on the grid before did not find empty (in small pictures these and the next ones:
//! see [`SMALL`]); the others are the mean of the neighbours' nodes, so that thin mist is not lost. Candidates are
//! evaluated some at a time, from the front, until the ray is opaque.

use super::network::Workspace;
use super::node_ray::NodeRay;
use super::pass::{Evaluated, Renderer};
use super::picture::{between, between_grids, first_step, grid, widest_step};
use crate::{FieldError, Rendered};
use std::mem::replace;
use viewfuse_core::rays::{RayPoint, TargetRay, cast_ray};
use viewfuse_device::Device;
use viewfuse_device::parallel::map;
use viewfuse_kernels::pixelnerf::radiance;

/// The most nodes on a ray.
pub(super) const MAX_NODES: u32 = 128;
/// The widest first grid, in pixels, and the rows and columns that it has at least.
const WIDEST_FIRST_STEP: u32 = 16;
const MIN_FIRST_GRID: u32 = 8;
/// In a picture of fewer pixels, a single one of the background's colour instead of the object's is more than an error
/// of 40 dB, and few checked pixels hardly meet it: a corner of one pixel, whose neighbours on the grid before are
/// empty, may not be lost.
const SMALL: u32 = 2000;
/// A node is empty if a whole ray of its density has less optical depth than the first over the square of the number of
/// nodes, and than the second.
const MIN_OPTICAL_DEPTH: [f32; 2] = [512.0, 1.0];
/// A node that nothing is known of.
const EMPTY: [f32; 4] = [0.0; 4];
/// Candidates of a ray at a time at least, and of all rays: fewer keep no device busy.
const AT_ONCE: usize = 4;
const MIN_POINTS: usize = 4096;

/// The most points that are evaluated at a time, of a picture of so many pixels.
pub(super) fn most_points(pixel_count: usize) -> usize {
    (AT_ONCE * pixel_count).max(MIN_POINTS)
}

/// A picture so far.
struct Unfinished {
    picture: Rendered,
    /// `[pixel]`: bit `node` says that the ray is empty there.
    empty: Vec<u128>,
    /// `[row / 2][column / 2][node]` of the pixels in even rows and columns, as [`NodeRay::values`]: all grids but the
    /// last.
    values: Vec<[f32; 4]>,
    node_count: usize,
}

/// Rays with the values of their nodes.
struct Marched {
    rays: Vec<TargetRay>,
    /// `[ray][node]`.
    values: Vec<[f32; 4]>,
    /// `[ray]`: bit `node` says that it was evaluated.
    known: Vec<u128>,
}

impl<D: Device> Renderer<'_, D> {
    /// The whole picture; depths are along the rays.
    pub(super) fn picture_between_nodes(
        &self,
        workspace: &mut Workspace<D>,
        evaluated: &mut [Evaluated; 2],
    ) -> Result<Rendered, FieldError> {
        let picture = self.empty_picture();
        let (width, height, count) = (picture.width, picture.height, picture.colours.len());
        let node_count = self.omissions.nodes as usize;
        let values = vec![EMPTY; (width.div_ceil(2) * height.div_ceil(2)) as usize * node_count];
        let mut so_far = Unfinished { picture, empty: vec![0; count], values, node_count };
        let (most_difference, far_difference) = self.interpolation();
        let most_step = widest_step(width.min(height));
        let is_small = width * height < SMALL;
        let mut step = first_step(width.min(height), WIDEST_FIRST_STEP, MIN_FIRST_GRID);
        let first: Vec<u32> = grid([width, height], step).map(|[column, row]| row * width + column).collect();
        let candidates = vec![self.all_nodes(); first.len()];
        let values = vec![EMPTY; first.len() * node_count];
        self.render_nodes(workspace, &first, &candidates, values, evaluated, &mut so_far)?;
        while step > 1 {
            let half = step / 2;
            let (mut pixels, mut candidates, mut values) = (Vec::new(), Vec::new(), Vec::new());
            for [column, row] in between_grids([width, height], step) {
                let pixel = (row * width + column) as usize;
                let around = so_far.around([column, row], step);
                let empty = so_far.empty_around(around, step, if is_small { step } else { 0 });
                let is_alike = || between(&so_far.picture, [column, row], step, most_difference, far_difference);
                let may_be_alike = step <= most_step && (!is_small || empty == self.all_nodes());
                match may_be_alike.then(is_alike).flatten() {
                    Some((colour, depth)) => {
                        so_far.picture.colours[pixel] = colour;
                        so_far.picture.depths[pixel] = depth;
                        so_far.empty[pixel] = empty;
                        if half > 1 {
                            let mean = so_far.mean(around).collect::<Vec<_>>();
                            so_far.keep(pixel, &mean);
                        }
                    }
                    None => {
                        pixels.push(pixel as u32);
                        values.extend(so_far.mean(around));
                        // One node to either side of what is not empty is a candidate, too.
                        let not_empty = self.all_nodes() & !empty;
                        candidates.push((not_empty | not_empty << 1 | not_empty >> 1) & self.all_nodes());
                    }
                }
            }
            self.render_nodes(workspace, &pixels, &candidates, values, evaluated, &mut so_far)?;
            step = half;
        }
        for (evaluated, samples) in evaluated.iter_mut().zip(self.sampling.counts()) {
            evaluated.samples += count as u64 * u64::from(samples);
        }
        Ok(so_far.picture)
    }

    /// Colours of some pixels, each from all nodes of a ray of its own.
    pub(super) fn pixels_of_nodes(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        evaluated: &mut Evaluated,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        let values = vec![EMPTY; pixels.len() * self.omissions.nodes as usize];
        let marched = self.march(workspace, pixels, &vec![self.all_nodes(); pixels.len()], values, evaluated)?;
        Ok(self.composite_nodes(pixels, &marched).into_iter().map(|(colour, _)| colour).collect())
    }

    /// Colours and depths (along the rays) of rays with their nodes' values.
    fn composite_nodes(&self, pixels: &[u32], marched: &Marched) -> Vec<([f32; 4], f32)> {
        let (count, sampling, background) = (self.omissions.nodes as usize, &self.sampling, &self.background);
        map(pixels.len(), 16, |ray| {
            let values = &marched.values[ray * count..(ray + 1) * count];
            let found = NodeRay { ray: marched.rays[ray], values }.composite(pixels[ray], sampling, background);
            let [red, green, blue] = found.channels;
            ([red, green, blue, found.opacity], found.depth)
        })
    }

    fn all_nodes(&self) -> u128 {
        bits(self.omissions.nodes as usize)
    }

    /// Renders some pixels of a picture, evaluating candidates only; the other nodes have the given values.
    fn render_nodes(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        candidates: &[u128],
        values: Vec<[f32; 4]>,
        evaluated: &mut [Evaluated; 2],
        so_far: &mut Unfinished,
    ) -> Result<(), FieldError> {
        let count = self.omissions.nodes as usize;
        let pass = if self.sampling.counts()[1] > 0 { 1 } else { 0 };
        let marched = self.march(workspace, pixels, candidates, values, &mut evaluated[pass])?;
        evaluated[pass].evaluated += marched.known.iter().map(|known| u64::from(known.count_ones())).sum::<u64>();
        let least = self.least_density();
        for (ray, pixel) in pixels.iter().enumerate() {
            let nodes = &marched.values[ray * count..(ray + 1) * count];
            let is_empty = |node: &usize| marched.known[ray] >> node & 1 != 0 && nodes[*node][3] < least;
            let found = (0..count).filter(is_empty).fold(0, |empty, node| empty | 1 << node);
            so_far.empty[*pixel as usize] = found | self.all_nodes() & !candidates[ray];
            so_far.keep(*pixel as usize, nodes);
        }
        for (pixel, (colour, depth)) in pixels.iter().zip(self.composite_nodes(pixels, &marched)) {
            so_far.picture.colours[*pixel as usize] = colour;
            so_far.picture.depths[*pixel as usize] = depth;
        }
        Ok(())
    }

    /// Evaluates the candidates along rays until these are opaque.
    fn march(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        candidates: &[u128],
        mut values: Vec<[f32; 4]>,
        evaluated: &mut Evaluated,
    ) -> Result<Marched, FieldError> {
        let count = self.omissions.nodes as usize;
        let spacing = (self.cast.far - self.cast.near) / count as f32;
        let rays: Vec<TargetRay> = pixels.iter().map(|pixel| cast_ray(&self.cast, *pixel)).collect();
        let (mut known, mut left) = (vec![0_u128; pixels.len()], candidates.to_vec());
        let mut transmittances = vec![1.0_f32; pixels.len()];
        loop {
            let mut points = Vec::new();
            let is_left = |(left, transmittance): (&u128, &f32)| *left != 0 && *transmittance > self.early_termination;
            let ray_count = left.iter().zip(&transmittances).filter(|ray| is_left(*ray)).count();
            let at_once = AT_ONCE.max(MIN_POINTS / ray_count.max(1));
            for (ray, left) in left.iter_mut().enumerate() {
                for _ in 0..at_once {
                    if *left == 0 || transmittances[ray] <= self.early_termination {
                        break;
                    }
                    let node = left.trailing_zeros() as usize;
                    *left &= *left - 1;
                    known[ray] |= 1 << node;
                    points.push(point(&rays[ray], ray, node, count));
                }
            }
            if points.is_empty() {
                break;
            }
            for some in points.chunks(workspace.point_count as usize) {
                let raw = self.evaluate_at(workspace, some, evaluated)?;
                for (point, raw) in some.iter().zip(raw.as_chunks::<4>().0) {
                    let [red, green, blue, _] = radiance(raw, point);
                    values[point.sample as usize] = [red, green, blue, raw[3]];
                    transmittances[point.sample as usize / count] *= (-raw[3].max(0.0) * spacing).exp();
                }
            }
        }
        // What is behind an opaque node goes on as it is: too little of it is seen.
        for (ray, transmittance) in transmittances.iter().enumerate() {
            if *transmittance <= self.early_termination && known[ray] != 0 {
                let nodes = &mut values[ray * count..(ray + 1) * count];
                let last = 127 - known[ray].leading_zeros() as usize;
                let behind = nodes[last];
                nodes[last..].fill(behind);
            }
        }
        Ok(Marched { rays, values, known })
    }

    /// The second pass's raw outputs at points, four each.
    fn evaluate_at(
        &self,
        workspace: &mut Workspace<D>,
        points: &[RayPoint],
        evaluated: &mut Evaluated,
    ) -> Result<Vec<f32>, FieldError> {
        self.progress.check()?;
        let points_before = replace(&mut workspace.points, self.device.upload(points)?);
        let left_out = self.fine.evaluate_visible(workspace, self.views, points.len() as u32);
        workspace.points = points_before;
        evaluated.unseen += left_out?;
        Ok(self.device.download_first(&workspace.raw, 4 * points.len())?)
    }

    /// The density below which a node is empty: more nodes are for less error.
    fn least_density(&self) -> f32 {
        let optical_depth = (MIN_OPTICAL_DEPTH[0] / (self.omissions.nodes as f32).powi(2)).min(MIN_OPTICAL_DEPTH[1]);
        optical_depth / (self.cast.far - self.cast.near)
    }
}

impl Unfinished {
    /// The neighbours of a pixel on the grid of `step`, left and right above and below; those outside of the picture
    /// are those inside.
    fn around(&self, [column, row]: [u32; 2], step: u32) -> [usize; 4] {
        let Rendered { width, height, .. } = self.picture;
        let ends = |place: u32, side: u32| {
            let (before, last) = (place / step * step, (side - 1) / step * step);
            [before, if place.is_multiple_of(step) { before } else { (before + step).min(last) }]
        };
        let ([left, right], [top, bottom]) = (ends(column, width), ends(row, height));
        [[left, top], [right, top], [left, bottom], [right, bottom]]
            .map(|[column, row]| (row * width + column) as usize)
    }

    /// The nodes that are empty at the four neighbours of a pixel on the grid of `step`, and at those up to `reach`
    /// pixels beyond.
    fn empty_around(&self, around: [usize; 4], step: u32, reach: u32) -> u128 {
        let Rendered { width, height, .. } = self.picture;
        let place = |pixel: usize| [pixel as u32 % width, pixel as u32 / width];
        let ([left, top], [right, bottom]) = (place(around[0]), place(around[3]));
        let on_grid = |first: u32, last: u32, side: u32| {
            (first.saturating_sub(reach)..=(last + reach).min(side - 1)).step_by(step as usize)
        };
        let rows = on_grid(top, bottom, height);
        let pixels =
            rows.flat_map(|row| on_grid(left, right, width).map(move |column| (row * width + column) as usize));
        pixels.fold(u128::MAX, |empty, pixel| empty & self.empty[pixel])
    }

    /// Where the nodes of a pixel are; none in odd rows and columns.
    fn place(&self, pixel: usize) -> Option<usize> {
        let width = self.picture.width as usize;
        let (column, row) = (pixel % width, pixel / width);
        let is_kept = column.is_multiple_of(2) && row.is_multiple_of(2);
        is_kept.then(|| (row / 2 * width.div_ceil(2) + column / 2) * self.node_count)
    }

    /// Keeps the nodes of a pixel for the grids behind.
    fn keep(&mut self, pixel: usize, nodes: &[[f32; 4]]) {
        if let Some(first) = self.place(pixel) {
            self.values[first..first + nodes.len()].copy_from_slice(nodes);
        }
    }

    /// The mean of four pixels' nodes, of rectified densities.
    fn mean(&self, around: [usize; 4]) -> impl Iterator<Item = [f32; 4]> {
        let rows =
            around.map(|pixel| self.place(pixel).map_or(&[][..], |first| &self.values[first..first + self.node_count]));
        (0..self.node_count).map(move |node| {
            let mut mean = EMPTY;
            for [red, green, blue, density] in rows.iter().filter_map(|row| row.get(node)) {
                let value = [*red, *green, *blue, density.max(0.0)];
                mean = [0, 1, 2, 3].map(|channel| mean[channel] + 0.25 * value[channel]);
            }
            mean
        })
    }
}

/// The lowest `count` bits.
fn bits(count: usize) -> u128 {
    if count >= 128 { u128::MAX } else { (1 << count) - 1 }
}

fn point(ray: &TargetRay, index: usize, node: usize, count: usize) -> RayPoint {
    let depth = NodeRay::depth(ray, node, count);
    let position = [0, 1, 2].map(|axis| ray.origin[axis] + ray.direction[axis] * depth);
    RayPoint { position, length: 0.0, direction: ray.direction, sample: (index * count + node) as u32 }
}
