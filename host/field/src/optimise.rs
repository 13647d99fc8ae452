//! A scene's photographs to Gaussians: which views are sources, the surfaces that the Gaussians begin with, scores of
//! views that are held out on the way.
//!
//! ```text
//! trial   which recipe and how many iterations: those that held-out sources prefer
//! clock   how long the iterations take, and how many fit into a time
//! ```

mod clock;
mod trial;

use crate::AnyField;
use crate::gaussians::{GivenGaussians, Optimisation, Quality, Recipe, RecipeOptions, behind, optimisation};
use crate::point_cloud::{CloudPoint, point_cloud};
use crate::render::{RenderError, RenderOptions, Stage, open_album};
use crate::scores::psnr_of_seen;
use clock::Clock;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use std::time::Duration;
use viewfuse_device::choice::AnyDevice;
use viewfuse_job::files::WriteError;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, SelectionError, SelectionFault, Target, target_of, view_list};
use viewfuse_scene::gaussians::{GaussianFile, GaussianScene};
use viewfuse_scene::photographs::{Album, GroundTruth, SourceImages};
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

/// Fewest iterations between two scores, and between two of what is kept on the way; there are at most
/// [`MAX_SCORES`] of them.
const SCORED: u32 = 40;
/// Most scores, nearly.
const MAX_SCORES: u32 = 20;
/// Sources that are scored where no view is held out.
const FIT_SOURCES: usize = 3;
/// What is said where nothing can be scored.
const NOTHING_COUNTS: &str =
    "of the photographs that are held out nothing counts: their masks or alpha channels hide all";
/// Iterations with the weights of [`SceneOptimisation::towards`].
pub const TOWARDS: u32 = 60;

/// Why a scene has no Gaussians.
#[derive(Debug, thiserror::Error)]
pub enum OptimiseError {
    /// The photographs, the surfaces or a step.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// There is too little to begin with.
    #[error("{scene}: too few views agree on any surface to begin Gaussians with")]
    Few {
        /// The scene's path.
        scene: String,
    },
    /// What is there so far could not be kept.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Hinted for OptimiseError {
    fn hint(&self) -> Option<Hint> {
        match self {
            OptimiseError::Render(error) => error.hint(),
            OptimiseError::Few { .. } | OptimiseError::Write(_) => None,
        }
    }
}

/// An optimisation and what it is of.
#[derive(Clone)]
pub struct SceneOptimisation<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its views that are sources.
    pub sources: Vec<usize>,
    /// Photographs that are held out, and scored on the way.
    pub held_out: Vec<usize>,
    /// Views that it ends with the weights of: [`TOWARDS`] iterations more.
    pub towards: Vec<Target>,
    /// How photographs are read and scored.
    pub options: RenderOptions,
    /// The weighting of the surfaces, and for `towards`.
    pub weighting: Weighting,
    /// The quality, the iterations and the number of Gaussians.
    pub recipe: RecipeOptions,
    /// The time that it may take, if there is a limit: it has as many iterations as fit, beyond [`Quality::Fast`].
    pub max_time: Option<Duration>,
    /// The Gaussians that it goes on from, with the iterations of the finest size.
    pub before: Option<GaussianFile>,
}

/// What an optimisation ends with.
#[derive(Clone, Debug)]
pub struct EndedOptimisation {
    /// The Gaussians, in world coordinates.
    pub gaussians: GaussianScene,
    /// What lies behind them.
    pub background: [f32; 3],
    /// Iterations that are done; fewer than all if it was cancelled.
    pub done: u32,
    /// All iterations.
    pub of: u32,
    /// Iteration and mean PSNR of the views that are held out.
    pub scores: Vec<(u32, f64)>,
    /// Mean PSNR of the first sources, and how many they are, where no view is held out.
    pub fit: Option<(f64, usize)>,
}

/// What an optimisation has its photographs from, and what its pictures are compared with.
struct Photographed<'a> {
    device: &'a AnyDevice,
    album: &'a Album<'a>,
    /// The sources.
    images: Arc<SourceImages>,
    /// Photographs of the pictures' size, from when they were first compared; by their views.
    truths: RefCell<BTreeMap<usize, GroundTruth>>,
}

