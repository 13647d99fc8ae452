//! The batch of a step: a few objects, with some views of each as sources and rays of others as targets.

#[cfg(test)]
mod tests;

use super::draw::{Draw, Purpose};
use super::scenes::{Cut, TrainingScene, inputs};
use super::weights;
use candle_core::{DType, Device, Error, Result, Tensor};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::rays::{CastBlock, TargetRay, cast_ray};
use viewfuse_core::weighting::Scheme;

/// Share of the rays that are drawn from the rectangle around the object.
const SHARE_WITHIN_BOUNDS: f32 = 0.7;

/// The sizes of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BatchSize {
    pub(crate) objects: usize,
    /// Rays of each object.
    pub(crate) rays: usize,
}

/// The sources of each object in a batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SourceDraw {
    /// How many.
    pub(crate) count: usize,
    /// Side of their pictures; `None`: that of the scenes'.
    pub(crate) side: Option<u32>,
    /// Least share of a photograph's side that a source shows; 1 for whole photographs.
    pub(crate) least_crop: f32,
}

impl SourceDraw {
    /// Whole photographs at their size.
    pub(crate) fn whole(count: usize) -> SourceDraw {
        SourceDraw { count, side: None, least_crop: 1.0 }
    }

    /// What source number `index` of a batch shows of a photograph of this side: a square somewhere in it.
    pub(crate) fn cut(self, draw: &Draw, index: usize, whole: u32) -> Cut {
        let share = 1.0 - (1.0 - self.least_crop) * draw.uniform(Purpose::Crops, 3 * index);
        let size = ((share * whole as f32).round() as u32).clamp(1, whole);
        let place = |which| draw.below(Purpose::Crops, 3 * index + which, (whole - size + 1) as usize) as u32;
        Cut { left: place(1), top: place(2), size, side: self.side.unwrap_or(whole) }
    }

    /// The cameras of some views of an object, the batch's number `index`, as its sources; adds their pictures.
    pub(crate) fn sources(
        self,
        scene: &TrainingScene,
        draw: &Draw,
        index: usize,
        views: &[usize],
        pictures: &mut Vec<f32>,
    ) -> Result<Vec<Camera>> {
        let source = |(place, &view): (usize, &usize)| {
            let cut = self.cut(draw, index * views.len() + place, scene.pictures[view].width());
            let (camera, picture) = scene.source(view, cut).map_err(Error::wrap)?;
            pictures.extend(inputs(&picture));
            Ok(camera)
        };
        views.iter().enumerate().map(source).collect()
    }
}

/// Sources and target rays of some objects.
pub(crate) struct Batch {
    /// Sources of each object, `[object][view]`, in the unit of weightings.
    pub(crate) sources: Vec<Vec<Camera>>,
    /// The same in world units, as kernels take them.
    pub(crate) cameras: Vec<Vec<CameraBlock>>,
    /// Pictures of the sources `[object and view][row][column][3]`, in `[-1, 1]`.
    pub(crate) pictures: Tensor,
    /// Target view of each object, in the unit of weightings; the first one for rays of many targets.
    pub(crate) targets: Vec<Camera>,
    /// `[object][ray]`.
    pub(crate) rays: Vec<Vec<TargetRay>>,
    /// Colours there `[object and ray][3]`, in `[0, 1]`.
    pub(crate) truth: Tensor,
}

/// The target views of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Targets {
    /// Any views but the sources, another one for each ray.
    Many,
    /// One view of an object for all rays, not a source.
    One,
}

impl Targets {
    /// As a scheme allows: weights other than equal ones are for one target view.
    pub(crate) fn of(scheme: Scheme) -> Targets {
        if scheme == Scheme::MEAN { Targets::Many } else { Targets::One }
    }
}

impl Batch {
    /// Draws objects at random, of each the sources and the rays.
    pub(crate) fn draw(
        scenes: &[TrainingScene],
        draw: &Draw,
        size: BatchSize,
        drawn: SourceDraw,
        targets: Targets,
        dtype: DType,
    ) -> Result<Batch> {
        let objects: Vec<usize> =
            (0..size.objects).map(|index| draw.below(Purpose::Objects, index, scenes.len())).collect();
        Batch::of(scenes, &objects, draw, size.rays, drawn, targets, dtype)
    }

    /// As [`Batch::draw`], of these objects.
    pub(crate) fn of(
        scenes: &[TrainingScene],
        objects: &[usize],
        draw: &Draw,
        ray_count: usize,
        drawn: SourceDraw,
        targets: Targets,
        dtype: DType,
    ) -> Result<Batch> {
        let (mut pictures, mut truth) = (Vec::new(), Vec::new());
        let mut batch = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut source_side = 0;
        for (index, &object) in objects.iter().enumerate() {
            let scene = &scenes[object];
            let side = scene.pictures[0].width();
            let order = draw.choose(Purpose::Sources, index, scene.cameras.len(), scene.cameras.len());
            let (views, others) = order.split_at(drawn.count.min(order.len() - 1));
            let sources = drawn.sources(scene, draw, index, views, &mut pictures)?;
            source_side = sources[0].pinhole.width() as usize;
            let mut rays = Vec::with_capacity(ray_count);
            for ray in 0..ray_count {
                let number = |which: usize| (index * ray_count + ray) * 4 + which;
                let view = match targets {
                    Targets::One => others[0],
                    Targets::Many => others[draw.below(Purpose::Rays, number(0), others.len())],
                };
                let within = draw.uniform(Purpose::Rays, number(1)) < SHARE_WITHIN_BOUNDS;
                let [left, top, right, bottom] = if within { scene.bounds[view] } else { [0, 0, side - 1, side - 1] };
                let pick = |first: u32, last: u32, which| {
                    first + draw.below(Purpose::Rays, number(which), (last - first + 1) as usize) as u32
                };
                let (column, row) = (pick(left, right, 2), pick(top, bottom, 3));
                rays.push(ray_through(scene, view, column, row));
                truth.extend(scene.colour(view, column, row));
            }
            batch.1.push(sources.iter().map(|camera| camera.block(0)).collect::<Vec<_>>());
            batch.0.push(sources.iter().map(|camera| scene.unit.camera(camera)).collect::<Vec<_>>());
            batch.2.push(scene.unit.camera(&scene.cameras[others[0]]));
            batch.3.push(rays);
        }
        let (sources, cameras, targets, rays) = batch;
        let shape = (objects.len() * sources[0].len(), source_side, source_side, 3);
        let pictures = Tensor::from_vec(pictures, shape, &Device::Cpu)?;
        let truth = Tensor::from_vec(truth, (objects.len() * ray_count, 3), &Device::Cpu)?;
        let (pictures, truth) = (pictures.to_dtype(dtype)?, truth.to_dtype(dtype)?);
        Ok(Batch { sources, cameras, pictures, targets, rays, truth })
    }

    /// Weights `[object][view]` by a scheme, for the target view of each object.
    pub(crate) fn weights(&self, scheme: Scheme) -> Result<Tensor> {
        weights::of_scheme(scheme, &self.sources, self.targets.iter(), self.truth.dtype())
    }
}

/// The ray through a pixel's centre.
fn ray_through(scene: &TrainingScene, view: usize, column: u32, row: u32) -> TargetRay {
    let [near, far] = scene.near_far;
    let camera = scene.blocks[view];
    cast_ray(&CastBlock { camera, near, far, pixel_centre: 0.5, along_axis: 0 }, row * camera.width + column)
}
