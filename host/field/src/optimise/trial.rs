//! Which recipe, and how many iterations: those that held-out sources prefer, tried at a small size.

use super::clock::{Clock, Pace, words};
use super::{OptimiseError, Photographed, SceneOptimisation};
use crate::AnyField;
use crate::gaussians::{Quality, Recipe, RecipeOptions};
use crate::point_cloud::point_cloud;
use crate::render::{RenderError, Stage};
use std::time::Instant;
use viewfuse_core::camera::Camera;
use viewfuse_device::choice::AnyDevice;
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_scene::photographs::{Album, SourceImages, longest_side};
use viewfuse_scene::rig::gap_warning;

/// Longest side of the sources in a trial, in pixels: that of the fast recipe.
const SIDE: u32 = 280;
/// Most iterations of the finest level in a trial; otherwise half of the recipe's.
const MAX_ITERATIONS: u32 = 1500;
/// One source in so many is held out, at least two and at most six.
const HELD_OUT_EVERY: usize = 8;
/// Fewest sources of a trial: of fewer, what is held out is far from the others.
const MIN_SOURCES: usize = 12;
/// Iterations of the fast recipe at each size where it is tried beside its own and a sharp one, or taken in its place:
/// some photographs want its Gaussians, but more iterations (`host/results/gaussian_quality.md`).
const LONG: u32 = 300;
/// Fewest whole photographs of which the fast recipe has these without a trial.
const MIN_LONG_SOURCES: usize = 5;
/// How many decibels less than the best score are as good: of such scores the last one ends the recipe, since pictures of
/// the whole size have more to learn (`host/results/gaussian_quality.md`).
const AS_GOOD: f64 = 0.05;
/// Share of its iterations before which a trial's last good score ends the recipe early: later ones hardly differ.
const EARLY: f32 = 0.8;
/// Least share of the iterations that is left: before it the number has hardly grown.
const LEAST: f32 = 0.1;

/// Places of the sources that are held out, evenly apart.
fn held_out(source_count: usize) -> Vec<usize> {
    let count = (source_count / HELD_OUT_EVERY).clamp(2, 6);
    (0..count).map(|index| (2 * index + 1) * source_count / (2 * count)).collect()
}

/// A recipe at the size of trials.
fn small(recipe: Recipe) -> Recipe {
    let [eighth, quarter, half, whole] = recipe.iterations;
    let whole = if recipe.grows { (whole / 2).min(MAX_ITERATIONS) } else { whole };
    Recipe { side: recipe.side.min(SIDE), iterations: [eighth, quarter, half, whole], ..recipe }
}