impl<'a> Photographed<'a> {
    fn new(device: &'a AnyDevice, album: &'a Album<'a>, images: &Arc<SourceImages>) -> Photographed<'a> {
        Photographed { device, album, images: images.clone(), truths: RefCell::default() }
    }
}

impl<'a> SceneOptimisation<'a> {
    /// Of a scene, with the default options. `held_out` and `towards` are lists of views; neither is a source.
    ///
    /// # Errors
    /// [`SelectionError`].
    pub fn new(
        scene: &'a Scene,
        selection: &Selection,
        held_out: Option<&str>,
        towards: Option<&str>,
    ) -> Result<SceneOptimisation<'a>, SelectionError> {
        let least_sources = AnyField::default().about().least_sources;
        let views = |list: Option<&str>| list.map_or(Ok(Vec::new()), |list| view_list(scene, list));
        let photographs = |views: &[usize]| -> Vec<usize> {
            views.iter().copied().filter(|view| scene.views[*view].image.is_some()).collect()
        };
        let held_out_views = photographs(&views(held_out)?);
        if let Some(list) = held_out.filter(|_| held_out_views.is_empty()) {
            return Err(SelectionFault::NothingHeldOut(list.to_owned()).in_scene(scene));
        }
        let towards_views = views(towards)?;
        if let Some(list) = towards.filter(|_| towards_views.is_empty()) {
            return Err(SelectionFault::NothingHeldOut(list.to_owned()).in_scene(scene));
        }
        let excluded = [held_out_views.clone(), photographs(&towards_views)].concat();
        Ok(SceneOptimisation {
            scene,
            sources: selection.sources_without(scene, &excluded, least_sources)?,
            held_out: held_out_views,
            towards: towards_views.into_iter().map(|view| target_of(scene, view)).collect(),
            options: RenderOptions::default(),
            weighting: Weighting::default_scheme(),
            recipe: RecipeOptions::default(),
            max_time: None,
            before: None,
        })
    }

    /// All iterations; once it is cancelled, as many as there are so far. `keep` gets the Gaussians on the way, every
    /// so many iterations. Beyond [`Quality::Fast`], some of the sources are first held out of trials, which choose the
    /// recipe and its iterations; then all of them are used.
    ///
    /// # Errors
    /// [`OptimiseError`].
    pub fn run(
        &self,
        device: &AnyDevice,
        progress: &dyn Progress,
        mut keep: impl FnMut(&GaussianScene) -> Result<(), WriteError>,
    ) -> Result<EndedOptimisation, OptimiseError> {
        let mut clock = Clock::start(self.max_time);
        let field = AnyField::default();
        let renderer = field.on(device);
        let is_sharp = self.recipe.quality != Quality::Fast;
        // A trial has a tenth of the time, and sharp recipes nearly all of the rest.
        let (reading, surfaces, trial, iterations) =
            if is_sharp { (0..1, 1..2, 2..5, 5..30) } else { (0..3, 3..9, 9..9, 9..30) };
        progress.stage("reading the photographs", reading, 30);
        let shown = self.sources.iter().chain(&self.held_out).copied();
        let album = open_album(self.scene, shown, renderer.as_ref(), &self.options, progress)?;
        let mut stage = Stage::prepare(self.scene, &album, &self.sources, renderer.as_ref(), &self.options, progress)?;
        progress.stage("finding surfaces", surfaces, 30);
        let points = point_cloud(&mut stage, &self.weighting, Recipe::cloud(self.sources.len()), &Silent)?;
        let mut recipe = self.recipe.recipe(stage.images.has_silhouettes);
        recipe.is_antialiased |= self.before.as_ref().is_some_and(|before| before.scene.is_antialiased);
        if is_sharp && self.before.is_none() {
            progress.stage("trying recipes on held-out sources", trial, 30);
            recipe = self.tried(device, &album, &stage.images, &mut clock, progress)?;
        }
        let photographed = &Photographed::new(device, &album, &stage.images);
        let mut optimisation = self.begin(device, &stage.images, &points, recipe)?;
        if let Some(before) = &self.before {
            // What is said of given Gaussians: their notes, and whether they show what the photographs show.
            self.given(&before.scene, &before.notes, photographed, progress, |_| Ok(()))?;
            if !self.held_out.is_empty() {
                progress
                    .note("held-out views may have been sources of the Gaussians to go on from: that raises scores");
            }
            if before.scene.degree > recipe.degree {
                progress.warn(
                    "the colours to go on from depend on the direction; this quality or file has one for all \
                    directions",
                );
            }
            optimisation.resume(&before.scene);
        }
        progress.stage("optimising", iterations, 30);
        let more = if self.towards.is_empty() { 0 } else { TOWARDS };
        progress.expect((optimisation.iteration_count() + more - optimisation.done()) as usize);
        let mut scores = Vec::new();
        let is_timed = is_sharp && recipe.grows;
        let timed = is_timed.then_some(&mut clock);
        self.advance(&mut optimisation, photographed, progress, timed, &mut keep, &mut scores)?;
        if more > 0 && !progress.is_cancelled() {
            optimisation.extend(more);
            optimisation.weigh(&self.weights()?);
            self.advance(&mut optimisation, photographed, progress, None, &mut keep, &mut scores)?;
        }
        let gaussians = optimisation.optimised().map_err(RenderError::from)?.scene();
        let sources = &self.sources[..self.sources.len().min(FIT_SOURCES)];
        let is_alone = self.held_out.is_empty() && !progress.is_cancelled();
        let fit = is_alone.then(|| self.score(&gaussians, photographed, sources)).transpose()?;
        Ok(EndedOptimisation {
            gaussians,
            background: behind(&stage.images),
            done: optimisation.done(),
            of: optimisation.iteration_count(),
            scores,
            fit: fit.map(|psnr| (psnr, sources.len())),
        })
    }

