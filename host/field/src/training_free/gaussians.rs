//! The field of Gaussians alone: a scene of its own, from the depths of the sweep or of the hull.
//!
//! The Gaussians are optimised for the sources when a picture first needs them, once for a weighting. Efforts are the
//! first iterations of the same optimisation, which a dearer effort goes on from.

use super::hull::Hull;
use super::splats::{SourceDepths, Splats, TRIAL_DIVISOR};
use super::sweep::Sweep;
use crate::gaussians::{MAX_COUNT, MAX_ITERATIONS, Optimisation, Recipe};
use crate::options::{FieldOptions, Flag, FlagAbout, OpenError, count, flags};
use crate::row::{Origin, Row};
use crate::{
    About, AnyField, Effort, Efforts, Encoding, Encodings, Field, FieldError, Geometry, Prepared, Record, Rendered,
    Request, Weighted,
};
use std::collections::BTreeMap;
use viewfuse_device::Device;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::photographs::{SourceImages, longest_side};
use viewfuse_weighting::sources::SourceWeights;

/// The error and the share of the optimisation's time that are typical of its first iterations: those at a quarter of
/// the finest level's size, those at a half too, and half of those at the finest level too
/// (`host/results/gaussians.md`).
const EFFORTS: [(f32, f32); 3] = [(0.09, 0.31), (0.045, 0.56), (0.012, 0.75)];

/// Pictures of Gaussians that are optimised for the sources. Nothing is learned but the scene itself.
#[derive(Clone, Debug, Default)]
pub struct Gaussians {
    /// The depths of sources with silhouettes, which the Gaussians begin with.
    pub hull: Hull,
    /// The depths of other sources.
    pub sweep: Sweep,
    /// The optimisation.
    pub recipe: Recipe,
}

/// The row of the Gaussians.
pub(crate) const ROW: Row = Row {
    name: "gaussians",
    title: "field of Gaussians",
    heading: "Options of the field of Gaussians",
    origin: Origin::TrainingFree { open },
    flags: Given::FLAGS,
    omissions: &[],
    presets: |_, _, _| Vec::new(),
};

flags! {
    iterations: u32 = "gaussian-iterations", "N", parse_iterations, Picture, &[], "Iterations at each size of the sources";
    count: u32 = "gaussian-count", "N", parse_count, Picture, &[], "Most Gaussians";
}

fn parse_iterations(text: &str) -> Result<u32, String> {
    count(text, 1..=MAX_ITERATIONS)
}

fn parse_count(text: &str) -> Result<u32, String> {
    count(text, 1..=MAX_COUNT)
}

fn open(options: &FieldOptions) -> Result<AnyField, OpenError> {
    let given = Given::of(options);
    let recipe = Recipe { seed: options.seed, ..Recipe::default() }.with(given.iterations, given.count);
    Ok(AnyField::new(Gaussians { recipe, ..Gaussians::default() }))
}

impl Field for Gaussians {
    /// Sources at the size of the pictures.
    fn about(&self) -> About {
        About { least_sources: 2, ..About::new(ROW.name) }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        let depths = SourceDepths::prepare(device, (&self.hull, &self.sweep), None, sources, progress)?;
        let source_side = sources.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let stops = stops(&self.recipe, source_side);
        Ok(Box::new(Alone {
            depths,
            recipe: self.recipe,
            effort: stops.len() - 1,
            stops,
            splats: BTreeMap::new(),
            optimisation: None,
        }))
    }
}

/// An effort, and how many iterations it ends after.
struct Stop {
    effort: Effort,
    iteration: u32,
}

