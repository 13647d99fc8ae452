//! Pictures of the hull or of the plane sweep mixed with those of Gaussians, and the Gaussians alone.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, from the depths that the sweep or the hull found:
//! once for a weighting and an effort. They are one of the pictures that are mixed by region. With a bound on the time or on the error
//! these pictures have no Gaussians: what is left out of them is measured against a picture without. Pictures of the Gaussians alone
//! have efforts of their own: the first iterations of the same optimisation, which a dearer effort goes on from.

use super::gaussians::stops;
use crate::gaussians::{Optimisation, Optimised, Recipe, Residuals, Splatter, optimisation};
use crate::point_cloud::cloud_of;
use crate::{
    DepthMap, Effort, Efforts, Encoding, Encodings, FieldError, Geometry, Prepared, Record, Rendered, Request, Setting,
    Surfaces, Tunable, Tuned, Weighted,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::photographs::{SourceImages, longest_side};
use viewfuse_weighting::sources::SourceWeights;

/// The setting that says what a picture shows: 0 for the sweep or the hull, [`FILLED`], 1 for the Gaussians.
const GAUSSIANS: &str = "gaussians";
/// The hull, filled by the Gaussians where they are more opaque.
const FILLED: f32 = 0.5;
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
    residuals: Residuals,
}

/// The views of the sweep or of the hull, and the Gaussians of the same sources.
pub(super) struct WithGaussians<'a, D: Device> {
    device: &'a D,
    depths: Box<dyn Prepared + 'a>,
    images: Arc<SourceImages>,
    recipe: Recipe,
    /// Whether all pictures are those of the Gaussians, of all sources.
    is_alone: bool,
    /// What this picture shows: the value of [`GAUSSIANS`].
    shown: f32,
    encoded: Vec<bool>,
    relevance: Vec<SourceWeights>,
    /// The efforts of the pictures: of the optimisation, or of the views that the Gaussians are mixed with.
    efforts: Vec<Effort>,
    /// How many iterations each effort of the optimisation has; all have all where the efforts are not its own.
    iterations: Vec<u32>,
    /// The current one.
    effort: usize,
    /// Their scalars.
    tunables: &'static [Tunable],
    /// The Gaussians of the current weighting by their effort, when they are needed; none where the sources have too few surfaces.
    scenes: BTreeMap<usize, Option<Scene<D>>>,
    /// The optimisation for the current weighting, as far as it went, where a dearer effort may go on from there.
    optimisation: Option<Box<dyn Optimisation + 'a>>,
}

