//! The field of Gaussians alone: a scene of its own, from the depths of the sweep or of the hull.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, once for a weighting. Efforts are the
//! first iterations of the same optimisation, which a dearer effort goes on from.

use super::hull::Hull;
use super::splats::{SourceDepths, Splats};
use super::sweep::Sweep;
use crate::gaussians::{MAX_COUNT, MAX_ITERATIONS, Optimisation, Recipe};
use crate::options::{Given, OpenError, count, flags};
use crate::row::{Origin, Row};
use crate::variant::erased;
use crate::{
    About, AnyField, AnyOptions, Encoding, Field, FieldError, Geometry, Options, Prepared, Purpose, Record, Rendered,
    Request, Variant,
};
use std::collections::BTreeMap;
use std::rc::Rc;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::photographs::{SourceImages, longest_side};
use viewfuse_weighting::sources::SourceWeights;

/// The error and the share of the optimisation's time that are typical of its first iterations: those at a quarter of
/// the finest level's size, those at a half too, and half of those at the finest level too
/// (`host/results/gaussians.md`).
const EFFORTS: [(f32, f32); 3] = [(0.09, 0.31), (0.045, 0.56), (0.012, 0.75)];

/// Pictures of Gaussians that are optimised for the sources. Nothing is learned but the scene itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussians {
    /// The depths of sources with silhouettes, which the Gaussians begin with.
    pub hull: Hull,
    /// The depths of other sources.
    pub sweep: Sweep,
    /// The optimisation.
    pub recipe: Recipe,
    /// The optimisation ends after so many iterations, if the recipe has more.
    pub end: u32,
}

impl Default for Gaussians {
    /// All iterations of the default recipe.
    fn default() -> Gaussians {
        Gaussians { hull: Hull::default(), sweep: Sweep::default(), recipe: Recipe::default(), end: u32::MAX }
    }
}

impl Options for Gaussians {
    /// Where the surfaces that the Gaussians begin with are the same.
    fn encodes_alike(&self, other: &Gaussians) -> bool {
        self.hull.encodes_alike(&other.hull) && self.sweep.encodes_alike(&other.sweep)
    }
}

impl Gaussians {
    /// The efforts for sources of this longest side, the exact one last: each goes on from where the one before ended.
    /// Those that would end with another one, as where there are few iterations, are not in the list.
    fn efforts(&self, source_side: u32) -> Vec<Variant<Gaussians>> {
        let Recipe { iterations: [eighth, quarter, half, whole], side, .. } = self.recipe;
        let side = side.min(source_side);
        let ends = [
            (eighth + quarter, side / 4),
            (eighth + quarter + half, side / 2),
            (eighth + quarter + half + whole / 2, side),
        ];
        let mut efforts: Vec<Variant<Gaussians>> = Vec::new();
        for ((end, side), (error, share)) in ends.into_iter().zip(EFFORTS) {
            let before = efforts.last().map_or(0, |effort| effort.options.end);
            if end > before && end < self.recipe.all_iterations() {
                let label = format!("{end} iterations, sources at {side} pixels at last");
                efforts.push(Variant::new(label, Gaussians { end, ..*self }, error, share));
            }
        }
        efforts.push(Variant::exact(*self));
        efforts
    }
}

/// The row of the Gaussians.
pub(crate) const ROW: Row = Row {
    name: "gaussians",
    title: "field of Gaussians",
    heading: "Options of the field of Gaussians",
    origin: Origin::TrainingFree { open },
    flags: FLAGS,
    omissions: &[],
    drawn: |_, _, _, _| Vec::new(),
};

flags! {
    Recipe;
    "gaussian-iterations", "N", parse_iterations, Picture, &[],
        "Iterations at each size of the sources",
        |recipe, iterations| *recipe = recipe.with(Some(iterations), None);
    "gaussian-count", "N", parse_count, Picture, &[], "Most Gaussians", |recipe, count| *recipe = recipe.with(None,
    Some(count));
}

fn parse_iterations(text: &str) -> Result<u32, String> {
    count(text, 1..=MAX_ITERATIONS)
}