/// The efforts of this recipe for sources of this longest side, the exact one last: each goes on from where the one
/// before ended. Those that would end with another one, as where there are few iterations, are not in the list.
fn stops(recipe: &Recipe, source_side: u32) -> Vec<Stop> {
    let [eighth, quarter, half, whole] = recipe.iterations;
    let side = recipe.side.min(source_side);
    let ends = [
        (eighth + quarter, side / 4),
        (eighth + quarter + half, side / 2),
        (eighth + quarter + half + whole / 2, side),
    ];
    let all = recipe.iterations.iter().sum();
    let mut stops: Vec<Stop> = Vec::new();
    for ((iteration, side), (error, share)) in ends.into_iter().zip(EFFORTS) {
        let before = stops.last().map_or(0, |stop| stop.iteration);
        if iteration > before && iteration < all {
            let name = format!("{iteration} iterations, sources at {side} pixels at last");
            stops.push(Stop { effort: Effort::new(name, error, share), iteration });
        }
    }
    stops.push(Stop { effort: Effort::exact(), iteration: all });
    stops
}

/// The Gaussians of the sources.
struct Alone<'a, D: Device> {
    depths: SourceDepths<'a, D>,
    recipe: Recipe,
    /// The efforts, the exact one last...
    stops: Vec<Stop>,
    /// ... and the current one.
    effort: usize,
    /// The Gaussians of the current weighting by their effort, once they are needed; none where the sources have too
    /// few surfaces.
    splats: BTreeMap<usize, Option<Splats<D>>>,
    /// The optimisation for the current weighting, as far as it went, where a dearer effort may go on from there.
    optimisation: Option<Box<dyn Optimisation + 'a>>,
}

impl<D: Device> Alone<'_, D> {
    /// The Gaussians of the current effort, optimised if they are not there yet; `None` where the sources have too few
    /// surfaces.
    fn splats(&mut self, progress: &dyn Progress) -> Result<Option<&mut Splats<D>>, FieldError> {
        if !self.splats.contains_key(&self.effort) {
            let end = self.stops[self.effort].iteration;
            let begun = match self.optimisation.take().filter(|optimisation| optimisation.done() <= end) {
                Some(optimisation) => Some(optimisation),
                None => self.depths.optimisation(self.recipe, progress)?,
            };
            let splats = match begun {
                Some(mut optimisation) => {
                    let ran = optimisation.run_to(end, &Quiet(progress));
                    let optimised = optimisation.optimised();
                    if self.effort + 1 < self.stops.len() {
                        self.optimisation = Some(optimisation);
                    }
                    ran?;
                    Some(Splats::upload(self.depths.device, optimised)?)
                }
                None => None,
            };
            self.splats.insert(self.effort, splats);
        }
        Ok(self.splats.get_mut(&self.effort).and_then(Option::as_mut))
    }

    /// Drops the Gaussians, finished and unfinished.
    fn drop_splats(&mut self) {
        self.splats.clear();
        self.optimisation = None;
    }
}

impl<D: Device> Prepared for Alone<'_, D> {
    fn encoding(&self) -> Encoding {
        Encoding::All
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.depths.encode(view, progress)
    }

    /// Of sources with too few surfaces, the picture of the sweep or the hull.
    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let (device, images) = (self.depths.device, self.depths.images.clone());
        match self.splats(progress)? {
            Some(splats) => splats.picture(device, &images, request),
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
        Some(self)
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(&self.depths)
    }
}

impl<D: Device> Weighted for Alone<'_, D> {
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.drop_splats();
        self.depths.weigh(relevance)
    }
}

impl<D: Device> Efforts for Alone<'_, D> {
    fn list(&self) -> Vec<Effort> {
        self.stops.iter().map(|stop| stop.effort.clone()).collect()
    }

    /// The surfaces that the Gaussians begin with are the same.
    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError> {
        self.effort = effort;
        Ok(Encodings::Kept)
    }

    fn goes_on(&self) -> bool {
        true
    }

    fn set_trial(&mut self) {
        self.recipe.iterations = self.recipe.iterations.map(|count| count / TRIAL_DIVISOR);
        self.stops.iter_mut().for_each(|stop| stop.iteration /= TRIAL_DIVISOR);
        self.drop_splats();
        if let Some(efforts) = self.depths.views.efforts() {
            efforts.set_trial();
        }
    }
}
