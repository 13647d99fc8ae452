//! What an optimisation does next, wherever its steps are made: levels of the pyramid, growth, the order of the
//! sources, learning rates.

use super::given::{behind, scene_of};
use super::growth::{grow, growth_at};
use super::harmonics::Harmonics;
use super::level::{LevelView, level};
use super::particles::{Particle, refined};
use super::recipe::Recipe;
use super::start::{Extent, start};
use crate::FieldError;
use crate::point_cloud::CloudPoint;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_core::random::uniform;
use viewfuse_device::parallel::map;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::gaussians::steps::StepBlock;
use viewfuse_kernels::rows::{GainBlock, GaussianBlock, LossBlock};
use viewfuse_scene::gaussians::GaussianScene;
use viewfuse_scene::photographs::{SourceImages, longest_side};

/// Levels of the pyramid.
const LEVELS: usize = 4;
/// Share of the finest level's iterations from which on the harmonics of degree 1 are optimised; those of degree 2 and
/// 3 from twice and thrice as much.
const DEGREE_SHARE: f32 = 0.15;

/// Gaussians of a scene, optimised so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimised {
    /// The Gaussians; their colours are those of degree 0.
    pub gaussians: Vec<GaussianBlock>,
    /// Degree of the spherical harmonics.
    pub degree: u32,
    /// Coefficients of the degrees above 0: `[gaussian][channel][coefficient]`.
    pub f_rest: Vec<f32>,
    /// Depth along the principal axis from which on they are seen, world units.
    pub near: f32,
    /// What is seen where nothing is: red, green, blue.
    pub background: [f32; 3],
    /// How much brighter each source is than the Gaussians: red, green, blue.
    pub gains: Vec<[f32; 3]>,
    /// Whether their splats keep their integral when they are dilated.
    pub is_antialiased: bool,
}

impl Optimised {
    /// The Gaussians as a scene that can be written.
    pub fn scene(&self) -> GaussianScene {
        let Optimised { degree, is_antialiased, .. } = *self;
        GaussianScene { degree, is_antialiased, f_rest: self.f_rest.clone(), ..scene_of(&self.gaussians) }
    }
}

/// How the steps of an optimisation are made: what differs from device to device.
pub(super) trait Steps {
    /// Makes the next iteration. A device may still be at work on it.
    fn iterate(&mut self, course: &mut Course) -> Result<(), FieldError>;

    /// Asks the device for what the next iteration, or the end, needs of the Gaussians, if it has its own.
    fn ask(&mut self, _course: &Course) -> Result<(), FieldError> {
        Ok(())
    }

    /// Forgets the Gaussians, if it has any of its own: the course goes on from others.
    fn forget(&mut self) {}

    /// Waits until the device is done with all iterations so far.
    fn finish(&mut self, _course: &Course) -> Result<(), FieldError> {
        Ok(())
    }

    /// Gives the course what pictures and files need of the Gaussians so far, and the gains, if it has its own.
    fn bring(&mut self, _course: &mut Course) -> Result<(), FieldError> {
        Ok(())
    }
}

/// An optimisation, on whatever device makes its steps.
pub struct Optimisation<'d> {
    course: Course,
    steps: Box<dyn Steps + 'd>,
}