impl SceneOptimisation<'_> {
    /// The recipe for these sources, with fewer iterations where held-out ones are better after fewer, or the fast one,
    /// with its own or with [`LONG`] iterations, where they prefer that. Where the time is limited a trial ends after a
    /// share of it, the fast one has its own iterations, and it is taken, too, if what is left is less than the recipe took in the trial
    /// to become better. Fewer than [`MIN_SOURCES`] have the fast one without a trial; with [`LONG`] iterations if they
    /// are whole photographs, at least [`MIN_LONG_SOURCES`], and near enough to one another.
    pub(super) fn tried(
        &self,
        device: &AnyDevice,
        album: &Album<'_>,
        images: &SourceImages,
        clock: &mut Clock,
        progress: &dyn Progress,
    ) -> Result<Recipe, OptimiseError> {
        let (quality, count) = (self.recipe.quality, self.sources.len());
        let recipe = self.recipe.recipe(images.has_silhouettes);
        let fast = RecipeOptions { quality: Quality::Fast, ..self.recipe }.recipe(images.has_silhouettes);
        // A limited time is the sharp recipe's.
        let is_free = self.recipe.iterations.is_none() && self.max_time.is_none();
        let cameras: Vec<Camera> = images.images.iter().map(|image| image.camera).collect();
        let is_near = gap_warning(&cameras).is_none();
        // Where whole photographs are far from one another, more pixels fit the sources alone.
        let side = if is_near || images.has_silhouettes { recipe.side } else { fast.side };
        let long = if is_free { Recipe { side, ..fast.with(Some(LONG), None) } } else { fast };
        if count < MIN_SOURCES {
            let is_long = is_near && count >= MIN_LONG_SOURCES && !images.has_silhouettes;
            let chosen = if is_long { long } else { fast };
            let iterations = chosen.all_iterations();
            progress.note(&format!(
                "{count} photographs are too few for {quality}, from {MIN_SOURCES} on: fast, with {iterations} \
                    iterations"
            ));
            return Ok(chosen);
        }
        let shows = |place: &usize| images.images[*place].texels.iter().any(|texel| texel[3] > 0.0);
        let places: Vec<usize> = held_out(count).into_iter().filter(shows).collect();
        let (held_out, sources): (Vec<_>, Vec<_>) = (0..count).partition(|place| places.contains(place));
        let views =
            |places: Vec<usize>| -> Vec<usize> { places.into_iter().map(|place| self.sources[place]).collect() };
        let (held_out, sources) = (views(held_out), views(sources));
        let field = AnyField::default();
        let renderer = field.on(device);
        let mut stage = Stage::prepare(self.scene, album, &sources, renderer.as_ref(), &self.options, &Silent)?;
        let points = point_cloud(&mut stage, &self.weighting, Recipe::cloud(sources.len()), &Silent)?;
        let quick = if is_free { vec![fast, long] } else { vec![fast] };
        let recipes: Vec<Recipe> = quick.iter().chain([&recipe]).map(|recipe| small(*recipe)).collect();
        let trial = SceneOptimisation { sources, held_out, before: None, towards: Vec::new(), ..self.clone() };
        let longest = stage.images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        progress.expect(recipes.iter().map(|recipe| recipe.iterations.iter().sum::<u32>() as usize).sum());
        let photographed = &Photographed::new(device, album, &stage.images);
        let until = clock.end_of_trial();
        let (mut curves, mut begun) = (Vec::new(), Instant::now());
        for (index, &tried) in recipes.iter().enumerate() {
            begun = Instant::now();
            let mut optimisation = trial.begin(device, &stage.images, &points, tried)?;
            let mut scores = Vec::new();
            let counted = Counted { progress, until };
            trial.advance(&mut optimisation, photographed, &counted, None, &mut |_| Ok(()), &mut scores)?;
            progress.check().map_err(|error| OptimiseError::Render(crate::FieldError::from(error).into()))?;
            curves.push(scores);
            if index == 0 && self.max_time.is_none() {
                // What a finest iteration of the fast recipe takes, its scores included.
                let quick = begun.elapsed().as_secs_f64() / finest_iterations(&tried).max(1.0);
                let pace = |recipe: Recipe| -> Result<Pace, OptimiseError> {
                    let alone = Recipe { iterations: [0, 0, 0, MAX_ITERATIONS], ..small(recipe) };
                    let mut begun = trial.begin(device, &stage.images, &points, alone)?;
                    Ok(Pace::of(&mut begun).map_err(RenderError::from)?)
                };
                let more = Recipe { cell: 0.5 * recipe.cell, least_points: 1, ..recipe };
                let sharp = clock.mean(pace(recipe)?, pace(more)?);
                let seconds = |recipe: &Recipe| finest_iterations(recipe) * if recipe.grows { sharp } else { quick };
                progress.note(&format!(
                    "about {} more for a trial of recipes, then at most about {} for {quality}",
                    words(recipes[1..].iter().map(seconds).sum()),
                    words(seconds(&recipe) * pixels(longest, &recipe) / pixels(longest, &small(recipe)))
                ));
            }
        }
        let sharp = curves.pop().unwrap_or_default();
        // The fast recipe ends where it ends.
        let last = |scores: &Vec<(u32, f64)>| scores.last().map_or(f64::NEG_INFINITY, |score| score.1);
        let quick = quick.into_iter().zip(curves.iter().map(last));
        let (quick, quick_score) =
            quick.reduce(|best, next| if next.1 > best.1 { next } else { best }).unwrap_or((fast, f64::NEG_INFINITY));
        let (end, score) = last_good(&sharp);
        if score == f64::NEG_INFINITY {
            progress
                .note(&format!("the time is too short for a trial of {quality}: however long it takes, fast is used"));
            return Ok(fast);
        }
        let is_over = until.is_some_and(|until| until <= Instant::now());
        let ahead = sharp.iter().find(|(_, score)| *score > quick_score).map_or(0, |(iteration, _)| *iteration);
        let tried = sharp.last().map_or(1, |(iteration, _)| *iteration);
        let larger = pixels(longest, &recipe) / pixels(longest, &small(recipe));
        let least = begun.elapsed().mul_f64(larger * f64::from(ahead) / f64::from(tried));
        let (chosen, words) = if score <= quick_score {
            (quick, "fast is used".to_owned())
        } else if clock.left().is_some_and(|left| left < least) {
            (fast, format!("the time that is left is too short for {quality}, and fast is used"))
        } else if is_over {
            (recipe, format!("{quality} is used"))
        } else {
            let [.., finest] = small(recipe).iterations;
            let before = small(recipe).iterations.iter().sum::<u32>() - finest;
            let share = end.saturating_sub(before) as f32 / finest.max(1) as f32;
            let chosen = if share < EARLY { ended_early(recipe, share) } else { recipe };
            let [.., iterations] = chosen.iterations;
            (chosen, format!("{quality} is used, with {iterations} iterations at the whole size"))
        };
        let held_out_count = trial.held_out.len();
        progress.note(&format!(
            "{held_out_count} of {count} photographs held out of a trial have {quick_score:.2} dB with {} iterations \
                of fast and {score:.2} dB with {quality}: {words}",
            quick.all_iterations()
        ));
        Ok(chosen)
    }
}

