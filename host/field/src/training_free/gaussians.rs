//! The field of Gaussians alone: a scene of its own, from the depths of the sweep or of the hull.

use super::hull::Hull;
use super::sweep::Sweep;
use super::with_gaussians::WithGaussians;
use crate::gaussians::{MAX_COUNT, MAX_ITERATIONS, Recipe};
use crate::options::{FieldOptions, Flag, FlagAbout, OpenError, count, flags};
use crate::row::{Origin, Row};
use crate::{About, AnyField, Effort, Field, FieldError, Prepared};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

/// The error and the share of the optimisation's time that are typical of its first iterations: those at a quarter of the finest
/// level's size, those at a half too, and half of those at the finest level too (`host/research/results/gaussians.md`).
const EFFORTS: [(f32, f32); 3] = [(0.09, 0.31), (0.045, 0.56), (0.012, 0.75)];

/// An effort, and how many iterations it ends after.
pub(super) struct Stop {
    pub(super) effort: Effort,
    pub(super) iteration: u32,
}

/// The efforts of this recipe for sources of this longest side, the exact one last: each goes on from where the one before ended.
/// Those that would end with another one, as where there are few iterations, are left out.
pub(super) fn stops(recipe: &Recipe, source_side: u32) -> Vec<Stop> {
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
        let depths: Box<dyn Prepared + 'a> = match sources.has_silhouettes {
            true => Box::new(self.hull.views(device, sources, progress)?),
            false => self.sweep.prepare_kept(device, sources, None, progress)?,
        };
        Ok(Box::new(WithGaussians::new(device, depths, sources, self.recipe, true)))
    }
}