    /// An optimisation at its beginning.
    fn begin<'d>(
        &self,
        device: &'d AnyDevice,
        images: &SourceImages,
        points: &[CloudPoint],
        recipe: Recipe,
    ) -> Result<Optimisation<'d>, OptimiseError> {
        let begun = match device {
            AnyDevice::Cpu(device) => optimisation(device, images, points, recipe),
            AnyDevice::Vulkan(device) => optimisation(device.as_ref(), images, points, recipe),
        };
        let too_few = || OptimiseError::Few { scene: self.scene.path.display().to_string() };
        begun.map_err(RenderError::from)?.ok_or_else(too_few)
    }

    /// All iterations, with scores and what is kept on the way; fewer if it is cancelled. With a clock, the time is
    /// told that they will take, and they are as many as fit.
    fn advance(
        &self,
        optimisation: &mut Optimisation<'_>,
        photographed: &Photographed<'_>,
        progress: &dyn Progress,
        mut clock: Option<&mut Clock>,
        keep: &mut dyn FnMut(&GaussianScene) -> Result<(), WriteError>,
        scores: &mut Vec<(u32, f64)>,
    ) -> Result<(), OptimiseError> {
        let mut every = scored_every(optimisation.iteration_count());
        while optimisation.done() < optimisation.iteration_count() && !progress.is_cancelled() {
            optimisation.run_to(optimisation.done() + 1, &Silent).map_err(RenderError::from)?;
            progress.step();
            if let Some(clock) = &mut clock
                && clock.has_measured(optimisation, progress).map_err(RenderError::from)?
            {
                every = scored_every(optimisation.iteration_count());
            }
            let (done, iteration_count) = (optimisation.done(), optimisation.iteration_count());
            if !done.is_multiple_of(every) && done != iteration_count {
                continue;
            }
            let gaussians = optimisation.optimised().map_err(RenderError::from)?.scene();
            if done < iteration_count {
                keep(&gaussians)?;
            }
            if !self.held_out.is_empty() {
                let psnr = self.score(&gaussians, photographed, &self.held_out)?;
                progress.note(&format!(
                    "iteration {done} of {iteration_count}: held-out views have a PSNR of {psnr:.2} dB"
                ));
                scores.push((done, psnr));
            }
            if let Some(clock) = &mut clock {
                clock.go_on(optimisation);
            }
        }
        Ok(())
    }

    /// The sources' weights for the views of `towards`: their sum over these.
    fn weights(&self) -> Result<Vec<f32>, RenderError> {
        let unit = RigUnit::of_scene(self.scene);
        let poses: Vec<_> = self.sources.iter().map(|view| unit.pose(&self.scene.views[*view].camera.pose)).collect();
        let sources = SourcePoses::new(&poses).map_err(RenderError::Sources)?;
        let mut sums = vec![0.0; poses.len()];
        for target in &self.towards {
            let weights = self.weighting.weigh(&sources, &unit.pose(&target.camera.pose));
            sums.iter_mut().zip(weights.values()).for_each(|(sum, weight)| *sum += weight);
        }
        Ok(sums)
    }

    /// Mean PSNR of these views, but of those whose photographs show nothing that counts.
    fn score(
        &self,
        gaussians: &GaussianScene,
        photographed: &Photographed<'_>,
        views: &[usize],
    ) -> Result<f64, RenderError> {
        self.given(gaussians, &[], photographed, &Silent, |stage| {
            let (mut truths, mut sum, mut count) = (photographed.truths.borrow_mut(), 0.0, 0.0);
            for view in views {
                let target = Target { truth: None, ..target_of(self.scene, *view) };
                let picture = stage.frame(&self.weighting, &target, &Silent)?.picture;
                let truth = match truths.entry(*view) {
                    Entry::Occupied(known) => known.into_mut(),
                    Entry::Vacant(place) => {
                        let size = picture.dimensions().into();
                        place.insert(photographed.album.truth(*view, size, stage.background())?)
                    }
                };
                let psnr = psnr_of_seen(&picture, &truth.picture, truth.seen.as_ref());
                // Of some photographs nothing counts.
                if !psnr.is_nan() {
                    (sum, count) = (sum + psnr, count + 1.0);
                }
            }
            if count == 0.0 {
                return Err(RenderError::Unsuitable {
                    scene: self.scene.path.display().to_string(),
                    reason: NOTHING_COUNTS.into(),
                });
            }
            Ok(sum / count)
        })
    }

    /// What pictures of these Gaussians are for.
    fn given<T>(
        &self,
        gaussians: &GaussianScene,
        notes: &[String],
        Photographed { device, album, images, .. }: &Photographed<'_>,
        progress: &dyn Progress,
        work: impl FnOnce(&mut Stage<'_>) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        let unit = (1.0 / self.scene.frame.scale) as f32;
        let given = AnyField::new(GivenGaussians { scene: gaussians.clone(), notes: notes.to_vec(), unit });
        let (renderer, images) = (given.on(device), images.clone());
        let (scene, sources, options) = (self.scene, &self.sources, &self.options);
        work(&mut Stage::of_images(scene, album, sources, images, renderer.as_ref(), options, progress)?)
    }
}

/// Iterations between two scores of so many.
fn scored_every(iterations: u32) -> u32 {
    (iterations / MAX_SCORES).next_multiple_of(SCORED).max(SCORED)
}