/// Pixels of the finest level of a recipe, for sources of this longest side, up to a factor.
fn pixels(longest: u32, recipe: &Recipe) -> f64 {
    f64::from(longest.min(recipe.side)).powi(2)
}

/// How many iterations of a recipe's finest level cost as much as all of its iterations: a level has a quarter of the
/// next one's pixels.
fn finest_iterations(recipe: &Recipe) -> f64 {
    recipe.iterations.iter().fold(0.0, |sum, count| sum / 4.0 + f64::from(*count))
}

/// The iteration of the last score that is [`AS_GOOD`] as the best, and the best.
fn last_good(scores: &[(u32, f64)]) -> (u32, f64) {
    let best = scores.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max);
    let last = scores.iter().rfind(|(_, score)| *score >= best - AS_GOOD);
    (last.map_or(0, |(iteration, _)| *iteration), best)
}

/// With this share of the finest level's iterations, at least [`LEAST`].
fn ended_early(recipe: Recipe, share: f32) -> Recipe {
    let [eighth, quarter, half, whole] = recipe.iterations;
    Recipe { iterations: [eighth, quarter, half, ((whole as f32 * share.max(LEAST)) as u32).max(1)], ..recipe }
}

/// Steps and cancellation alone; the end of the time is one, too.
struct Counted<'a> {
    progress: &'a dyn Progress,
    until: Option<Instant>,
}

impl Progress for Counted<'_> {
    fn step(&self) {
        self.progress.step();
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled() || self.until.is_some_and(|until| until <= Instant::now())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_ends_with_the_last_of_its_best_scores() {
        let flat = [(120, 17.92), (480, 18.025), (600, 17.96), (1200, 18.004), (1320, 17.968), (1620, 17.952)];
        assert_eq!(last_good(&flat), (1200, 18.025));
        let falling = [(120, 20.3), (240, 20.2), (360, 20.0)];
        assert_eq!(last_good(&falling), (120, 20.3));
        assert_eq!(last_good(&[(40, f64::NAN)]), (0, f64::NEG_INFINITY), "a score that is none");
    }

    #[test]
    fn held_out_sources_are_apart_and_leave_most() {
        assert_eq!(held_out(12), [3, 9]);
        assert_eq!(held_out(43), [4, 12, 21, 30, 38]);
        for count in MIN_SOURCES..200 {
            let places = held_out(count);
            assert!(places.windows(2).all(|pair| pair[1] >= pair[0] + 4), "{count}: {places:?}");
            assert!(places.iter().all(|place| *place < count) && places.len() * 6 <= count.max(12));
        }
    }
}
