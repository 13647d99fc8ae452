//! The batch of a step: a few objects, with some views of each as sources and some as targets.

use super::super::draw::{Draw, Purpose};
use super::super::scenes::TrainingScene;
use candle_core::{DType, Device, Result, Tensor};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_field::learned::default_near_far;

/// The numbers of views of each object in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ViewCounts {
    pub(crate) sources: usize,
    pub(crate) targets: usize,
}

/// Sources and targets of some objects.
pub(crate) struct Views {
    /// Of the sources, `[object][view]`.
    pub(crate) sources: Vec<Vec<Camera>>,
    /// The same as kernels take them.
    pub(crate) cameras: Vec<Vec<CameraBlock>>,
    /// Pictures of the sources `[object and view][row][column][3]`, in `[-1, 1]`.
    pub(crate) pictures: Tensor,
    /// Of the targets, `[object][target]`.
    pub(crate) target_cameras: Vec<Vec<Camera>>,
    /// The same as kernels take them.
    pub(crate) targets: Vec<Vec<CameraBlock>>,
    /// `[object and target][row][column][3]`, in `[-1, 1]`.
    pub(crate) truth: Tensor,
    /// Near and far bounds of rays, `[object]`: from the sources, as in the field.
    pub(crate) near_far: Vec<[f32; 2]>,
}

impl Views {
    /// Draws objects at random, and views of each.
    pub(crate) fn draw(
        scenes: &[TrainingScene],
        draw: &Draw,
        object_count: usize,
        counts: ViewCounts,
        dtype: DType,
    ) -> Result<Views> {
        let objects: Vec<&TrainingScene> =
            (0..object_count).map(|index| &scenes[draw.below(Purpose::Objects, index, scenes.len())]).collect();
        Views::of(&objects, draw, counts, dtype)
    }

    /// As [`Views::draw`], of these objects.
    pub(crate) fn of(objects: &[&TrainingScene], draw: &Draw, counts: ViewCounts, dtype: DType) -> Result<Views> {
        let ViewCounts { sources, targets } = counts;
        let (mut pictures, mut truth) = (Vec::new(), Vec::new());
        let mut lists = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (index, scene) in objects.iter().enumerate() {
            let order = draw.choose(Purpose::Sources, index, scene.cameras.len(), sources + targets);
            let (own, others) = order.split_at(sources);
            own.iter().for_each(|view| pictures.extend(scene.shown(*view)));
            others.iter().for_each(|view| truth.extend(scene.shown(*view)));
            let cameras: Vec<Camera> = own.iter().map(|&view| scene.cameras[view]).collect();
            lists.0.push(default_near_far(&cameras));
            lists.1.push(cameras);
            lists.2.push(own.iter().map(|&view| scene.blocks[view]).collect());
            lists.3.push(others.iter().map(|&view| scene.blocks[view]).collect());
            lists.4.push(others.iter().map(|&view| scene.cameras[view]).collect());
        }
        let side = objects[0].pictures[0].width() as usize;
        let images = |values: Vec<f32>, count| {
            Tensor::from_vec(values, (objects.len() * count, side, side, 3), &Device::Cpu)?.to_dtype(dtype)
        };
        let (near_far, sources_of, cameras, targets_of, target_cameras) = lists;
        Ok(Views {
            sources: sources_of,
            cameras,
            pictures: images(pictures, sources)?,
            target_cameras,
            targets: targets_of,
            truth: images(truth, targets)?,
            near_far,
        })
    }

    /// Equal weights `[object][view]`.
    pub(crate) fn mean_weights(&self) -> Result<Tensor> {
        let (objects, views) = (self.cameras.len(), self.cameras[0].len());
        Tensor::full(1.0 / views as f64, (objects, views), &Device::Cpu)?.to_dtype(self.truth.dtype())
    }
}
