//! GeNVS's features of rays from volumes, as one operation: look-ups in the views' volumes at points, fusion of the
//! views, the point network, compositing.
//!
//! Chunks of rays go through all steps, so that intermediate values stay in a core's caches; the backward pass computes
//! them again.

use super::convolve::of_all;
use super::linear::{input_gradient, layer_gradient, linear, linear_back, rectified};
use super::{Operation, Real};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::depths::{CoarseBlock, coarse_depth};
use viewfuse_core::rays::{RayPoint, TargetRay, place_point};
use viewfuse_kernels::genvs::{VolumeBlock, VolumePlace};

/// Rays of a chunk.
const CHUNK: usize = 4;
/// Nodes around a point.
const CORNERS: u32 = 8;

/// Sizes of volumes and of the network at points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MarchSizes {
    /// Rows, columns, depths of a volume.
    pub(crate) volume: [usize; 3],
    /// Features of a node.
    pub(crate) features: usize,
    /// Width of both hidden layers.
    pub(crate) width: usize,
}

impl MarchSizes {
    /// How many parameters there are, in this order: three layers, of each the weights `[output][input]`, then the
    /// biases.
    pub(crate) fn parameter_count(&self) -> usize {
        self.layer(2).end
    }

    fn layer(&self, layer: usize) -> Range<usize> {
        let (f, w) = (self.features, self.width);
        let ends = [0, w * f + w, w * f + w + w * w + w, w * f + w + w * w + w + (1 + f) * w + 1 + f];
        ends[layer]..ends[layer + 1]
    }

    fn volume_len(&self) -> usize {
        self.volume.iter().product::<usize>() * self.features
    }
}

/// The views and the sampling of one object's rays.
#[derive(Clone, Debug)]
pub(crate) struct SampledRays {
    /// Cameras of the views.
    pub(crate) cameras: Vec<CameraBlock>,
    pub(crate) rays: Vec<TargetRay>,
    /// Near and far bounds of the volumes, along the views' axes.
    pub(crate) near_far: [f32; 2],
    /// Factor from world units to the unit of length of the network's densities.
    pub(crate) length_scale: f32,
}

/// Inputs: volumes `[object and view][row][column][depth][feature]`, weights of the views `[object][view]`, parameters
/// (see [`MarchSizes::parameter_count`]). Result `[object and ray][feature]`.
#[derive(Clone)]
pub(crate) struct MarchVolumes {
    pub(crate) sizes: MarchSizes,
    /// `[object]`; all have as many views and rays.
    pub(crate) objects_rays: Arc<Vec<SampledRays>>,
    /// Depths of the samples on a ray.
    pub(crate) samples: CoarseBlock,
    /// Length of a ray's last sample.
    pub(crate) last_length: f32,
    /// Whether weights are inclusive: samples shade themselves.
    pub(crate) inclusive: bool,
    /// Whether the gradients of volumes and parameters are needed, or only that of the weights.
    pub(crate) is_frozen: bool,
}

/// Values of a chunk's forward pass for its backward pass.
struct Way<T> {
    /// Nodes around points and their shares, `[view][point][corner]`.
    places: Vec<(u32, f32)>,
    /// `[view][point][feature]`.
    looked_up: Vec<T>,
    fused: Vec<T>,
    /// Before rectification.
    hidden: [Vec<T>; 2],
    raw: Vec<T>,
    lengths: Vec<T>,
    /// Optical depth of each sample, and the transmittance in front of it.
    optical_depths: Vec<T>,
    reaching: Vec<T>,
}

impl MarchVolumes {
    fn views(&self) -> usize {
        self.objects_rays[0].cameras.len()
    }

    fn rays(&self) -> usize {
        self.objects_rays[0].rays.len()
    }

    fn samples(&self) -> usize {
        self.samples.sample_count as usize
    }

    fn points(&self, object_rays: &SampledRays, chunk: &Range<usize>) -> Vec<RayPoint> {
        let rays = &object_rays.rays[chunk.clone()];
        let count = self.samples.sample_count;
        let depths: Vec<f32> = (0..rays.len() * count as usize)
            .map(|index| {
                let (ray, sample) = (index / count as usize, index as u32 % count);
                coarse_depth(&rays[ray], (chunk.start + ray) as u32, sample, &self.samples)
            })
            .collect();
        (0..depths.len() as u32).map(|sample| place_point(rays, &depths[..], count, sample)).collect()
    }