impl<'a, D: Device> WithGaussians<'a, D> {
    pub(super) fn new(
        device: &'a D,
        mut depths: Box<dyn Prepared + 'a>,
        sources: &SourceImages,
        recipe: Recipe,
        is_alone: bool,
    ) -> WithGaussians<'a, D> {
        let source_side = sources.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let stops = if is_alone { stops(&recipe, source_side) } else { Vec::new() };
        let iterations = stops.iter().map(|stop| stop.iteration).collect();
        let efforts = match is_alone {
            true => stops.into_iter().map(|stop| stop.effort).collect(),
            false => depths.efforts().map_or_else(Vec::new, |efforts| efforts.list()),
        };
        let tunables = depths.tuned().map_or(&[][..], |tuned| tuned.tunables());
        let encoded = vec![false; sources.images.len()];
        let images = Arc::new(sources.clone());
        WithGaussians {
            device,
            depths,
            images,
            recipe: if is_alone { recipe } else { recipe.mixed_with(sources) },
            is_alone,
            shown: if is_alone { 1.0 } else { 0.0 },
            encoded,
            relevance: Vec::new(),
            effort: efforts.len().saturating_sub(1),
            efforts,
            iterations,
            tunables,
            scenes: BTreeMap::new(),
            optimisation: None,
        }
    }

    /// Whether nothing is left out.
    fn is_exact(&self) -> bool {
        self.effort + 1 >= self.efforts.len()
    }

    /// Optimises the Gaussians of the current effort, if they are not there yet.
    fn prepare_scene(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.scenes.contains_key(&self.effort) {
            return Ok(());
        }
        let end = self.iterations.get(self.effort).copied().unwrap_or(u32::MAX);
        let kept = self.optimisation.take().filter(|own| own.done() <= end);
        let begun = match kept {
            Some(own) => Some(own),
            None => self.begin(progress)?,
        };
        let scene = match begun {
            Some(mut own) => {
                let ran = own.run_to(end, &Quiet(progress));
                let Optimised { gaussians, near, background, gains } = own.optimised();
                if !self.is_exact() {
                    self.optimisation = Some(own);
                }
                ran?;
                let count = gaussians.len();
                let residuals = Residuals::new(gains.len());
                let gaussians = self.device.upload(&gaussians)?;
                Some(Scene { gaussians, count, near, background, gains, residuals })
            }
            None => None,
        };
        self.scenes.insert(self.effort, scene);
        Ok(())
    }

    /// The optimisation at its beginning, from the sources' surfaces; `None` where there are too few.
    fn begin(&mut self, progress: &dyn Progress) -> Result<Option<Box<dyn Optimisation + 'a>>, FieldError> {
        let quiet = &Quiet(progress);
        for view in 0..self.encoded.len() {
            progress.check()?;
            self.encode(view, quiet)?;
        }
        let maps = self.depths.geometry().map_or(Ok(Vec::new()), Geometry::source_depths)?;
        let cloud = Recipe::cloud(self.images.images.len());
        let points = cloud_of(&maps, &self.images, &self.relevance, cloud, quiet)?;
        optimisation(self.device, &self.images, &points, self.recipe)
    }

    /// Forgets the Gaussians.
    fn forget(&mut self) {
        self.scenes.clear();
        self.optimisation = None;
    }

    /// The Gaussians from a target; `None` if there are none.
    fn splatted(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Rendered>, FieldError> {
        self.prepare_scene(progress)?;
        let scene = self.scenes.get_mut(&self.effort).and_then(Option::as_mut);
        let Some(Scene { gaussians, count, near, background, gains, residuals }) = scene else { return Ok(None) };
        let splatter = Splatter { device: self.device, near: *near, background: *background };
        let mut splatted = splatter.rendered(gaussians, *count, &request.camera.block(0), MIN_OPACITY)?;
        // As bright as the sources that count for this target, as the other pictures are.
        let weights: Vec<(usize, f32)> = request.views.iter().copied().zip(request.view_weights()).collect();
        let gain = common_gain(gains, &weights);
        for colour in &mut splatted.colours {
            (0..3).for_each(|channel| colour[channel] = (colour[channel] * gain[channel]).clamp(0.0, 1.0));
        }
        for (view, _) in weights.iter().filter(|(_, weight)| *weight > 0.0) {
            let source = (&*self.images, gains[*view]);
            residuals.find(*view, &splatter, (gaussians, *count), source, MIN_OPACITY)?;
        }
        residuals.add(&request.camera.block(0), &weights, &mut splatted);
        Ok(Some(splatted))
    }
}

/// Raises the opacity of a picture over a background to that of another one, by the other one's colours: what wrong depths carve out
/// of a hull, at its outline most, is filled.
fn fill(picture: &mut Rendered, from: &Rendered, background: [f32; 3]) {
    for (own, other) in picture.colours.iter_mut().zip(&from.colours) {
        let missing = other[3] - own[3];
        if missing > 0.0 {
            let share = missing / other[3];
            (0..3).for_each(|channel| own[channel] += share * (other[channel] - background[channel]));
            own[3] = other[3];
        }
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
        if self.is_alone { Encoding::All } else { self.depths.encoding() }
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if !self.encoded[view] {
            self.depths.encode(view, progress)?;
            self.encoded[view] = true;
        }
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let has_gaussians = self.shown > 0.0 && (self.is_alone || self.is_exact());
        let splatted = if has_gaussians { self.splatted(request, progress)? } else { None };
        match splatted {
            Some(splatted) if self.shown == FILLED => {
                let mut filled = self.depths.render(request, progress)?;
                fill(&mut filled, &splatted, self.images.background);
                Ok(filled)
            }
            Some(splatted) => Ok(splatted),
            None => self.depths.render(request, progress),
        }
    }

    fn record(&self) -> Record {
        self.depths.record()
    }

    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        Some(self)
    }

    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        if self.efforts.is_empty() { None } else { Some(self) }
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
        self.forget();
        self.depths.weighted().map_or(Ok(()), |weighted| weighted.weigh(relevance))
    }
}