fn parse_count(text: &str) -> Result<u32, String> {
    count(text, 1..=MAX_COUNT)
}

fn open(given: &Given) -> Result<AnyField, OpenError> {
    let recipe = taken(given, Recipe { seed: given.seed, ..Recipe::default() });
    Ok(AnyField::new(Gaussians { recipe, ..Gaussians::default() }))
}

impl Field for Gaussians {
    /// Sources at the size of the pictures.
    fn about(&self) -> About {
        About { least_sources: 2, draws_all: true, ..About::new(ROW.name) }
    }

    fn options(&self) -> AnyOptions {
        AnyOptions::new(*self)
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        let depths = SourceDepths::prepare(device, (&self.hull, &self.sweep), None, sources, progress)?;
        Ok(Box::new(Alone { depths, options: *self, splats: BTreeMap::new(), optimisation: None }))
    }
}

/// The Gaussians of the sources.
struct Alone<'a, D: Device> {
    depths: SourceDepths<'a, D>,
    options: Gaussians,
    /// The Gaussians of the current weighting and recipe by their last iteration, once they are needed; none where the
    /// sources have too few surfaces.
    splats: BTreeMap<u32, Option<Rc<Splats<'a, D>>>>,
    /// The optimisation for the current weighting, as far as it went, where a dearer effort may go on from there.
    optimisation: Option<Optimisation<'a>>,
}

impl<'a, D: Device> Alone<'a, D> {
    /// The Gaussians of the current options, optimised if they are not there yet; `None` where the sources have too few
    /// surfaces.
    fn splats(&mut self, progress: &dyn Progress) -> Result<Option<Rc<Splats<'a, D>>>, FieldError> {
        let Gaussians { recipe, end, .. } = self.options;
        if !self.splats.contains_key(&end) {
            let begun = match self.optimisation.take().filter(|optimisation| optimisation.done() <= end) {
                Some(optimisation) => Some(optimisation),
                None => self.depths.optimisation(recipe, progress)?,
            };
            let splats = match begun {
                Some(mut optimisation) => {
                    let ran = optimisation.run_to(end, &Quiet(progress));
                    let optimised = optimisation.optimised()?;
                    if end < recipe.all_iterations() {
                        self.optimisation = Some(optimisation);
                    }
                    ran?;
                    Some(Rc::new(Splats::upload(self.depths.device, optimised, &recipe)?))
                }
                None => None,
            };
            self.splats.insert(end, splats);
        }
        Ok(self.splats.get(&end).cloned().flatten())
    }

    /// Drops the Gaussians, finished and unfinished.
    fn drop_splats(&mut self) {
        self.splats.clear();
        self.optimisation = None;
    }
}

impl<'a, D: Device> Prepared<'a> for Alone<'a, D> {
    fn encoding(&self) -> Encoding {
        Encoding::All
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.depths.encode(view, progress)
    }

    /// Of sources with too few surfaces, the picture of the sweep or the hull.
    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        match self.splats(progress)? {
            Some(splats) => splats.draw(&self.depths.images, request)?(),
            None => self.depths.views.render(request, progress),
        }
    }

    fn record(&self) -> Record {
        self.depths.views.record()
    }

    fn is_weighted(&self) -> bool {
        true
    }

    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.drop_splats();
        self.depths.weigh(relevance)
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        let Some(options) = options.of::<Gaussians>() else { return Ok(()) };
        if options.recipe != self.options.recipe {
            self.drop_splats();
        }
        self.options = *options;
        self.depths.set(&options.hull, &options.sweep)
    }

    fn efforts(&self, options: &AnyOptions, _pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        let side = self.depths.images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        erased(options.of::<Gaussians>().map_or_else(Vec::new, |options| options.efforts(side)))
    }

    fn reduced(&self, options: &AnyOptions, purpose: Purpose) -> AnyOptions {
        let Some(whole) = options.of::<Gaussians>() else { return options.clone() };
        let (sweep, recipe) = (whole.sweep.reduced(purpose), whole.recipe.reduced(purpose));
        AnyOptions::new(Gaussians { sweep, recipe, ..*whole })
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(&self.depths)
    }
}
