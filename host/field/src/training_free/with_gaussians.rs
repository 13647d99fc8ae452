//! Pictures of the plane sweep mixed with those of Gaussians, and the Gaussians alone.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, from the depths that the sweep found: once for a
//! weighting. They are one of the pictures that are mixed by region. With a bound on the time or on the error the pictures are the
//! sweep's: what is left out of them is measured against a picture without Gaussians.

use crate::gaussians::{Optimised, Optimiser, Recipe, Splatter};
use crate::point_cloud::cloud_of;
use crate::{
    DepthMap, Effort, Efforts, Encoding, Encodings, FieldError, Geometry, Prepared, Record, Rendered, Request, Setting,
    Surfaces, Tunable, Tuned, Weighted,
};
use std::sync::Arc;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// The setting under which a picture is that of the Gaussians: 1 for them, 0 for the sweep.
const GAUSSIANS: &str = "gaussians";
/// Opacity below which a pixel has no depth.
const MIN_OPACITY: f32 = 0.5;

/// Part of the iterations that are made for pictures of sources that are left out: those are small and only compared.
const TRIAL_DIVISOR: u32 = 2;

/// Gaussians on a device.
struct Scene<D: Device> {
    gaussians: D::Buffer<GaussianBlock>,
    count: usize,
    near: f32,
    background: [f32; 3],
    /// How much brighter each source is than they are: red, green, blue.
    gains: Vec<[f32; 3]>,
}

/// The sweep's views, and the Gaussians of the same sources.
pub(super) struct WithGaussians<'a, D: Device> {
    device: &'a D,
    sweep: Box<dyn Prepared + 'a>,
    images: Arc<SourceImages>,
    recipe: Recipe,
    /// Whether all pictures are those of the Gaussians, of all sources.
    is_alone: bool,
    /// Whether this picture is.
    is_splatted: bool,
    encoded: Vec<bool>,
    relevance: Vec<SourceWeights>,
    /// The sweep's efforts.
    efforts: Vec<Effort>,
    /// The sweep's scalars.
    tunables: &'static [Tunable],
    /// Whether the exact picture is made.
    is_exact: bool,
    /// The Gaussians of the current weighting, when they are needed; none where the sources have too few surfaces.
    scene: Option<Option<Scene<D>>>,
}