impl<D: Device> Efforts for WithGaussians<'_, D> {
    fn list(&self) -> Vec<Effort> {
        self.efforts.clone()
    }

    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError> {
        self.effort = effort;
        if self.is_alone {
            // The surfaces that the Gaussians begin with are the same.
            return Ok(Encodings::Kept);
        }
        let Some(efforts) = self.depths.efforts() else { return Ok(Encodings::Kept) };
        let encodings = efforts.set(effort)?;
        if encodings == Encodings::Dropped {
            self.encoded.fill(false);
            self.forget();
        }
        Ok(encodings)
    }

    /// The Gaussians are optimised further for a dearer effort. Views of the sweep or of the hull are made again for another one.
    fn goes_on(&self) -> bool {
        self.is_alone
    }

    fn set_trial(&mut self) {
        self.recipe.iterations = self.recipe.iterations.map(|count| count / TRIAL_DIVISOR);
        self.iterations.iter_mut().for_each(|count| *count /= TRIAL_DIVISOR);
        self.forget();
        if let Some(efforts) = self.depths.efforts() {
            efforts.set_trial();
        }
    }
}

impl<D: Device> Tuned for WithGaussians<'_, D> {
    fn tunables(&self) -> &'static [Tunable] {
        self.tunables
    }

    fn tune(&mut self, settings: &[Setting]) {
        if !self.is_alone {
            self.shown = settings.iter().find(|own| own.name == GAUSSIANS).map_or(0.0, |own| own.value);
        }
        if let Some(tuned) = self.depths.tuned() {
            tuned.tune(settings);
        }
    }

    /// The sweep's, or the hull's one picture, filled, and that of the Gaussians alone: their errors are the least like the others'.
    fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        let with = |value: f32| chosen.iter().copied().chain([Setting { name: GAUSSIANS, value }]).collect();
        let mut parts = self.depths.tuned().map_or_else(|| vec![with(FILLED)], |tuned| tuned.parts(chosen));
        parts.push(with(1.0));
        parts
    }
}

impl<D: Device> Geometry for WithGaussians<'_, D> {
    fn surfaces(&self) -> Surfaces {
        self.depths.geometry().map_or_else(Surfaces::default, Geometry::surfaces)
    }

    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        self.depths.geometry().map_or(Ok(Vec::new()), Geometry::source_depths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_more_opaque_picture_fills_what_is_missing() {
        let picture = |colours: Vec<[f32; 4]>| {
            let (width, height) = (colours.len() as u32, 1);
            Rendered { colours, depths: Vec::new(), confidences: Vec::new(), width, height }
        };
        // Black on white: carved out, half there, and more opaque than the other, which is red.
        let black = |opacity: f32| [1.0 - opacity, 1.0 - opacity, 1.0 - opacity, opacity];
        let red = |opacity: f32| [1.0, 1.0 - opacity, 1.0 - opacity, opacity];
        let mut own = picture(vec![black(0.0), black(0.5), black(1.0), black(0.0)]);
        fill(&mut own, &picture(vec![red(0.75), red(1.0), red(0.5), red(0.0)]), [1.0; 3]);
        assert_eq!(own.colours, [red(0.75), [0.5, 0.0, 0.0, 1.0], black(1.0), black(0.0)]);
    }
}
