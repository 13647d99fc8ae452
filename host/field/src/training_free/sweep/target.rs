//! A target: what is found of the views that contribute to it, and the costs of its planes.

use super::Sweep;
use super::matching::swept;
use super::views::Views;
use crate::training_free::exposure;
use crate::{FieldError, Request};
use viewfuse_core::camera::Camera;
use viewfuse_device::{Device, Later};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_scene::photographs::reduced_size;

/// What is found of the views of a target from the maps of all of them.
pub(super) struct TargetViews<'d, D: Device> {
    views: Vec<usize>,
    /// `[view][row][column]`: disparity and confidence.
    pub(super) maps: D::Buffer<[f32; 2]>,
    /// The same on their way to the host, until they are there.
    coming: Option<Later<'d, [f32; 2]>>,
    /// The same on the host.
    pub(super) maps_on_host: Vec<[f32; 2]>,
    /// Gain of each view: red, green, blue, 1; from when the maps are on the host.
    gains: Vec<[f32; 4]>,
    /// Of the last picture, for another one of the same target under other settings.
    compared: Option<Compared<D>>,
}

/// What views show on a target's planes: the same for all settings but one.
struct Compared<D: Device> {
    /// With the setting that it is for, the cost of contradicting the maps.
    frustum: FrustumBlock,
    views: Vec<SweptView>,
    /// As of [`Matching::compared`](super::matching::Matching::compared).
    costs: D::Buffer<Planes>,
}

/// The planes of a target.
pub(super) struct Volume<D: Device> {
    pub(super) block: BlendBlock,
    /// The views that are blended, with pictures' cameras.
    pub(super) views: Vec<SweptView>,
    /// `[row][column][group]`.
    pub(super) costs: D::Buffer<Planes>,
}

impl<'a, D: Device> Views<'a, D> {
    /// Which of the targets the settings ask for.
    fn slot(&self) -> usize {
        usize::from(self.settings.second_share > 0.0)
    }

    /// Takes what is known of these views, or begins to find it from these views alone: a picture does not depend on
    /// sources without a weight. Returns whether it was begun before.
    fn begun(&mut self, views: &[usize], progress: &dyn Progress) -> Result<(TargetViews<'a, D>, bool), FieldError> {
        self.exchange(progress)?;
        self.settle(views, progress)?;
        let slot = self.slot();
        if let Some(known) = self.targets[slot].take().filter(|target| target.views == views) {
            return Ok((known, true));
        }
        let device = self.scene.device;
        let maps = self.confirmed(device, views, self.found_on_device())?;
        let coming = Some(device.download_later(&maps)?);
        device.submit()?;
        let (maps_on_host, gains) = (Vec::new(), Vec::new());
        Ok((TargetViews { views: views.to_vec(), maps, coming, maps_on_host, gains, compared: None }, false))
    }

    /// Goes on towards what is found of these views; returns whether it was begun before.
    pub(super) fn advance_target(&mut self, views: &[usize], progress: &dyn Progress) -> Result<bool, FieldError> {
        let (target, is_begun) = self.begun(views, progress)?;
        self.keep(target);
        Ok(is_begun)
    }

    /// What is found of these views.
    pub(super) fn target_views(
        &mut self,
        views: &[usize],
        progress: &dyn Progress,
    ) -> Result<TargetViews<'a, D>, FieldError> {
        let (mut target, _) = self.begun(views, progress)?;
        // There is memory for one picture's volume.
        let other = 1 - self.slot();
        self.targets[other].iter_mut().for_each(|other| other.compared = None);
        if let Some(coming) = target.coming.take() {
            target.maps_on_host = coming.get()?;
            let steps = self.maps.steps.iter().enumerate();
            let used: Vec<f32> = steps.map(|(view, step)| if views.contains(&view) { *step } else { 0.0 }).collect();
            let (cameras, texels) = (&self.matched.images.cameras, &self.matched.texels);
            target.gains = exposure::gains(cameras, texels, &target.maps_on_host, &used);
        }
        Ok(target)
    }

    /// The maps of these views that a target's picture needed, if one did.
    pub(super) fn known(&self, views: &[usize]) -> Option<&[[f32; 2]]> {
        let known = self.targets[self.slot()].as_ref().filter(|target| target.views == views);
        known.filter(|target| target.coming.is_none()).map(|target| &target.maps_on_host[..])
    }

    /// Keeps what is found of a target's views for its next picture.
    pub(super) fn keep(&mut self, target: TargetViews<'a, D>) {
        let slot = self.slot();
        self.targets[slot] = Some(target);
    }

    /// The costs of a target's planes, and what its pixels are blended from.
    pub(super) fn volume(
        &mut self,
        target: &mut TargetViews<'a, D>,
        request: &Request<'_>,
        progress: &dyn Progress,
    ) -> Result<Volume<D>, FieldError> {
        let Sweep { match_side, temperature, .. } = self.settings;
        let (device, has_silhouettes) = (self.scene.device, self.scene.has_silhouettes);
        let (small_width, small_height) = reduced_size(request.camera, match_side);
        let pinhole = request.camera.pinhole.resized(small_width, small_height).map_err(FieldError::unsuitable)?;
        let camera = Camera { pinhole, ..*request.camera }.block(0);
        let weights: Vec<(usize, f32)> = request.views.iter().copied().zip(request.view_weights()).collect();
        let range = self.range(&camera);
        let (map_cameras, texels) = (&self.matched.images.cameras, &self.matched.images.texels);
        let (steps, gains) = (Some(&self.maps.steps[..]), Some(&target.gains[..]));
        let matched = swept(map_cameras, map_cameras, &weights, steps, gains);
        let matching = self.settings.matching(device, has_silhouettes);
        let frustum = matching.frustum(camera, range, &matched);
        let scratch = &mut self.scratch;
        let known = target.compared.take().filter(|known| known.frustum == frustum && known.views == matched);
        let compared = match known {
            Some(known) => known,
            None => {
                let costs = matching.compared(&frustum, &matched, texels, &target.maps, scratch, progress)?;
                Compared { frustum, views: matched, costs }
            }
        };
        let means = matching.means(&frustum, &compared.costs, scratch)?;
        let costs = matching.costs(frustum, &means, &compared.views, &target.maps, scratch)?;
        let views = swept(&self.scene.pictures.cameras, map_cameras, &weights, steps, gains);
        let block = BlendBlock {
            target: request.camera.block(0),
            far_disparity: range.far_disparity,
            disparity_step: range.step,
            volume_width: camera.width,
            volume_height: camera.height,
            group_count: range.group_count,
            view_count: views.len() as u32,
            sharpness: 1.0 / temperature,
            has_silhouettes: u32::from(has_silhouettes),
        };
        target.compared = Some(compared);
        Ok(Volume { block, views, costs })
    }
}
