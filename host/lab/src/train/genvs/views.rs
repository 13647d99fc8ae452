//! The batch of a step: a few objects, with some views of each as sources and some as targets.

#[cfg(test)]
mod tests;

use super::super::batch::SourceDraw;
use super::super::draw::{Draw, Purpose};
use super::super::scenes::{TrainingScene, inputs};
use super::super::weights;
use candle_core::{DType, Device, Result, Tensor};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::weighting::Scheme;
use viewfuse_field::learned::default_near_far;

/// The numbers of views of each object in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ViewCounts {
    /// Their pictures have the scenes' side.
    pub(crate) sources: SourceDraw,
    pub(crate) targets: usize,
}

/// Sources and targets of some objects.
pub(crate) struct ObjectViews {
    /// Of the sources, `[object][view]`, in the unit of weightings.
    pub(crate) sources: Vec<Vec<Camera>>,
    /// The same in world units, as kernels take them.
    pub(crate) cameras: Vec<Vec<CameraBlock>>,
    /// Pictures of the sources `[object and view][row][column][3]`, in `[-1, 1]`.
    pub(crate) pictures: Tensor,
    /// Of the targets, `[object][target]`, in the unit of weightings.
    pub(crate) target_cameras: Vec<Vec<Camera>>,
    /// The same in world units, as kernels take them.
    pub(crate) targets: Vec<Vec<CameraBlock>>,
    /// `[object and target][row][column][3]`, in `[-1, 1]`.
    pub(crate) truth: Tensor,
    /// Near and far bounds of rays, `[object]`: from the sources, as in the field.
    pub(crate) near_far: Vec<[f32; 2]>,
}

impl ObjectViews {
    /// Draws objects at random, and views of each.
    pub(crate) fn draw(
        scenes: &[TrainingScene],
        draw: &Draw,
        object_count: usize,
        counts: ViewCounts,
        dtype: DType,
    ) -> Result<ObjectViews> {
        let objects: Vec<&TrainingScene> =
            (0..object_count).map(|index| &scenes[draw.below(Purpose::Objects, index, scenes.len())]).collect();
        ObjectViews::of(&objects, draw, counts, dtype)
    }

    /// As [`ObjectViews::draw`], of these objects.
    pub(crate) fn of(objects: &[&TrainingScene], draw: &Draw, counts: ViewCounts, dtype: DType) -> Result<ObjectViews> {
        let ViewCounts { sources, targets } = counts;
        let (mut pictures, mut truth) = (Vec::new(), Vec::new());
        let mut lists = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (index, scene) in objects.iter().enumerate() {
            let order = draw.choose(Purpose::Sources, index, scene.cameras.len(), sources.count + targets);
            let (chosen, others) = order.split_at(sources.count);
            let cameras = sources.sources(scene, draw, index, chosen, &mut pictures)?;
            others.iter().for_each(|view| truth.extend(inputs(&scene.pictures[*view])));
            lists.0.push(default_near_far(&cameras));
            lists.2.push(cameras.iter().map(|camera| camera.block(0)).collect());
            lists.1.push(cameras.iter().map(|camera| scene.unit.camera(camera)).collect());
            lists.3.push(others.iter().map(|&view| scene.blocks[view]).collect());
            lists.4.push(others.iter().map(|&view| scene.unit.camera(&scene.cameras[view])).collect());
        }
        let side = objects[0].pictures[0].width() as usize;
        let images = |values: Vec<f32>, count| {
            Tensor::from_vec(values, (objects.len() * count, side, side, 3), &Device::Cpu)?.to_dtype(dtype)
        };
        let (near_far, sources_of, cameras, targets_of, target_cameras) = lists;
        Ok(ObjectViews {
            sources: sources_of,
            cameras,
            pictures: images(pictures, sources.count)?,
            target_cameras,
            targets: targets_of,
            truth: images(truth, targets)?,
            near_far,
        })
    }

    /// Weights `[object][view]` by a scheme, for the first target of each object.
    pub(crate) fn weights(&self, scheme: Scheme) -> Result<Tensor> {
        let targets = self.target_cameras.iter().map(|targets| &targets[0]);
        weights::of_scheme(scheme, &self.sources, targets, self.truth.dtype())
    }
}
