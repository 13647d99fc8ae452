//! PixelNeRF's point network as one operation: a view's blocks, fusion of the views, the blocks behind.
//!
//! Chunks of some dozens of points go through all layers, so that activations stay in a core's caches; the backward
//! pass computes them again, for the points that have a gradient: most of a ray's are in empty space or behind a
//! surface. The library's operations would move 90 times the activations through memory for the same work.

use super::convolve::of_all;
use super::linear::{layer_gradient, linear, linear_back, rectified};
use super::{Operation, Real};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::pixelnerf::{EmbedBlock, GatherBlock, GridPlace, in_view_axes, waves};

/// Points of a chunk.
const CHUNK: usize = 64;
/// A point is omitted from the backward pass if its gradient is less than this share of the points' mean (sums of
/// magnitudes). All that is omitted together is then at most this share of the whole.
const NEGLIGIBLE: f64 = 1.0e-4;

/// Sizes of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PointNetworkSizes {
    /// Inputs for a point in a view.
    pub(crate) embedded_len: usize,
    /// Width of all layers.
    pub(crate) width: usize,
    /// Residual blocks.
    pub(crate) block_count: usize,
    /// Blocks in front of which latents are added; behind them the views are fused.
    pub(crate) injected_count: usize,
}

impl PointNetworkSizes {
    /// How many parameters there are, in this order: `lin_in`, two layers a block, `lin_out`; of each layer the weights
    /// `[output][input]`, then the biases.
    pub(crate) fn parameter_count(&self) -> usize {
        self.layer(Part::Exit).end
    }

