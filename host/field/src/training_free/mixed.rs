//! Pictures of the hull or of the plane sweep, and those of Gaussians to mix with them.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, once for a weighting and an effort.
//! They are one of the pictures that are mixed by region. With a bound on the time or on the error these pictures have
//! no Gaussians: what is omitted is measured against a picture without.

use super::TrainingFree;
use super::hull::Hull;
use super::splats::{SourceDepths, Splats};
use crate::gaussians::{Optimisation, Recipe};
use crate::variant::erased;
use crate::{
    AnyOptions, Drawing, Encoding, FieldError, Geometry, Prepared, Purpose, Record, Rendered, Request, Setting, Variant,
};
use std::rc::Rc;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::photographs::longest_side;
use viewfuse_weighting::sources::SourceWeights;

/// Opacity of the Gaussians below which they carve.
const CARVED_OPACITY: f32 = 0.5;

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// The sweep or the hull.
    #[default]
    Depths,
    /// The hull, filled by the Gaussians where they are more opaque.
    Filled,
    /// The same, and carved by them where they are less than half opaque.
    Carved,
    /// The Gaussians.
    Gaussians,
}

impl Shown {
    /// In a record; none for the depths.
    pub(super) fn setting(self) -> Option<Setting> {
        let value = match self {
            Shown::Depths => return None,
            Shown::Filled => 0.5,
            Shown::Carved => 0.75,
            Shown::Gaussians => 1.0,
        };
        Some(Setting { name: "gaussians", value })
    }
}