impl<'a, D: Device> WithGaussians<'a, D> {
    pub(super) fn new(
        device: &'a D,
        mut sweep: Box<dyn Prepared + 'a>,
        sources: &SourceImages,
        recipe: Recipe,
        is_alone: bool,
    ) -> WithGaussians<'a, D> {
        let efforts = sweep.efforts().map_or_else(Vec::new, |efforts| efforts.list());
        let tunables = sweep.tuned().map_or(&[][..], |tuned| tuned.tunables());
        let encoded = vec![false; sources.images.len()];
        let images = Arc::new(sources.clone());
        let (relevance, scene) = (Vec::new(), None);
        WithGaussians {
            device,
            sweep,
            images,
            recipe,
            is_alone,
            is_splatted: is_alone,
            encoded,
            relevance,
            efforts,
            tunables,
            is_exact: true,
            scene,
        }
    }

    /// Optimises the Gaussians, if they are not there yet.
    fn prepare_scene(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.scene.is_some() {
            return Ok(());
        }
        let quiet = &Quiet(progress);
        for view in 0..self.encoded.len() {
            progress.check()?;
            self.encode(view, quiet)?;
        }
        let maps = self.sweep.geometry().map_or(Ok(Vec::new()), Geometry::source_depths)?;
        let cloud = Recipe::cloud(self.images.images.len());
        let points = cloud_of(&maps, &self.images, &self.relevance, cloud, quiet)?;
        let scene = match Optimiser::new(self.device, &self.images, &points, self.recipe)? {
            Some(mut optimiser) => {
                optimiser.run(quiet)?;
                let Optimised { gaussians, near, background, gains } = optimiser.optimised();
                let count = gaussians.len();
                Some(Scene { gaussians: self.device.upload(&gaussians)?, count, near, background, gains })
            }
            None => None,
        };
        self.scene = Some(scene);
        Ok(())
    }

    /// The Gaussians from a target; `None` if there are none.
    fn splatted(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Rendered>, FieldError> {
        self.prepare_scene(progress)?;
        let Some(Some(Scene { gaussians, count, near, background, gains })) = &self.scene else { return Ok(None) };
        let splatter = Splatter { device: self.device, near: *near, background: *background };
        let mut splatted = splatter.rendered(gaussians, *count, &request.camera.block(0), MIN_OPACITY)?;
        // As bright as the sources that count for this target, as the sweep's picture is.
        let weights: Vec<(usize, f32)> = request.views.iter().copied().zip(request.view_weights()).collect();
        let gain = common_gain(gains, &weights);
        for colour in &mut splatted.colours {
            (0..3).for_each(|channel| colour[channel] = (colour[channel] * gain[channel]).clamp(0.0, 1.0));
        }
        Ok(Some(splatted))
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

impl<D: Device> Prepared for WithGaussians<'_, D> {
    fn encoding(&self) -> Encoding {
        if self.is_alone { Encoding::All } else { self.sweep.encoding() }
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if !self.encoded[view] {
            self.sweep.encode(view, progress)?;
            self.encoded[view] = true;
        }
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        if self.is_splatted
            && self.is_exact
            && let Some(splatted) = self.splatted(request, progress)?
        {
            return Ok(splatted);
        }
        self.sweep.render(request, progress)
    }

    fn record(&self) -> Record {
        self.sweep.record()
    }

    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        Some(self)
    }

    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        if self.is_alone || self.efforts.is_empty() { None } else { Some(self) }
    }

    fn tuned(&mut self) -> Option<&mut dyn Tuned> {
        if self.is_alone { None } else { Some(self) }
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(self)
    }
}

impl<D: Device> Weighted for WithGaussians<'_, D> {
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.encoded.fill(false);
        self.relevance = relevance.to_vec();
        self.scene = None;
        self.sweep.weighted().map_or(Ok(()), |weighted| weighted.weigh(relevance))
    }
}

impl<D: Device> Efforts for WithGaussians<'_, D> {
    fn list(&self) -> Vec<Effort> {
        self.efforts.clone()
    }

    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError> {
        self.is_exact = effort + 1 >= self.efforts.len();
        let Some(efforts) = self.sweep.efforts() else { return Ok(Encodings::Kept) };
        let encodings = efforts.set(effort)?;
        if encodings == Encodings::Dropped {
            self.encoded.fill(false);
            self.scene = None;
        }
        Ok(encodings)
    }

    fn set_trial(&mut self) {
        self.recipe.iterations = self.recipe.iterations.map(|count| count / TRIAL_DIVISOR);
        if let Some(efforts) = self.sweep.efforts() {
            efforts.set_trial();
        }
    }
}

impl<D: Device> Tuned for WithGaussians<'_, D> {
    fn tunables(&self) -> &'static [Tunable] {
        self.tunables
    }

    fn tune(&mut self, settings: &[Setting]) {
        self.is_splatted = self.is_alone || settings.iter().any(|own| own.name == GAUSSIANS && own.value > 0.0);
        if let Some(tuned) = self.sweep.tuned() {
            tuned.tune(settings);
        }
    }

    /// The sweep's, and that of the Gaussians alone: their errors are the least like the others'.
    fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        let mut parts = self.sweep.tuned().map_or_else(Vec::new, |tuned| tuned.parts(chosen));
        parts.push(chosen.iter().copied().chain([Setting { name: GAUSSIANS, value: 1.0 }]).collect());
        parts
    }
}

impl<D: Device> Geometry for WithGaussians<'_, D> {
    fn surfaces(&self) -> Surfaces {
        self.sweep.geometry().map_or_else(Surfaces::default, Geometry::surfaces)
    }

    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        self.sweep.geometry().map_or(Ok(Vec::new()), Geometry::source_depths)
    }
}