impl<'d> Optimisation<'d> {
    pub(super) fn new(course: Course, steps: impl Steps + 'd) -> Optimisation<'d> {
        Optimisation { course, steps: Box::new(steps) }
    }

    /// Counts each source's differences by its weight from now on; the weights are scaled to 1 in the mean.
    pub fn weigh(&mut self, weights: &[f32]) {
        let mean = weights.iter().sum::<f32>() / weights.len().max(1) as f32;
        if mean > 0.0 && weights.len() == self.course.weights.len() {
            self.course.weights = weights.iter().map(|weight| weight / mean).collect();
        }
    }

    /// Goes on from Gaussians that were optimised before, with the finest level's iterations.
    pub fn resume(&mut self, scene: &GaussianScene) {
        self.steps.forget();
        self.course.resume(scene);
    }

    /// Adds iterations at the finest level.
    pub fn extend(&mut self, iterations: u32) {
        let [.., finest] = &mut self.course.recipe.iterations;
        *finest += iterations;
    }

    /// So many iterations at the finest level in place of the recipe's, at least those that are done.
    pub fn set_finest(&mut self, iterations: u32) {
        let least = self.done_at_finest();
        let [.., finest] = &mut self.course.recipe.iterations;
        *finest = iterations.max(least);
    }

    /// How many iterations are done at the finest level.
    pub fn done_at_finest(&self) -> u32 {
        let [.., finest] = self.course.recipe.iterations;
        self.done().saturating_sub(self.iteration_count() - finest)
    }

    /// How many times as many Gaussians there will be at the end.
    pub fn growth(&self) -> f64 {
        let Course { recipe, particles, .. } = &self.course;
        let most = if recipe.grows { recipe.max_count } else { 0 };
        (most as f64 / particles.len().max(1) as f64).max(1.0)
    }

    /// How many iterations are done.
    pub fn done(&self) -> u32 {
        self.course.iteration
    }

    /// All iterations of the recipe.
    pub fn iteration_count(&self) -> u32 {
        self.course.iteration_count()
    }

    /// The iterations up to this number of them, as far as the recipe has so many; none if so many are done. A device
    /// may still be at work on the last ones.
    ///
    /// # Errors
    /// [`FieldError`]; where the device did not fail, the Gaussians so far are still there.
    pub fn run_to(&mut self, iteration: u32, progress: &dyn Progress) -> Result<(), FieldError> {
        let end = iteration.min(self.iteration_count());
        progress.expect(end.saturating_sub(self.done()) as usize);
        while self.done() < end {
            progress.check()?;
            self.steps.iterate(&mut self.course)?;
            progress.step();
        }
        Ok(())
    }

    /// The iterations up to the next that begins with other Gaussians, or to the last one, and asks for those so far.
    /// Returns whether all were done before: the next call, or [`Optimisation::optimised`], waits for what this one
    /// asked for.
    ///
    /// # Errors
    /// As [`Optimisation::run_to`].
    pub fn advance(&mut self, progress: &dyn Progress) -> Result<bool, FieldError> {
        if self.course.is_done() {
            return Ok(true);
        }
        loop {
            progress.check()?;
            self.steps.iterate(&mut self.course)?;
            if self.course.is_done() || self.course.changes() {
                break self.steps.ask(&self.course).map(|()| false);
            }
        }
    }

    /// Waits until the device is done with all iterations so far, so that their time can be measured.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn finish(&mut self) -> Result<(), FieldError> {
        self.steps.finish(&self.course)
    }

    /// The Gaussians so far.
    ///
    /// # Errors
    /// [`FieldError`] if the device fails.
    pub fn optimised(&mut self) -> Result<Optimised, FieldError> {
        self.steps.bring(&mut self.course)?;
        Ok(self.course.optimised())
    }
}

/// An iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// The level, 0 for the finest.
    pub(super) level: usize,
    /// The source that is drawn.
    pub(super) source: usize,
    /// What it does to the Gaussians.
    pub(super) step: StepBlock,
    /// What it counts in the loss; the photograph begins at pixel 0.
    pub(super) loss: LossBlock,
    /// Learning rate of the gain.
    pub(super) gain_rate: f32,
}

/// An optimisation's recipe, its photographs, and how far it is.
pub(super) struct Course {
    pub(super) recipe: Recipe,
    pub(super) extent: Extent,
    /// Depth along the principal axis from which on Gaussians are seen, world units ([`Extent::near`]).
    pub(super) near: f32,
    /// What is seen where nothing is: red, green, blue.
    pub(super) background: [f32; 3],
    /// `[level][source]`, the finest level first.
    pub(super) levels: Vec<Vec<LevelView>>,
    pub(super) particles: Vec<Particle>,
    /// How many Gaussians the finest level began with.
    first_count: usize,
    /// `[source]`.
    pub(super) gains: Vec<GainBlock>,
    /// How much each source counts, 1 in the mean.
    weights: Vec<f32>,
    /// The sources that are still to be drawn in this round.
    round: Vec<usize>,
    iteration: u32,
    level: Option<usize>,
}