/// The views of the sweep or of the hull, and the Gaussians of the same sources.
pub(super) struct Mixed<'a, D: Device> {
    depths: SourceDepths<'a, D>,
    hull: Hull,
    recipe: Recipe,
    shown: Shown,
    /// The Gaussians of the current weighting by each recipe, once they are needed; none where the sources have too few
    /// surfaces.
    splats: Vec<(Recipe, Option<Rc<Splats<'a, D>>>)>,
    /// Gaussians that are being optimised.
    optimisation: Option<(Recipe, Optimisation<'a>)>,
    /// The hull's last picture under the current weighting and options, with what was asked for: it is filled, and
    /// carved, by the Gaussians of each recipe.
    last: Option<(Asked, Rendered)>,
}

/// A target's camera, the weights of its views, and where rays end early.
type Asked = (CameraBlock, Vec<f32>, f32);

impl<'a, D: Device> Mixed<'a, D> {
    pub(super) fn new(depths: SourceDepths<'a, D>, options: &TrainingFree) -> Mixed<'a, D> {
        let TrainingFree { hull, recipe, shown, .. } = *options;
        Mixed { depths, hull, recipe, shown, splats: Vec::new(), optimisation: None, last: None }
    }

    /// Goes on towards the Gaussians ([`Prepared::advance`]); returns whether they are there, or cannot be.
    fn advance_splats(&mut self, progress: &dyn Progress) -> Result<bool, FieldError> {
        let recipe = self.recipe;
        if self.splats.iter().any(|(of, _)| *of == recipe) {
            return Ok(true);
        }
        let begun = match self.optimisation.take().filter(|(of, _)| *of == recipe) {
            Some((_, optimisation)) => Some(optimisation),
            None if !self.depths.advance(progress)? => return Ok(false),
            None => self.depths.optimisation(recipe, progress)?,
        };
        let splats = match begun {
            Some(mut optimisation) => {
                if !optimisation.advance(&Quiet(progress))? {
                    self.optimisation = Some((recipe, optimisation));
                    return Ok(false);
                }
                Some(Rc::new(Splats::upload(self.depths.device, optimisation.optimised()?, &recipe)?))
            }
            None => None,
        };
        self.splats.push((recipe, splats));
        Ok(true)
    }

    /// The Gaussians, optimised if they are not there yet; `None` where the sources have too few surfaces.
    fn splats(&mut self, progress: &dyn Progress) -> Result<Option<Rc<Splats<'a, D>>>, FieldError> {
        while !self.advance_splats(progress)? {}
        Ok(self.splats.iter().find(|(of, _)| *of == self.recipe).and_then(|(_, splats)| splats.clone()))
    }

    /// The picture of the sweep or the hull; the hull's is rendered once for all that is mixed with it.
    fn depths_picture(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        if !self.depths.images.has_silhouettes {
            return self.depths.views.render(request, progress);
        }
        let asked = (request.camera.block(0), request.view_weights(), request.early_termination);
        if let Some((_, picture)) = self.last.as_ref().filter(|(last, _)| *last == asked) {
            return Ok(picture.clone());
        }
        let picture = self.depths.views.render(request, progress)?;
        self.last = Some((asked, picture.clone()));
        Ok(picture)
    }

    /// The Gaussians' picture of a target; `None` if there are none.
    fn splatted(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Rendered>, FieldError> {
        let splats = self.splats(progress)?;
        splats.map(|splats| splats.draw(&self.depths.images, request)?()).transpose()
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

/// Lowers the opacity of a picture over a background to that of another one where that is below [`CARVED_OPACITY`].
fn carve(picture: &mut Rendered, by: &Rendered, background: [f32; 3]) {
    for (colour, other) in picture.colours.iter_mut().zip(&by.colours) {
        if other[3] < colour[3].min(CARVED_OPACITY) {
            let share = other[3] / colour[3];
            (0..3).for_each(|channel| {
                colour[channel] = background[channel] + share * (colour[channel] - background[channel])
            });
            colour[3] = other[3];
        }
    }
}

impl<'a, D: Device> Prepared<'a> for Mixed<'a, D> {
    fn encoding(&self) -> Encoding {
        self.depths.views.encoding()
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.depths.encode(view, progress)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let splatted = if self.shown == Shown::Depths { None } else { self.splatted(request, progress)? };
        match splatted {
            Some(splatted) if self.shown == Shown::Gaussians => Ok(splatted),
            None => self.depths_picture(request, progress),
            Some(splatted) => {
                let mut picture = self.depths_picture(request, progress)?;
                let background = self.depths.images.background;
                if self.shown == Shown::Carved {
                    carve(&mut picture, &splatted, background);
                }
                fill(&mut picture, &splatted, background);
                Ok(picture)
            }
        }
    }

    fn advance(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<bool, FieldError> {
        if self.shown != Shown::Depths && !self.advance_splats(progress)? {
            return Ok(false);
        }
        let has_splats = self.shown == Shown::Gaussians && self.splats(progress)?.is_some();
        if has_splats { Ok(true) } else { self.depths.views.advance(request, progress) }
    }

    fn draw(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Drawing<'a>, FieldError> {
        if self.shown == Shown::Gaussians
            && let Some(splats) = self.splats(progress)?
        {
            return Ok(Box::new(splats.draw(&self.depths.images, request)?));
        }
        if self.shown == Shown::Depths && !self.depths.images.has_silhouettes {
            return self.depths.views.draw(request, progress);
        }
        let rendered = self.render(request, progress)?;
        Ok(Box::new(move || Ok(rendered)))
    }

    fn record(&self) -> Record {
        self.depths.views.record()
    }

    fn is_weighted(&self) -> bool {
        true
    }

    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        (self.splats, self.optimisation, self.last) = (Vec::new(), None, None);
        self.depths.weigh(relevance)
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        let Some(TrainingFree { hull, sweep, recipe, shown, .. }) = options.of() else { return Ok(()) };
        (self.recipe, self.shown) = (*recipe, *shown);
        self.optimisation.take_if(|(of, _)| of != recipe);
        if *hull != self.hull {
            (self.hull, self.last) = (*hull, None);
        }
        self.depths.set(hull, sweep)
    }

    /// Those of the sweep or of the hull: less than the exact one is measured against pictures without Gaussians.
    fn efforts(&self, options: &AnyOptions, _pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        let Some(options) = options.of::<TrainingFree>() else { return Vec::new() };
        let images = &self.depths.images;
        let side = images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let reduced = TrainingFree { shown: Shown::Depths, ..options.clone() };
        let mut efforts: Vec<Variant<TrainingFree>> = match images.has_silhouettes {
            true => options
                .hull
                .efforts(side)
                .into_iter()
                .map(|effort| effort.map(|hull| reduced.with_hull(hull)))
                .collect(),
            false => {
                options.sweep.efforts(side).into_iter().map(|effort| effort.map(|sweep| reduced.with(sweep))).collect()
            }
        };
        if let Some(exact) = efforts.last_mut() {
            exact.options = options.clone();
        }
        erased(efforts)
    }

    fn reduced(&self, options: &AnyOptions, purpose: Purpose) -> AnyOptions {
        let Some(whole) = options.of::<TrainingFree>() else { return options.clone() };
        let recipe = whole.recipe.reduced(purpose);
        AnyOptions::new(TrainingFree { recipe, ..whole.with(whole.sweep.reduced(purpose)) })
    }

    fn candidates(&self, chosen: &AnyOptions, step: usize) -> Vec<AnyOptions> {
        match chosen.of::<TrainingFree>() {
            Some(chosen) if !self.depths.images.has_silhouettes => {
                let candidates = chosen.sweep.candidates(step).into_iter();
                candidates.map(|sweep| AnyOptions::new(chosen.with(sweep))).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The pictures of the sweep and that of the Gaussians, whose errors are the least like the others'; of an object,
    /// by each recipe, the hull's one picture, filled or carved as well, and that of the Gaussians, or the latter
    /// alone.
    fn mixtures(&self, chosen: &AnyOptions) -> Vec<Variant<Vec<AnyOptions>>> {
        let Some(chosen) = chosen.of::<TrainingFree>() else { return Vec::new() };
        let has_silhouettes = self.depths.images.has_silhouettes;
        let by_recipe = |Variant { label, options: recipe, .. }: Variant<Recipe>| {
            let showing = |shown: Shown| AnyOptions::new(TrainingFree { shown, recipe, ..chosen.clone() });
            let mixture = |with: &str, mut parts: Vec<AnyOptions>| {
                parts.push(showing(Shown::Gaussians));
                Variant::to_measure(format!("{label}{with}"), parts)
            };
            if has_silhouettes {
                let hull = |shown: Shown| vec![showing(shown)];
                return vec![
                    mixture(" alone", Vec::new()),
                    mixture(", the hull filled by them", hull(Shown::Filled)),
                    mixture(", the hull filled and carved by them", hull(Shown::Carved)),
                ];
            }
            let sweeps = chosen.sweep.parts().map(|(sweep, stated)| AnyOptions::stated(chosen.with(sweep), stated));
            vec![mixture(", three depths of the sweep", sweeps.to_vec())]
        };
        chosen.recipe.mixed_with(&self.depths.images).into_iter().flat_map(by_recipe).collect()
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(&self.depths)
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
        // Carved: nothing there, a quarter there, half there, and more than the other.
        let mut whole = picture(vec![black(1.0), black(1.0), black(1.0), black(0.125)]);
        carve(&mut whole, &picture(vec![red(0.0), red(0.25), red(0.5), red(0.25)]), [1.0; 3]);
        assert_eq!(whole.colours, [black(0.0), black(0.25), black(1.0), black(0.125)]);
    }
}