    fn run<T: Real>(&self, [volumes, weights, parameters]: [&[T]; 3], object: usize, chunk: &Range<usize>) -> Way<T> {
        let MarchSizes { volume: [height, width, depth_count], features, width: inner } = self.sizes;
        let object_rays = &self.objects_rays[object];
        let points = self.points(object_rays, chunk);
        let [near, far] = object_rays.near_far;
        let block = VolumeBlock {
            height: height as u32,
            width: width as u32,
            depth_count: depth_count as u32,
            near,
            far,
            ..VolumeBlock::default()
        };
        let row_count = self.views() * points.len();
        let mut places = Vec::with_capacity(row_count * CORNERS as usize);
        let mut looked_up = vec![T::zero(); row_count * features];
        let mut fused = vec![T::zero(); points.len() * features];
        for (view, camera) in object_rays.cameras.iter().enumerate() {
            let volume = &volumes[(object * self.views() + view) * self.sizes.volume_len()..];
            let weight = weights[object * self.views() + view];
            let rows_here = &mut looked_up[view * points.len() * features..][..points.len() * features];
            let rows = rows_here.chunks_exact_mut(features).zip(fused.chunks_exact_mut(features));
            for (point, (values, fused)) in points.iter().zip(rows) {
                let place = VolumePlace::of(camera, point, &block);
                for corner in 0..CORNERS {
                    let (node, share) = match place.is_outside() {
                        true => (u32::MAX, 0.0),
                        false => place.corner(&block, corner),
                    };
                    places.push((node, share));
                    if node != u32::MAX {
                        let from = &volume[node as usize * features..][..features];
                        let share = T::of(share);
                        values.iter_mut().zip(from).for_each(|(value, from)| *value += *from * share);
                    }
                }
                fused.iter_mut().zip(values).for_each(|(fused, value)| *fused += *value * weight);
            }
        }
        let layer = |index| &parameters[self.sizes.layer(index)];
        let first = linear(&fused, layer(0), features, inner);
        let second = linear(&rectified(&first), layer(1), inner, inner);
        let raw = linear(&rectified(&second), layer(2), inner, 1 + features);
        let mut way = Way {
            places,
            looked_up,
            fused,
            hidden: [first, second],
            raw,
            lengths: Vec::with_capacity(points.len()),
            optical_depths: Vec::with_capacity(points.len()),
            reaching: Vec::with_capacity(points.len()),
        };
        let mut passed = T::zero();
        for (index, point) in points.iter().enumerate() {
            let sample = index % self.samples();
            if sample == 0 {
                passed = T::zero();
            }
            let is_last = sample + 1 == self.samples();
            let length = if is_last { self.last_length } else { point.length * object_rays.length_scale };
            let given = way.raw[index * (1 + features)];
            // NaN stays: the loss must show it.
            let density = if given < T::zero() { T::zero() } else { given };
            way.lengths.push(T::of(length));
            way.optical_depths.push(density * T::of(length));
            way.reaching.push((T::zero() - passed).exponential());
            passed += density * T::of(length);
        }
        way
    }

    /// A sample's compositing weight, and its derivative by the sample's own optical depth.
    fn share<T: Real>(&self, depth: T, reaching: T) -> (T, T) {
        let passes = (T::zero() - depth).exponential();
        match self.inclusive {
            true => (reaching * (passes - passes * passes), reaching * (passes * passes + passes * passes - passes)),
            false => (reaching * (T::one() - passes), reaching * passes),
        }
    }

    /// Computes the features of a chunk's rays.
    fn composite<T: Real>(&self, way: &Way<T>, seen: &mut [T]) {
        let features = self.sizes.features;
        for (index, fused) in way.fused.chunks_exact(features).enumerate() {
            let (share, _) = self.share(way.optical_depths[index], way.reaching[index]);
            let raw = &way.raw[index * (1 + features) + 1..][..features];
            let sums = &mut seen[index / self.samples() * features..][..features];
            sums.iter_mut().zip(fused.iter().zip(raw)).for_each(|(sum, (fused, raw))| *sum += share * (*fused + *raw));
        }
    }

