//! Pictures of the plane sweep mixed with those of Gaussians, and the Gaussians alone.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, from the depths that the sweep found: once for a
//! weighting. The share of them in a picture is a scalar that is chosen for a scene by leaving sources out, as the sweep's own are;
//! its default is 0. With a bound on the time or on the error the pictures are the sweep's: what is left out of them is measured
//! against a picture without Gaussians.

use crate::gaussians::{Optimised, Optimiser, Recipe, Splatter};
use crate::point_cloud::{CloudOptions, cloud_of};
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

/// The share of the Gaussians in a picture.
const SHARE: &str = "gaussian share";
/// Opacity below which a pixel has no depth.
const MIN_OPACITY: f32 = 0.5;

/// The scalars: the share, and the sweep's.
pub(super) const TUNABLES: &[Tunable] = &with_share::<{ super::sweep::TUNABLES.len() + 1 }>(super::sweep::TUNABLES);

const fn with_share<const COUNT: usize>(own: &[Tunable]) -> [Tunable; COUNT] {
    // Sources are left out at a small size, where Gaussians are as sharp as the sweep: trials take greater shares than pictures of
    // full size should have (host/research/results/gaussians.md).
    let share = Tunable { name: SHARE, default: 0.0, others: &[0.25] };
    let mut all = [share; COUNT];
    let mut index = 0;
    while index < own.len() {
        all[index] = own[index];
        index += 1;
    }
    all
}

/// Gaussians on a device.
struct Scene<D: Device> {
    gaussians: D::Buffer<GaussianBlock>,
    count: usize,
    near: f32,
    background: [f32; 3],
}

/// The sweep's views, and the Gaussians of the same sources.
pub(super) struct WithGaussians<'a, D: Device> {
    device: &'a D,
    sweep: Box<dyn Prepared + 'a>,
    images: Arc<SourceImages>,
    recipe: Recipe,
    /// The share, and the one before any was chosen.
    shares: [f32; 2],
    encoded: Vec<bool>,
    relevance: Vec<SourceWeights>,
    /// The sweep's efforts.
    efforts: Vec<Effort>,
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
        share: f32,
    ) -> WithGaussians<'a, D> {
        let efforts = sweep.efforts().map_or_else(Vec::new, |efforts| efforts.list());
        let encoded = vec![false; sources.images.len()];
        let images = Arc::new(sources.clone());
        let (relevance, scene) = (Vec::new(), None);
        WithGaussians {
            device,
            sweep,
            images,
            recipe,
            shares: [share; 2],
            encoded,
            relevance,
            efforts,
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
        let points = cloud_of(&maps, &self.images, &self.relevance, CloudOptions::default(), quiet)?;
        let scene = match Optimiser::new(self.device, &self.images, &points, self.recipe)? {
            Some(mut optimiser) => {
                optimiser.run(quiet)?;
                let Optimised { gaussians, near, background, .. } = optimiser.optimised();
                let count = gaussians.len();
                Some(Scene { gaussians: self.device.upload(&gaussians)?, count, near, background })
            }
            None => None,
        };
        self.scene = Some(scene);
        Ok(())
    }

    /// The Gaussians from a target; `None` if there are none.
    fn splatted(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Rendered>, FieldError> {
        self.prepare_scene(progress)?;
        let Some(Some(Scene { gaussians, count, near, background })) = &self.scene else { return Ok(None) };
        let splatter = Splatter { device: self.device, near: *near, background: *background };
        splatter.rendered(gaussians, *count, &request.camera.block(0), MIN_OPACITY).map(Some).map_err(FieldError::from)
    }
}

impl<D: Device> WithGaussians<'_, D> {
    /// Whether pictures are those of the Gaussians alone, of all sources.
    fn is_alone(&self) -> bool {
        self.shares[1] >= 1.0
    }
}

impl<D: Device> Prepared for WithGaussians<'_, D> {
    fn encoding(&self) -> Encoding {
        if self.is_alone() { Encoding::All } else { self.sweep.encoding() }
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if !self.encoded[view] {
            self.sweep.encode(view, progress)?;
            self.encoded[view] = true;
        }
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let share = if self.is_exact { self.shares[0] } else { 0.0 };
        let splatted = if share > 0.0 { self.splatted(request, progress)? } else { None };
        match splatted {
            Some(splatted) if share >= 1.0 => Ok(splatted),
            Some(splatted) => {
                let mut rendered = self.sweep.render(request, progress)?;
                for (own, other) in rendered.colours.iter_mut().zip(&splatted.colours) {
                    (0..3).for_each(|channel| own[channel] += share * (other[channel] - own[channel]));
                }
                Ok(rendered)
            }
            None => self.sweep.render(request, progress),
        }
    }

    fn record(&self) -> Record {
        self.sweep.record()
    }

    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        Some(self)
    }

    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        if self.is_alone() { None } else { Some(self) }
    }

    fn tuned(&mut self) -> Option<&mut dyn Tuned> {
        if self.is_alone() { None } else { Some(self) }
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
        if let Some(efforts) = self.sweep.efforts() {
            efforts.set_trial();
        }
    }
}

impl<D: Device> Tuned for WithGaussians<'_, D> {
    fn tunables(&self) -> &'static [Tunable] {
        TUNABLES
    }

    fn tune(&mut self, settings: &[Setting]) {
        self.shares[0] = settings.iter().find(|own| own.name == SHARE).map_or(self.shares[1], |own| own.value);
        if let Some(tuned) = self.sweep.tuned() {
            tuned.tune(settings);
        }
    }

    /// The sweep's: each has the chosen share of the Gaussians.
    fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        self.sweep.tuned().map_or_else(Vec::new, |tuned| tuned.parts(chosen))
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