/// Most Gaussians for the pixels of the largest source.
fn most_for(views: &[LevelView], max_per_pixel: f32) -> usize {
    let pixels = views.iter().map(|view| view.camera.width * view.camera.height).max().unwrap_or(0);
    (pixels as f32 * max_per_pixel).ceil() as usize
}

impl Course {
    /// Begins with the sources' surface points; `None` if there are too few of them.
    ///
    /// # Errors
    /// [`FieldError`].
    pub(super) fn new(
        images: &SourceImages,
        points: &[CloudPoint],
        mut recipe: Recipe,
    ) -> Result<Option<Course>, FieldError> {
        let own_side = images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let side = own_side.min(recipe.side);
        let levels = map(LEVELS, 1, |number| level(images, side, number as u32));
        let levels: Vec<Vec<LevelView>> =
            levels.into_iter().collect::<Result<_, _>>().map_err(FieldError::unsuitable)?;
        let finest = levels.first().and_then(|views| views.first()).map_or(1.0, |view| view.camera.intrinsics[0]);
        let Some(extent) = Extent::of(points, images, finest) else { return Ok(None) };
        recipe.max_count = recipe.max_count.min(most_for(&levels[0], recipe.max_per_pixel));
        let particles = start(points, images, &extent, &recipe).into_iter().map(Particle::new).collect();
        let source_count = images.images.len();
        Ok(Some(Course {
            near: extent.near(recipe.near),
            background: behind(images),
            recipe,
            extent,
            levels,
            first_count: 0,
            particles,
            gains: vec![GainBlock { value: [1.0; 3], ..GainBlock::default() }; source_count],
            weights: vec![1.0; source_count],
            round: Vec::new(),
            iteration: 0,
            level: None,
        }))
    }

    fn resume(&mut self, scene: &GaussianScene) {
        let count = 3 * REST_COUNTS[scene.degree.min(3) as usize] as usize;
        let particle = |(index, mut gaussian): (usize, GaussianBlock)| {
            let rest = scene.f_rest.get(index * count..(index + 1) * count).filter(|_| self.recipe.degree > 0);
            if rest.is_none() {
                gaussian.colour = gaussian.colour.map(|level| level.max(0.0));
            }
            Particle::begun(gaussian, rest.map_or_else(Harmonics::default, Harmonics::new))
        };
        self.particles = scene.blocks().into_iter().enumerate().map(particle).collect();
        self.first_count = self.particles.len();
        let [.., finest] = self.recipe.iterations;
        self.iteration = self.iteration_count() - finest;
        self.level = Some(self.level_of(self.iteration).0);
    }

    fn iteration_count(&self) -> u32 {
        self.recipe.iterations.iter().sum()
    }

    fn optimised(&self) -> Optimised {
        let count = self.particles.iter().map(|particle| particle.harmonics.count()).max().unwrap_or(0);
        let degree = REST_COUNTS.iter().position(|rest| *rest as usize == count).unwrap_or(0);
        Optimised {
            gaussians: self.particles.iter().map(|particle| particle.gaussian).collect(),
            degree: degree as u32,
            f_rest: self.particles.iter().flat_map(|particle| particle.harmonics.coefficients(count)).collect(),
            near: self.near,
            background: self.background,
            gains: self.gains.iter().map(|gain| gain.value).collect(),
            is_antialiased: self.recipe.is_antialiased,
        }
    }

    /// The level of an iteration, and how far through it is.
    fn level_of(&self, iteration: u32) -> (usize, f32) {
        let mut first = 0;
        for (coarse, count) in self.recipe.iterations.iter().enumerate() {
            if iteration < first + count {
                return (LEVELS - 1 - coarse, (iteration - first) as f32 / *count as f32);
            }
            first += count;
        }
        (0, 1.0)
    }

