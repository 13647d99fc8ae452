//! Pictures of the hull or of the plane sweep, and those of Gaussians to mix with them.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, once for a weighting and an effort.
//! They are one of the pictures that are mixed by region. With a bound on the time or on the error these pictures have
//! no Gaussians: what is omitted is measured against a picture without.

use super::splats::{SourceDepths, Splats, TRIAL_DIVISOR};
use crate::gaussians::Recipe;
use crate::{
    Effort, Efforts, Encoding, Encodings, FieldError, Geometry, Prepared, Record, Rendered, Request, Setting, Tunable,
    Tuned, Weighted,
};
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_weighting::sources::SourceWeights;

/// The setting that says what a picture shows: 0 for the sweep or the hull, [`FILLED`], 1 for the Gaussians.
const GAUSSIANS: &str = "gaussians";
/// The hull, filled by the Gaussians where they are more opaque.
const FILLED: f32 = 0.5;

/// What a picture shows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    /// The sweep or the hull.
    Depths,
    /// The hull, filled by the Gaussians where they are more opaque.
    Filled,
    Gaussians,
}

impl Shown {
    /// By the value of [`GAUSSIANS`].
    fn of(value: f32) -> Shown {
        match value {
            FILLED => Shown::Filled,
            value if value > 0.0 => Shown::Gaussians,
            _ => Shown::Depths,
        }
    }
}

/// The views of the sweep or of the hull, and the Gaussians of the same sources.
pub(super) struct Mixed<'a, D: Device> {
    depths: SourceDepths<'a, D>,
    recipe: Recipe,
    shown: Shown,
    /// The efforts of the sweep or of the hull...
    efforts: Vec<Effort>,
    /// ... and the current one.
    effort: usize,
    /// The scalars of the sweep or of the hull.
    tunables: &'static [Tunable],
    /// The Gaussians of the current weighting and effort, once they are needed; none where the sources have too few
    /// surfaces.
    splats: Option<Option<Splats<D>>>,
}

impl<'a, D: Device> Mixed<'a, D> {
    pub(super) fn new(mut depths: SourceDepths<'a, D>, recipe: Recipe) -> Mixed<'a, D> {
        let efforts = depths.views.efforts().map_or_else(Vec::new, |efforts| efforts.list());
        let tunables = depths.views.tuned().map_or(&[][..], |tuned| tuned.tunables());
        Mixed {
            recipe: recipe.mixed_with(&depths.images),
            depths,
            shown: Shown::Depths,
            effort: efforts.len().saturating_sub(1),
            efforts,
            tunables,
            splats: None,
        }
    }

    /// Whether nothing is omitted.
    fn is_exact(&self) -> bool {
        self.effort + 1 >= self.efforts.len()
    }

    /// The Gaussians, optimised if they are not there yet; `None` where the sources have too few surfaces.
    fn splats(&mut self, progress: &dyn Progress) -> Result<Option<&mut Splats<D>>, FieldError> {
        if self.splats.is_none() {
            let splats = match self.depths.optimisation(self.recipe, progress)? {
                Some(mut optimisation) => {
                    optimisation.run_to(u32::MAX, &Quiet(progress))?;
                    Some(Splats::upload(self.depths.device, optimisation.optimised())?)
                }
                None => None,
            };
            self.splats = Some(splats);
        }
        Ok(self.splats.as_mut().and_then(Option::as_mut))
    }

    /// The Gaussians' picture of a target; `None` if there are none.
    fn splatted(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Rendered>, FieldError> {
        let (device, images) = (self.depths.device, self.depths.images.clone());
        let splats = self.splats(progress)?;
        splats.map(|splats| splats.picture(device, &images, request)).transpose()
    }
}

/// Raises the opacity of a picture over a background to that of another one, by the other one's colours: what wrong
/// depths carve out of a hull, at its outline most, is filled.
fn fill(picture: &mut Rendered, from: &Rendered, background: [f32; 3]) {
    for (colour, other) in picture.colours.iter_mut().zip(&from.colours) {
        let missing = other[3] - colour[3];
        if missing > 0.0 {
            let share = missing / other[3];
            (0..3).for_each(|channel| colour[channel] += share * (other[channel] - background[channel]));
            colour[3] = other[3];
        }
    }
}

impl<D: Device> Prepared for Mixed<'_, D> {
    fn encoding(&self) -> Encoding {
        self.depths.views.encoding()
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.depths.encode(view, progress)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let has_gaussians = self.shown != Shown::Depths && self.is_exact();
        let splatted = if has_gaussians { self.splatted(request, progress)? } else { None };
        match splatted {
            Some(splatted) if self.shown == Shown::Filled => {
                let mut filled = self.depths.views.render(request, progress)?;
                fill(&mut filled, &splatted, self.depths.images.background);
                Ok(filled)
            }
            Some(splatted) => Ok(splatted),
            None => self.depths.views.render(request, progress),
        }
    }

    fn record(&self) -> Record {
        self.depths.views.record()
    }

    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        Some(self)
    }

    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        if self.efforts.is_empty() { None } else { Some(self) }
    }

    fn tuned(&mut self) -> Option<&mut dyn Tuned> {
        Some(self)
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(&self.depths)
    }
}

impl<D: Device> Weighted for Mixed<'_, D> {
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.splats = None;
        self.depths.weigh(relevance)
    }
}

impl<D: Device> Efforts for Mixed<'_, D> {
    fn list(&self) -> Vec<Effort> {
        self.efforts.clone()
    }

    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError> {
        self.effort = effort;
        let Some(efforts) = self.depths.views.efforts() else { return Ok(Encodings::Kept) };
        let encodings = efforts.set(effort)?;
        if encodings == Encodings::Dropped {
            self.depths.drop_encodings();
            self.splats = None;
        }
        Ok(encodings)
    }

    fn set_trial(&mut self) {
        self.recipe.iterations = self.recipe.iterations.map(|count| count / TRIAL_DIVISOR);
        self.splats = None;
        if let Some(efforts) = self.depths.views.efforts() {
            efforts.set_trial();
        }
    }
}

impl<D: Device> Tuned for Mixed<'_, D> {
    fn tunables(&self) -> &'static [Tunable] {
        self.tunables
    }

    fn tune(&mut self, settings: &[Setting]) {
        let shown = settings.iter().find(|setting| setting.name == GAUSSIANS);
        self.shown = shown.map_or(Shown::Depths, |setting| Shown::of(setting.value));
        if let Some(tuned) = self.depths.views.tuned() {
            tuned.tune(settings);
        }
    }

    /// The sweep's, or the hull's one picture, filled, and that of the Gaussians alone: their errors are the least like
    /// the others'.
    fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        let with = |value: f32| chosen.iter().copied().chain([Setting { name: GAUSSIANS, value }]).collect();
        let mut parts = self.depths.views.tuned().map_or_else(|| vec![with(FILLED)], |tuned| tuned.parts(chosen));
        parts.push(with(1.0));
        parts
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
        let mut carved = picture(vec![black(0.0), black(0.5), black(1.0), black(0.0)]);
        fill(&mut carved, &picture(vec![red(0.75), red(1.0), red(0.5), red(0.0)]), [1.0; 3]);
        assert_eq!(carved.colours, [red(0.75), [0.5, 0.0, 0.0, 1.0], black(1.0), black(0.0)]);
    }
}
