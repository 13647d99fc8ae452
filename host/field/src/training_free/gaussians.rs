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

/// Shares of the finest level's side, which the number of Gaussians follows, and of the iterations, with the error and the work
/// that are typical of them (`host/research/results/gaussians.md`).
const EFFORTS: [(f32, f32, f32, f32); 3] = [(0.25, 1.0, 0.1, 0.43), (0.5, 1.0, 0.06, 0.56), (1.0, 0.5, 0.037, 0.7)];

/// The efforts of this recipe for sources of this longest side.
pub(super) fn efforts(recipe: &Recipe, source_side: u32) -> Vec<Effort> {
    let named = |(index, (_, _, error, work)): (usize, (f32, f32, f32, f32))| {
        let Recipe { side, iterations, .. } = at_effort(recipe, index, source_side);
        let count: u32 = iterations.iter().sum();
        Effort::new(format!("{count} iterations, sources at {side} pixels at last"), error, work)
    };
    EFFORTS.into_iter().enumerate().map(named).chain([Effort::exact()]).collect()
}

/// The recipe at an effort.
pub(super) fn at_effort(recipe: &Recipe, effort: usize, source_side: u32) -> Recipe {
    match EFFORTS.get(effort) {
        Some(&(side, iterations, ..)) => recipe.reduced(side, iterations, source_side),
        None => *recipe,
    }
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
