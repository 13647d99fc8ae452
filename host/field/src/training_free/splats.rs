//! Gaussians of the sources: optimised from the depths that the hull or the sweep found of them, and their pictures.

use super::hull::Hull;
use super::sweep::{Cache, Sweep};
use crate::gaussians::{Begun, Optimisation, Optimised, Recipe, Residuals, Splatter, optimisation};
use crate::point_cloud::cloud_of;
use crate::{AnyOptions, DepthMap, FieldError, Geometry, Prepared, Rendered, Request, Surfaces};
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
    pub(super) views: Box<dyn Prepared + 'a>,
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
        let views: Box<dyn Prepared + 'a> = match sources.has_silhouettes {
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
    residuals: Residuals,
    /// Their pictures of a target and of the sources whose residuals it needs, which are begun.
    begun: Option<(Pictures, Begun<'a, D>)>,
}

/// Which pictures a target needs.
#[derive(Clone, PartialEq)]
struct Pictures {
    target: CameraBlock,
    /// The views that have a weight, and no residual yet.
    missing: Vec<usize>,
}

impl<'a, D: Device> Splats<'a, D> {
    /// Those of a recipe.
    pub(super) fn upload(device: &'a D, optimised: Optimised, recipe: &Recipe) -> Result<Splats<'a, D>, FieldError> {
        let Optimised { gaussians, near, background, gains, is_antialiased, .. } = optimised;
        let (count, residuals) = (gaussians.len(), Residuals::new(gains.len(), recipe.residual_share));
        let gaussians = device.upload(&gaussians)?;
        Ok(Splats { device, gaussians, count, near, background, is_antialiased, gains, residuals, begun: None })
    }

    fn splatter(&self) -> Splatter<'a, D> {
        let Splats { device, near, background, is_antialiased, .. } = *self;
        Splatter { device, near, background, is_antialiased, harmonics: None }
    }

    /// The pictures of a target.
    fn pictures(&self, request: &Request<'_>) -> Pictures {
        let weights = request.views.iter().copied().zip(request.view_weights());
        let used = weights.filter(|(_, weight)| *weight > 0.0).map(|(view, _)| view);
        let missing = used.filter(|view| self.residuals.is_missing(*view)).collect();
        Pictures { target: request.camera.block(0), missing }
    }

    /// Begins the pictures of a target; returns whether they were begun before.
    pub(super) fn begin(&mut self, images: &SourceImages, request: &Request<'_>) -> Result<bool, FieldError> {
        let pictures = self.pictures(request);
        let are_begun = self.begun.as_ref().is_some_and(|(begun, _)| *begun == pictures);
        self.begun = Some(self.begun(images, pictures)?);
        Ok(are_begun)
    }

    /// Those that were begun, if they are these.
    fn begun(&mut self, images: &SourceImages, pictures: Pictures) -> Result<(Pictures, Begun<'a, D>), FieldError> {
        if let Some(begun) = self.begun.take().filter(|(begun, _)| *begun == pictures) {
            return Ok(begun);
        }
        let sources = pictures.missing.iter().map(|view| images.images[*view].camera.block(0));
        let cameras: Vec<CameraBlock> = [pictures.target].into_iter().chain(sources).collect();
        let begun = self.splatter().begin(&self.gaussians, self.count, &cameras)?;
        Ok((pictures, begun))
    }

    /// Their picture of a target, as bright as the sources that count for it, as the other pictures are; to be waited
    /// for.
    pub(super) fn picture<'p>(
        &'p mut self,
        images: Arc<SourceImages>,
        request: &Request<'_>,
    ) -> Result<impl FnOnce() -> Result<Rendered, FieldError> + use<'p, 'a, D>, FieldError> {
        let (Pictures { target, missing }, begun) = self.begun(&images, self.pictures(request))?;
        let later = self.splatter().rendered(&self.gaussians, self.count, begun, MIN_OPACITY)?;
        let weights: Vec<(usize, f32)> = request.views.iter().copied().zip(request.view_weights()).collect();
        let Splats { gains, residuals, .. } = self;
        Ok(move || {
            let mut pictures = later()?;
            let mut picture = pictures.remove(0);
            let gain = common_gain(gains, &weights);
            for colour in &mut picture.colours {
                (0..3).for_each(|channel| colour[channel] = (colour[channel] * gain[channel]).clamp(0.0, 1.0));
            }
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