    /// The next source: each once a round, in an order drawn for the round.
    fn next_source(&mut self) -> usize {
        if self.round.is_empty() {
            self.round = (0..self.gains.len()).collect();
            for last in (1..self.round.len()).rev() {
                let drawn = uniform(self.recipe.seed, self.iteration, last as u32) * (last + 1) as f32;
                self.round.swap(last, (drawn as usize).min(last));
            }
        }
        self.round.pop().unwrap_or_default()
    }

    /// Whether the number of Gaussians grows before the next iteration, and how many times it has grown then.
    fn growth(&self, level: usize, share: f32) -> Option<u32> {
        let finest = if level == 0 { self.recipe.iterations[LEVELS - 1] } else { 0 };
        let growth = growth_at((share * finest as f32).round() as u32, finest.max(1));
        growth.filter(|_| self.recipe.grows)
    }

    /// Whether all iterations of the recipe are done.
    pub(super) fn is_done(&self) -> bool {
        self.iteration >= self.iteration_count()
    }

    /// Whether the next iteration is the first one of a level.
    pub(super) fn begins_level(&self) -> bool {
        self.level != Some(self.level_of(self.iteration).0)
    }

    /// Whether the next iteration begins with other Gaussians than the last one ended with, or at another level.
    pub(super) fn changes(&self) -> bool {
        let (level, share) = self.level_of(self.iteration);
        self.begins_level() || self.growth(level, share).is_some()
    }

    /// Makes the Gaussians those of the next iteration, and says what it does. The gains' mean is 1 after it.
    pub(super) fn plan(&mut self) -> Plan {
        let (level, share) = self.level_of(self.iteration);
        let footprint = self.extent.footprint * (1 << level) as f32;
        if self.level != Some(level) {
            if self.level.is_some() {
                let cameras: Vec<CameraBlock> = self.levels[0].iter().map(|view| view.camera).collect();
                self.particles = refined(&self.particles, &cameras, &self.extent, footprint, &self.recipe);
            }
            self.level = Some(level);
            self.first_count = self.particles.len();
        }
        if let Some(growth) = self.growth(level, share) {
            grow(&mut self.particles, growth, self.first_count, self.recipe.max_count);
        }
        let degree = if level == 0 { self.recipe.degree.min((share / DEGREE_SHARE) as u32) } else { 0 };
        let source = self.next_source();
        let done = self.iteration as f32 / self.iteration_count() as f32;
        self.iteration += 1;
        let (view, recipe) = (&self.levels[level][source], &self.recipe);
        let CameraBlock { width, height, .. } = view.camera;
        let [place, scale, turn, opaque, colour, gain_rate] = recipe.rates;
        let [last_place, last_scale, last_opaque, last_colour] = recipe.last_rates;
        let rates = [
            place * footprint * last_place.powf(share),
            scale * last_scale.powf(done),
            turn,
            opaque * last_opaque.powf(done),
            colour * last_colour.powf(done),
        ];
        let opacity_penalty = recipe.opacity_penalty / (width * height) as f32;
        let step = StepBlock {
            camera: view.camera,
            rates,
            opacity_penalty,
            footprint,
            depth: self.extent.depth,
            degree: degree.min(3),
            counts: 0,
        };
        let step = step.with_limited_colours(recipe.has_limited_colours);
        let loss = LossBlock {
            width,
            height,
            first: 0,
            source: source as u32,
            has_silhouette: u32::from(view.has_silhouette),
            structure_share: recipe.structure_share,
            silhouette_share: recipe.silhouette_share,
            factor: self.weights[source] / (3 * width * height) as f32,
        };
        Plan { level, source, step, loss, gain_rate }
    }

    /// Keeps the mean of the gains at 1: the Gaussians have the sources' mean exposure.
    pub(super) fn level_gains(&mut self) {
        for channel in 0..3 {
            let sum: f32 = self.gains.iter().map(|gain| gain.value[channel]).sum();
            let mean = sum / self.gains.len().max(1) as f32;
            self.gains.iter_mut().for_each(|gain| gain.value[channel] /= mean);
        }
    }
}
