//! Gaussians of the sources: optimised from the depths that the hull or the sweep found of them, and their pictures.

use super::hull::Hull;
use super::sweep::{Cache, Sweep};
use crate::gaussians::{Optimisation, Optimised, Recipe, Residuals, Room, Splatter, optimisation};
use crate::point_cloud::cloud_of;
use crate::{AnyOptions, DepthMap, FieldError, Geometry, Prepared, Rendered, Request, Surfaces};
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// Opacity below which a pixel has no depth.
const MIN_OPACITY: f32 = 0.5;

/// The sources as the hull or the sweep prepared them: Gaussians begin with their depths.
pub(super) struct SourceDepths<'a, D: Device> {
    pub(super) device: &'a D,
    pub(super) views: Box<dyn Prepared<'a> + 'a>,
    pub(super) images: Arc<SourceImages>,
    encoded: Vec<bool>,
    relevance: Vec<SourceWeights>,
}

impl<'a, D: Device> SourceDepths<'a, D> {
    /// By the hull where the sources show silhouettes, elsewhere by the sweep, with what was found of the sources
    /// before.
    pub(super) fn prepare(
        device: &'a D,
        (hull, sweep): (&'a Hull, &'a Sweep),
        cache: Option<&Cache>,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<SourceDepths<'a, D>, FieldError> {
        let views: Box<dyn Prepared<'a> + 'a> = match sources.has_silhouettes {
            true => Box::new(hull.views(device, sources, progress)?),
            false => sweep.prepare_kept(device, sources, cache, progress)?,
        };
        let encoded = vec![false; sources.images.len()];
        Ok(SourceDepths { device, views, images: Arc::new(sources.clone()), encoded, relevance: Vec::new() })
    }

    /// Encodes a view, if it is not encoded yet: Gaussians need all of them, and the first picture may need them
    /// before.
    pub(super) fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if !self.encoded[view] {
            self.views.encode(view, progress)?;
            self.encoded[view] = true;
        }
        Ok(())
    }

    /// Begins a weighting.
    pub(super) fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.encoded.fill(false);
        self.relevance = relevance.to_vec();
        self.views.weigh(relevance)
    }

    /// Sets the options of what prepared the sources.
    pub(super) fn set(&mut self, hull: &Hull, sweep: &Sweep) -> Result<(), FieldError> {
        let options = if self.images.has_silhouettes { AnyOptions::new(*hull) } else { AnyOptions::new(*sweep) };
        self.views.set(&options)
    }

    /// Goes on towards the sources' surfaces ([`Prepared::advance`]): encodes all views, and asks for their depths.
    pub(super) fn advance(&mut self, progress: &dyn Progress) -> Result<bool, FieldError> {
        self.encode_all(progress)?;
        self.views.geometry().map_or(Ok(true), Geometry::ask_for_depths)
    }

    fn encode_all(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        let quiet = &Quiet(progress);
        for view in 0..self.encoded.len() {
            progress.check()?;
            self.encode(view, quiet)?;
        }
        Ok(())
    }

    /// The optimisation at its beginning, from the sources' surfaces; `None` where there are too few.
    pub(super) fn optimisation(
        &mut self,
        recipe: Recipe,
        progress: &dyn Progress,
    ) -> Result<Option<Optimisation<'a>>, FieldError> {
        self.encode_all(progress)?;
        let cloud = Recipe::cloud(self.images.images.len());
        let points = cloud_of(&self.source_depths()?, &self.images, &self.relevance, cloud, &Quiet(progress))?;
        optimisation(self.device, &self.images, &points, recipe)
    }
}

impl<D: Device> Geometry for SourceDepths<'_, D> {
    fn surfaces(&self) -> Surfaces {
        self.views.geometry().map_or_else(Surfaces::default, Geometry::surfaces)
    }

    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        self.views.geometry().map_or(Ok(Vec::new()), Geometry::source_depths)
    }
}

/// Gaussians on a device.
pub(super) struct Splats<'a, D: Device> {
    device: &'a D,
    gaussians: D::Buffer<GaussianBlock>,
    count: usize,
    near: f32,
    background: [f32; 3],
    is_antialiased: bool,
    /// How much brighter each source is than they are: red, green, blue.
    gains: Vec<[f32; 3]>,
    residuals: RefCell<Residuals>,
    room: Room,
}

impl<'a, D: Device> Splats<'a, D> {
    /// Those of a recipe.
    pub(super) fn upload(device: &'a D, optimised: Optimised, recipe: &Recipe) -> Result<Splats<'a, D>, FieldError> {
        let Optimised { gaussians, near, background, gains, is_antialiased, .. } = optimised;
        let residuals = RefCell::new(Residuals::new(gains.len(), recipe.residual_share));
        let (count, gaussians, room) = (gaussians.len(), device.upload(&gaussians)?, Room::default());
        Ok(Splats { device, gaussians, count, near, background, is_antialiased, gains, residuals, room })
    }

    /// Begins their picture of a target, as bright as the sources that count for it, as the other pictures are.
    pub(super) fn draw(
        self: &Rc<Self>,
        images: &Arc<SourceImages>,
        request: &Request<'_>,
    ) -> Result<impl FnOnce() -> Result<Rendered, FieldError> + use<'a, D>, FieldError> {
        let Splats { device, near, background, is_antialiased, .. } = **self;
        let splatter = Splatter { device, near, background, is_antialiased, harmonics: None };
        let weights: Vec<(usize, f32)> = request.views.iter().copied().zip(request.view_weights()).collect();
        let used = weights.iter().filter(|(_, weight)| *weight > 0.0).map(|(view, _)| *view);
        let missing: Vec<usize> = used.filter(|view| self.residuals.borrow().is_missing(*view)).collect();
        let target = request.camera.block(0);
        let sources = missing.iter().map(|view| images.images[*view].camera.block(0));
        let begin = |camera: CameraBlock| splatter.begin(&self.gaussians, self.count, &camera, &self.room);
        let begun = [target].into_iter().chain(sources).map(begin).collect::<Result<Vec<_>, _>>()?;
        device.submit()?;
        let (splats, images) = (self.clone(), images.clone());
        Ok(move || {
            let Splats { gaussians, count, gains, residuals, room, .. } = &*splats;
            let finish = |begun| splatter.rendered(gaussians, *count, begun, room, MIN_OPACITY);
            let mut pictures = begun.into_iter().map(finish).collect::<Result<Vec<_>, _>>()?;
            let mut picture = pictures.remove(0);
            let gain = common_gain(gains, &weights);
            for colour in &mut picture.colours {
                (0..3).for_each(|channel| colour[channel] = (colour[channel] * gain[channel]).clamp(0.0, 1.0));
            }
            let mut residuals = residuals.borrow_mut();
            for (view, picture) in missing.iter().zip(pictures) {
                residuals.add_source(*view, picture, &images, gains[*view]);
            }
            residuals.add(&target, &weights, &mut picture);
            Ok(picture)
        })
    }
}

/// The weighted geometric mean of the views' gains.
fn common_gain(gains: &[[f32; 3]], weights: &[(usize, f32)]) -> [f32; 3] {
    let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
    [0, 1, 2].map(|channel| {
        let part = |(view, weight): &(usize, f32)| weight * gains[*view][channel].max(f32::MIN_POSITIVE).ln();
        if sum > 0.0 { (weights.iter().map(part).sum::<f32>() / sum).exp() } else { 1.0 }
    })
}