    /// Adds a chunk's gradients; those of volumes and weights are the object's own.
    fn back<T: Real>(
        &self,
        inputs: [&[T]; 3],
        gradient: &[T],
        object: usize,
        chunk: &Range<usize>,
        [of_volumes, of_weights, of_parameters]: [&mut [T]; 3],
    ) {
        let MarchSizes { features, width: inner, .. } = self.sizes;
        let way = self.run(inputs, object, chunk);
        let [_, weights, parameters] = inputs;
        let (samples, point_count) = (self.samples(), way.optical_depths.len());
        let mut of_raw = vec![T::zero(); way.raw.len()];
        let mut of_fused = vec![T::zero(); way.fused.len()];
        for ray in 0..chunk.len() {
            let gradient = &gradient[ray * features..][..features];
            // The loss of the samples behind by more optical depth here.
            let mut behind = T::zero();
            for index in (ray * samples..(ray + 1) * samples).rev() {
                let (share, slope) = self.share(way.optical_depths[index], way.reaching[index]);
                let fused = &way.fused[index * features..][..features];
                let of_raw = &mut of_raw[index * (1 + features)..][..1 + features];
                let of_fused = &mut of_fused[index * features..][..features];
                let mut dot = T::zero();
                for feature in 0..features {
                    let value = fused[feature] + way.raw[index * (1 + features) + 1 + feature];
                    dot += gradient[feature] * value;
                    of_raw[1 + feature] = share * gradient[feature];
                    of_fused[feature] = share * gradient[feature];
                }
                if way.raw[index * (1 + features)] > T::zero() {
                    of_raw[0] = (dot * slope - behind) * way.lengths[index];
                }
                behind += dot * share;
            }
        }
        let layer = |index| &parameters[self.sizes.layer(index)];
        let trains = !self.is_frozen;
        let mut of_second = vec![T::zero(); way.hidden[1].len()];
        let of_layer = trains.then(|| &mut of_parameters[self.sizes.layer(2)]);
        linear_back(&way.hidden[1], layer(2), &of_raw, inner, 1 + features, &mut of_second, of_layer);
        let mut of_first = vec![T::zero(); way.hidden[0].len()];
        let of_layer = trains.then(|| &mut of_parameters[self.sizes.layer(1)]);
        linear_back(&way.hidden[0], layer(1), &of_second, inner, inner, &mut of_first, of_layer);
        input_gradient(layer(0), &of_first, features, inner, &mut of_fused);
        if trains {
            layer_gradient(&way.fused, &of_first, features, inner, &mut of_parameters[self.sizes.layer(0)]);
        }
        for view in 0..self.views() {
            let weight = weights[object * self.views() + view];
            for (point, of_fused) in of_fused.chunks_exact(features).enumerate() {
                let row = view * point_count + point;
                let looked_up = &way.looked_up[row * features..][..features];
                of_weights[view] += of_fused.iter().zip(looked_up).fold(T::zero(), |dot, (a, b)| dot + *a * *b);
                if !trains {
                    continue;
                }
                let volume = &mut of_volumes[view * self.sizes.volume_len()..][..self.sizes.volume_len()];
                for (node, share) in &way.places[row * CORNERS as usize..][..CORNERS as usize] {
                    if *node != u32::MAX {
                        let share = T::of(*share) * weight;
                        let to = &mut volume[*node as usize * features..][..features];
                        to.iter_mut().zip(of_fused).for_each(|(to, of_fused)| *to += *of_fused * share);
                    }
                }
            }
        }
    }

    fn chunks(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let count = self.rays();
        (0..count).step_by(CHUNK).map(move |start| start..(start + CHUNK).min(count))
    }
}

impl Operation<3> for MarchVolumes {
    const NAME: &'static str = "look";

    fn shape(&self) -> Vec<usize> {
        vec![self.objects_rays.len() * self.rays(), self.sizes.features]
    }

    fn forward<T: Real>(&self, inputs: [&[T]; 3]) -> Vec<T> {
        let chunks: Vec<(usize, Range<usize>)> =
            (0..self.objects_rays.len()).flat_map(|object| self.chunks().map(move |chunk| (object, chunk))).collect();
        let one = |(object, chunk): &(usize, Range<usize>)| {
            let mut seen = vec![T::zero(); chunk.len() * self.sizes.features];
            self.composite(&self.run(inputs, *object, chunk), &mut seen);
            seen
        };
        let seen: Vec<Vec<T>> = chunks.par_iter().map(one).collect();
        seen.concat()
    }

    fn backward<T: Real>(&self, inputs: [&[T]; 3], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 3] {
        let object_len = self.rays() * self.sizes.features;
        let kept = |len: usize| vec![T::zero(); if self.is_frozen { 0 } else { len }];
        // One object after another, so that sums are in one order.
        let one = |object: usize| {
            let mut of_volumes = kept(self.views() * self.sizes.volume_len());
            let mut of_weights = vec![T::zero(); self.views()];
            let mut of_parameters = kept(self.sizes.parameter_count());
            let gradient = &gradient[object * object_len..][..object_len];
            for chunk in self.chunks() {
                let values = &gradient[chunk.start * self.sizes.features..chunk.end * self.sizes.features];
                let gradients = [&mut of_volumes[..], &mut of_weights[..], &mut of_parameters[..]];
                self.back(inputs, values, object, &chunk, gradients);
            }
            (of_volumes, of_weights, of_parameters)
        };
        let all: Vec<_> = (0..self.objects_rays.len()).into_par_iter().map(one).collect();
        of_all(all, !self.is_frozen)
    }
}
