//! A target's planes on the host: what its pixels are blended from, to measure what better depths, visibility or blending
//! would gain.

use super::{Sweep, Volume};
use crate::{FieldError, Prepared, Request, Weighted};
use viewfuse_core::camera::Camera;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::frustum::SweptView;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// The arguments of [`viewfuse_kernels::plane_sweep::blend::blend`] for a target.
#[derive(Clone, Debug)]
pub struct TargetPlanes {
    /// The target and its planes.
    pub block: BlendBlock,
    /// The views that are blended, the greatest weights first.
    pub views: Vec<SweptView>,
    /// The index of each of them in the sources.
    pub sources: Vec<usize>,
    /// Of all sources, at the size of the pictures: premultiplied red, green, blue, and alpha. `[source][row][column]`.
    pub texels: Vec<[f32; 4]>,
    /// Of all sources, at the size of the comparison: disparity in inverse world units, and confidence.
    pub disparities: Vec<[f32; 2]>,
    /// Costs of the planes, at the size of the comparison: `[row][column][group]`.
    pub costs: Vec<Planes>,
}

impl Sweep {
    /// The planes of targets, each a camera of the picture's size with its weights of the sources. `relevance[source]` are the
    /// weights of all sources for this source as a target. Targets share the encoding of the sources.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn target_planes<D: Device>(
        &self,
        device: &D,
        sources: &SourceImages,
        relevance: &[SourceWeights],
        targets: &[(Camera, SourceWeights)],
        progress: &dyn Progress,
    ) -> Result<Vec<TargetPlanes>, FieldError> {
        let count = sources.images.len();
        let used = |weights: &SourceWeights| -> Vec<usize> {
            (0..count).filter(|view| weights.get(*view as u32) > 0.0).collect()
        };
        let mut views = self.views(device, sources, progress)?;
        views.weigh(relevance)?;
        for view in (0..count).filter(|view| targets.iter().any(|(_, weights)| weights.get(*view as u32) > 0.0)) {
            views.encode(view, progress)?;
        }
        let (texels, disparities) = (device.download(&views.pictures.texels)?, device.download(&views.disparities)?);
        let first_texels: Vec<u32> = views.pictures.cameras.iter().map(|camera| camera.first_texel).collect();
        let of_target = |(camera, weights): &(Camera, SourceWeights)| {
            let request = Request { camera, weights, views: &used(weights), early_termination: 0.0 };
            let Volume { block, views: blended, costs } = views.volume(&request, progress)?;
            let source = |view: &SweptView| first_texels.iter().position(|first| *first == view.camera.first_texel);
            Ok(TargetPlanes {
                block,
                sources: blended.iter().filter_map(source).collect(),
                views: blended,
                texels: texels.clone(),
                disparities: disparities.clone(),
                costs: device.download(&costs)?,
            })
        };
        targets.iter().map(of_target).collect()
    }
}
