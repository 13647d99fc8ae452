//! The batch of a step: a few objects, with some views of each as sources and rays of others as targets.

use super::draw::{Draw, Purpose};
use super::scenes::TrainingScene;
use candle_core::{DType, Device, Result, Tensor};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::rays::{CastBlock, TargetRay, cast_ray};

/// Share of the rays that are drawn from the rectangle around the object.
const SHARE_WITHIN_BOUNDS: f32 = 0.7;

/// The sizes of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BatchSize {
    pub(crate) objects: usize,
    /// Rays of each object.
    pub(crate) rays: usize,
}

/// Sources and target rays of some objects.
pub(crate) struct Batch {
    /// Sources of each object, `[object][view]`.
    pub(crate) sources: Vec<Vec<Camera>>,
    /// The same as kernels take them.
    pub(crate) cameras: Vec<Vec<CameraBlock>>,
    /// Pictures of the sources `[object and view][row][column][3]`, in `[-1, 1]`.
    pub(crate) pictures: Tensor,
    /// Target view of each object; the first one for rays of many targets.
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

impl Batch {
    /// Draws objects at random, of each `view_count` sources and the rays.
    pub(crate) fn draw(
        scenes: &[TrainingScene],
        draw: &Draw,
        size: BatchSize,
        view_count: usize,
        targets: Targets,
        dtype: DType,
    ) -> Result<Batch> {
        let objects: Vec<usize> =
            (0..size.objects).map(|index| draw.below(Purpose::Objects, index, scenes.len())).collect();
        Batch::of(scenes, &objects, draw, size.rays, view_count, targets, dtype)
    }

    /// As [`Batch::draw`], of these objects.
    pub(crate) fn of(
        scenes: &[TrainingScene],
        objects: &[usize],
        draw: &Draw,
        ray_count: usize,
        view_count: usize,
        targets: Targets,
        dtype: DType,
    ) -> Result<Batch> {
        let (mut pictures, mut truth) = (Vec::new(), Vec::new());
        let mut batch = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut side = 0;
        for (index, &object) in objects.iter().enumerate() {
            let scene = &scenes[object];
            side = scene.pictures[0].width();
            let order = draw.choose(Purpose::Sources, index, scene.cameras.len(), scene.cameras.len());
            let (sources, others) = order.split_at(view_count.min(order.len() - 1));
            for &view in sources {
                pictures.extend(scene.shown(view));
            }
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
            batch.0.push(sources.iter().map(|&view| scene.cameras[view]).collect::<Vec<_>>());
            batch.1.push(sources.iter().map(|&view| scene.blocks[view]).collect::<Vec<_>>());
            batch.2.push(scene.cameras[others[0]]);
            batch.3.push(rays);
        }
        let (sources, cameras, targets, rays) = batch;
        let side = side as usize;
        let pictures = Tensor::from_vec(pictures, (objects.len() * sources[0].len(), side, side, 3), &Device::Cpu)?;
        let truth = Tensor::from_vec(truth, (objects.len() * ray_count, 3), &Device::Cpu)?;
        let (pictures, truth) = (pictures.to_dtype(dtype)?, truth.to_dtype(dtype)?);
        Ok(Batch { sources, cameras, pictures, targets, rays, truth })
    }

    /// Equal weights `[object][view]`.
    pub(crate) fn mean_weights(&self) -> Result<Tensor> {
        let (objects, views) = (self.sources.len(), self.sources[0].len());
        Tensor::full(1.0 / views as f64, (objects, views), &Device::Cpu)?.to_dtype(self.truth.dtype())
    }
}

/// The ray through a pixel's centre.
fn ray_through(scene: &TrainingScene, view: usize, column: u32, row: u32) -> TargetRay {
    let [near, far] = scene.near_far;
    let camera = scene.blocks[view];
    cast_ray(&CastBlock { camera, near, far, pixel_centre: 0.5, along_axis: 0 }, row * camera.width + column)
}