    /// The offset of a layer's parameters.
    fn layer(&self, part: Part) -> Range<usize> {
        let w = self.width;
        let (entry, layer) = (w * self.embedded_len + w, w * w + w);
        match part {
            Part::Entry => 0..entry,
            Part::Block(block, which) => {
                let start = entry + (2 * block + which) * layer;
                start..start + layer
            }
            Part::Exit => {
                let start = entry + 2 * self.block_count * layer;
                start..start + 4 * w + 4
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Part {
    Entry,
    Block(usize, usize),
    Exit,
}

/// Projections of points in the views of their object. `[object][view][point]`.
pub(crate) struct Points {
    pub(crate) object_count: usize,
    pub(crate) view_count: usize,
    /// Those of one object.
    pub(crate) point_count: usize,
    embedded_len: usize,
    embedded: Vec<f32>,
    places: Vec<GridNodes>,
}

/// Nodes of a view's grid around a point with their shares, and whether the point is in front of the view.
#[derive(Clone, Copy)]
struct GridNodes {
    nodes: [u32; 4],
    shares: [f32; 4],
    is_visible: bool,
}

impl Points {
    /// `cameras[object][view]`, `points[object][point]`; grids of `grid` rows and columns.
    pub(crate) fn new(
        cameras: &[Vec<CameraBlock>],
        points: &[Vec<RayPoint>],
        embed: &EmbedBlock,
        grid: [usize; 2],
        pixel_centre: f32,
    ) -> Points {
        let (view_count, point_count) = (cameras[0].len(), points[0].len());
        let embedded_len = embed.row_len() as usize;
        // Channels of one: nodes are counted, not numbers.
        let [height, width] = grid.map(|side| side as u32);
        let block = GatherBlock { channel_count: 1, height, width, pixel_centre, ..GatherBlock::default() };
        let row = |object: usize, view: usize, point: usize| {
            let (camera, point) = (&cameras[object][view], &points[object][point]);
            let mut row = Vec::with_capacity(embedded_len);
            let position = in_view_axes(camera, point.position);
            row.extend(position);
            for octave in 0..embed.frequency_count {
                let pairs = position.map(|coordinate| waves(coordinate, octave, embed));
                row.extend(pairs.map(|(sine, _)| sine));
                row.extend(pairs.map(|(_, cosine)| cosine));
            }
            row.extend(in_view_axes(camera, point.direction));
            let place = GridPlace::of(camera, point, &block);
            let (x, y) = (place.share_x, place.share_y);
            let shares = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
            let is_visible = camera.project(point.position.into()).in_front;
            (row, GridNodes { nodes: place.nodes.map(|node| node as u32), shares, is_visible })
        };
        let row_count = cameras.len() * view_count * point_count;
        let (embedded, places): (Vec<Vec<f32>>, Vec<GridNodes>) = (0..row_count)
            .into_par_iter()
            .map(|index| {
                let (object, rest) = (index / (view_count * point_count), index % (view_count * point_count));
                row(object, rest / point_count, rest % point_count)
            })
            .unzip();
        let embedded = embedded.concat();
        Points { object_count: cameras.len(), view_count, point_count, embedded_len, embedded, places }
    }

    /// Rows `[view][point]` of some points of an object.
    fn rows<'a>(&self, object: usize, points: &'a [usize]) -> impl Iterator<Item = usize> + use<'a> {
        let (views, count) = (self.view_count, self.point_count);
        (0..views).flat_map(move |view| points.iter().map(move |point| (object * views + view) * count + point))
    }
}

/// Inputs: latents as the blocks take them `[object and view][node][block][width]`, weights of the views
/// `[object][view]`, parameters (see [`PointNetworkSizes::parameter_count`]). Result `[object and point][4]`.
#[derive(Clone)]
pub(crate) struct PointNetwork {
    pub(crate) sizes: PointNetworkSizes,
    pub(crate) points: Arc<Points>,
    /// Nodes of a view's grid.
    pub(crate) node_count: usize,
    /// Whether the gradients of latents and parameters are needed, or only that of the weights.
    pub(crate) is_frozen: bool,
}

/// Values of a chunk's forward pass for its backward pass.
struct Way<T> {
    embedded: Vec<T>,
    /// The input of each block, and its hidden layer.
    flows: Vec<Vec<T>>,
    insides: Vec<Vec<T>>,
    /// The output of the views' blocks.
    of_views: Vec<T>,
    /// The output of the last block.
    last: Vec<T>,
    raw: Vec<T>,
}

impl PointNetwork {
    fn node_len(&self) -> usize {
        self.sizes.injected_count * self.sizes.width
    }

    /// Weights of the views that have a point in front of them, with their sum before normalisation.
    fn shares<T: Real>(&self, weights: &[T], object: usize, point: usize) -> (Vec<T>, T) {
        let points = &*self.points;
        let views = points.view_count;
        let shares = &weights[object * views..][..views];
        let sees = |view: usize| points.places[(object * views + view) * points.point_count + point].is_visible;
        let seen = (0..views).filter(|&view| sees(view)).count();
        let all = (0..views).filter(|&view| sees(view)).fold(T::zero(), |all, view| all + shares[view]);
        if seen == views || !(all > T::zero()) {
            return (shares.to_vec(), T::one());
        }
        ((0..views).map(|view| if sees(view) { shares[view] / all } else { T::zero() }).collect(), all)
    }

    fn run<T: Real>(&self, [grids, weights, parameters]: [&[T]; 3], object: usize, chunk: &[usize]) -> Way<T> {
        let PointNetworkSizes { embedded_len, width, block_count, injected_count } = self.sizes;
        let points = &*self.points;
        let row_count = points.view_count * chunk.len();
        let mut embedded = Vec::with_capacity(row_count * embedded_len);
        debug_assert_eq!((points.embedded_len, parameters.len()), (embedded_len, self.sizes.parameter_count()));
        for row in points.rows(object, chunk) {
            embedded.extend(points.embedded[row * embedded_len..][..embedded_len].iter().map(|value| T::of(*value)));
        }
        let layer = |part| &parameters[self.sizes.layer(part)];
        let mut flow = linear(&embedded, layer(Part::Entry), embedded_len, width);
        let (mut flows, mut insides) = (Vec::new(), Vec::new());
        let mut of_views = Vec::new();
        for block in 0..block_count {
            if block < injected_count {
                for (row, values) in points.rows(object, chunk).zip(flow.chunks_exact_mut(width)) {
                    let place = &points.places[row];
                    let grid = &grids[row / points.point_count * self.node_count * self.node_len()..];
                    for (node, share) in place.nodes.iter().zip(place.shares) {
                        let share = T::of(share);
                        let from = &grid[*node as usize * self.node_len() + block * width..][..width];
                        values.iter_mut().zip(from).for_each(|(value, from)| *value += *from * share);
                    }
                }
            } else if block == injected_count {
                of_views = std::mem::take(&mut flow);
                flow = self.fuse(&of_views, weights, object, chunk);
            }
            let inside = linear(&rectified(&flow), layer(Part::Block(block, 0)), width, width);
            let more = linear(&rectified(&inside), layer(Part::Block(block, 1)), width, width);
            let next = flow.iter().zip(&more).map(|(flow, more)| *flow + *more).collect();
            flows.push(std::mem::replace(&mut flow, next));
            insides.push(inside);
        }
        if injected_count == block_count {
            of_views = std::mem::take(&mut flow);
            flow = self.fuse(&of_views, weights, object, chunk);
        }
        let raw = linear(&rectified(&flow), layer(Part::Exit), width, 4);
        Way { embedded, flows, insides, of_views, last: flow, raw }
    }

    fn fuse<T: Real>(&self, of_views: &[T], weights: &[T], object: usize, chunk: &[usize]) -> Vec<T> {
        let width = self.sizes.width;
        let mut fused = vec![T::zero(); chunk.len() * width];
        for (index, (&point, values)) in chunk.iter().zip(fused.chunks_exact_mut(width)).enumerate() {
            for (view, share) in self.shares(weights, object, point).0.into_iter().enumerate() {
                let from = &of_views[(view * chunk.len() + index) * width..][..width];
                values.iter_mut().zip(from).for_each(|(value, from)| *value += *from * share);
            }
        }
        fused
    }

    /// Adds a chunk's gradients.
    fn back<T: Real>(
        &self,
        [grids, weights, parameters]: [&[T]; 3],
        gradient: &[T],
        object: usize,
        chunk: &[usize],
        [of_grids, of_weights, of_parameters]: [&mut [T]; 3],
    ) {
        let PointNetworkSizes { embedded_len, width, block_count, injected_count } = self.sizes;
        let points = &*self.points;
        let way = self.run([grids, weights, parameters], object, chunk);
        let layer = |part| &parameters[self.sizes.layer(part)];
        let mut flow = vec![T::zero(); way.last.len()];
        let trains = !self.is_frozen;
        let exit = trains.then(|| &mut of_parameters[self.sizes.layer(Part::Exit)]);
        linear_back(&way.last, layer(Part::Exit), gradient, width, 4, &mut flow, exit);
        for block in (0..block_count).rev() {
            if block + 1 == injected_count {
                flow = self.unfuse(&way.of_views, weights, &flow, object, chunk, of_weights);
                if !trains {
                    return;
                }
            }
            let mut inside = vec![T::zero(); flow.len()];
            let (first, second) = (Part::Block(block, 0), Part::Block(block, 1));
            let of_layer = trains.then(|| &mut of_parameters[self.sizes.layer(second)]);
            linear_back(&way.insides[block], layer(second), &flow, width, width, &mut inside, of_layer);
            let of_layer = trains.then(|| &mut of_parameters[self.sizes.layer(first)]);
            linear_back(&way.flows[block], layer(first), &inside, width, width, &mut flow, of_layer);
            if block < injected_count {
                for (row, values) in points.rows(object, chunk).zip(flow.chunks_exact(width)) {
                    let place = &points.places[row];
                    let view = row / points.point_count % points.view_count;
                    let grid = &mut of_grids[view * self.node_count * self.node_len()..];
                    for (node, share) in place.nodes.iter().zip(place.shares) {
                        let share = T::of(share);
                        let to = &mut grid[*node as usize * self.node_len() + block * width..][..width];
                        to.iter_mut().zip(values).for_each(|(to, value)| *to += *value * share);
                    }
                }
            }
        }
        let entry = &mut of_parameters[self.sizes.layer(Part::Entry)];
        layer_gradient(&way.embedded, &flow, embedded_len, width, entry);
    }

    /// Backward pass through the fusion of views.
    fn unfuse<T: Real>(
        &self,
        of_views: &[T],
        weights: &[T],
        fused: &[T],
        object: usize,
        chunk: &[usize],
        of_weights: &mut [T],
    ) -> Vec<T> {
        let width = self.sizes.width;
        let mut flow = vec![T::zero(); of_views.len()];
        for (index, (&point, values)) in chunk.iter().zip(fused.chunks_exact(width)).enumerate() {
            let (shares, all) = self.shares(weights, object, point);
            let mut dots = Vec::with_capacity(shares.len());
            for (view, share) in shares.iter().enumerate() {
                let at = (view * chunk.len() + index) * width;
                let (to, from) = (&mut flow[at..][..width], &of_views[at..][..width]);
                to.iter_mut().zip(values).for_each(|(to, value)| *to = *value * *share);
                dots.push(values.iter().zip(from).fold(T::zero(), |dot, (value, from)| dot + *value * *from));
            }
            let is_renormalised = shares.iter().zip(weights[object * shares.len()..].iter()).any(|(a, b)| a != b);
            let mean = shares.iter().zip(&dots).fold(T::zero(), |mean, (share, dot)| mean + *share * *dot);
            for (view, dot) in dots.into_iter().enumerate() {
                if !is_renormalised {
                    of_weights[view] += dot;
                } else if self.points.places[(object * shares.len() + view) * self.points.point_count + point]
                    .is_visible
                {
                    of_weights[view] += (dot - mean) / all;
                }
            }
        }
        flow
    }

    /// The points of each object whose gradient, of `[object and point][4]`, is not negligible.
    pub(crate) fn with_gradient<T: Real>(&self, gradient: &[T]) -> Vec<Vec<usize>> {
        let points = &*self.points;
        let magnitude = |row: &[T]| row.iter().map(|value| value.to_f64().abs()).sum::<f64>();
        let all: f64 = gradient.chunks_exact(4).map(magnitude).sum();
        let least = NEGLIGIBLE * all / (points.object_count * points.point_count) as f64;
        // NaN is no less than anything: it stays and shows itself.
        let is_kept = |point: &usize, rows: &[T]| !(magnitude(&rows[4 * point..][..4]) <= least);
        let kept = |rows: &[T]| (0..points.point_count).filter(|point| is_kept(point, rows)).collect();
        gradient.chunks_exact(4 * points.point_count).map(kept).collect()
    }
}

impl Operation<3> for PointNetwork {
    const NAME: &'static str = "point_network";

    fn shape(&self) -> Vec<usize> {
        vec![self.points.object_count * self.points.point_count, 4]
    }

    fn forward<T: Real>(&self, inputs: [&[T]; 3]) -> Vec<T> {
        let all: Vec<usize> = (0..self.points.point_count).collect();
        let chunks: Vec<(usize, &[usize])> = (0..self.points.object_count)
            .flat_map(|object| all.chunks(CHUNK).map(move |chunk| (object, chunk)))
            .collect();
        let raws: Vec<Vec<T>> = chunks.par_iter().map(|(object, chunk)| self.run(inputs, *object, chunk).raw).collect();
        raws.concat()
    }

    fn backward<T: Real>(&self, inputs: [&[T]; 3], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 3] {
        let points = &*self.points;
        let grid_len = points.view_count * self.node_count * self.node_len();
        // One object after another, so that sums are in one order.
        let one = |(object, kept): (usize, &Vec<usize>)| {
            let mut of_grids = vec![T::zero(); if self.is_frozen { 0 } else { grid_len }];
            let mut of_weights = vec![T::zero(); points.view_count];
            let mut of_parameters = vec![T::zero(); if self.is_frozen { 0 } else { inputs[2].len() }];
            for chunk in kept.chunks(CHUNK) {
                let row = |point: &usize| &gradient[4 * (object * points.point_count + point)..][..4];
                let numbers: Vec<T> = chunk.iter().flat_map(row).copied().collect();
                let gradients = [&mut of_grids[..], &mut of_weights[..], &mut of_parameters[..]];
                self.back(inputs, &numbers, object, chunk, gradients);
            }
            (of_grids, of_weights, of_parameters)
        };
        let all: Vec<_> = self.with_gradient(gradient).par_iter().enumerate().map(one).collect();
        of_all(all, !self.is_frozen)
    }
}
