//! The loop: a source at a time is drawn, compared with its photograph, and what made it is stepped.

use super::given::{behind, scene_of};
use super::growth::{grow, growth_at};
use super::harmonics::Harmonics;
use super::level::{LevelView, level};
use super::loss::{Pair, gradient};
use super::particles::{Particle, Step, refined, step_all};
use super::picture::Splatter;
use super::recipe::Recipe;
use super::start::{Extent, start};
use crate::FieldError;
use crate::point_cloud::CloudPoint;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_core::random::uniform;
use viewfuse_device::Device;
use viewfuse_device::cpu::Cpu;
use viewfuse_device::parallel::{for_each, map};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::gaussians::adam::adam_step;
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::gaussians::GaussianScene;
use viewfuse_scene::photographs::{SourceImages, longest_side};

/// Levels of the pyramid.
const LEVELS: usize = 4;
/// Share of the finest level's iterations from which on the harmonics of degree 1 are optimised; those of degree 2 and 3
/// from twice and thrice as much.
const DEGREE_SHARE: f32 = 0.15;
/// Share of a gain's difference from 1 in its derivative.
const GAIN_PULL: f32 = 0.02;

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
}

impl Optimised {
    /// The Gaussians as a scene that can be written.
    pub fn scene(&self) -> GaussianScene {
        GaussianScene { degree: self.degree, f_rest: self.f_rest.clone(), ..scene_of(&self.gaussians) }
    }
}

/// An optimisation, on whatever device makes its steps.
pub trait Optimisation {
    /// Counts each source's differences by its weight from now on; the weights are scaled to 1 in the mean.
    fn weigh(&mut self, weights: &[f32]);

    /// Goes on from Gaussians that were optimised before, with the finest level's iterations.
    fn resume(&mut self, scene: &GaussianScene);

    /// Adds iterations at the finest level.
    fn extend(&mut self, iterations: u32);

    /// So many iterations at the finest level in place of the recipe's, at least those that are done.
    fn set_finest(&mut self, iterations: u32);

    /// How many iterations are done at the finest level.
    fn done_at_finest(&self) -> u32;

    /// How many iterations are done.
    fn done(&self) -> u32;

    /// All iterations of the recipe.
    fn iteration_count(&self) -> u32;

    /// The iterations up to this number of them, as far as the recipe has so many; none if so many are done.
    ///
    /// # Errors
    /// [`FieldError`]; after one the Gaussians so far are still there.
    fn run_to(&mut self, iteration: u32, progress: &dyn Progress) -> Result<(), FieldError>;

    /// The Gaussians so far.
    fn optimised(&self) -> Optimised;
}

/// An optimisation at its beginning: on the device, or, where that is a software driver, by the CPU's own loops, which
/// take a part of its time. Mesa's llvmpipe, besides, ends the loops of an invocation after 65,535 iterations, so that
/// the derivatives of tiles with some 250 splats or more are wrong there. `None` if there are too few points.
///
/// # Errors
/// [`FieldError`].
pub fn optimisation<'d, D: Device>(
    device: &'d D,
    images: &SourceImages,
    points: &[CloudPoint],
    recipe: Recipe,
) -> Result<Option<Box<dyn Optimisation + 'd>>, FieldError> {
    fn boxed<'d, D: Device>(optimiser: Option<Optimiser<'d, D>>) -> Option<Box<dyn Optimisation + 'd>> {
        optimiser.map(|optimiser| Box::new(optimiser) as Box<dyn Optimisation + 'd>)
    }
    match device.is_software() {
        true => Ok(boxed(Optimiser::new(&Cpu, images, points, recipe)?)),
        false => Ok(boxed(Optimiser::new(device, images, points, recipe)?)),
    }
}

/// All iterations of a recipe, on the device that [`optimisation`] takes. `None` if there are too few points.
///
/// # Errors
/// [`FieldError`].
pub fn optimised<D: Device>(
    device: &D,
    images: &SourceImages,
    points: &[CloudPoint],
    recipe: Recipe,
    progress: &dyn Progress,
) -> Result<Option<Optimised>, FieldError> {
    let Some(mut optimisation) = optimisation(device, images, points, recipe)? else { return Ok(None) };
    optimisation.run_to(u32::MAX, progress)?;
    Ok(Some(optimisation.optimised()))
}

impl<D: Device> Optimisation for Optimiser<'_, D> {
    fn weigh(&mut self, weights: &[f32]) {
        let mean = weights.iter().sum::<f32>() / weights.len().max(1) as f32;
        if mean > 0.0 && weights.len() == self.weights.len() {
            self.weights = weights.iter().map(|weight| weight / mean).collect();
        }
    }

    fn resume(&mut self, scene: &GaussianScene) {
        let count = 3 * REST_COUNTS[scene.degree.min(3) as usize] as usize;
        let flat = GaussianScene { gaussians: scene.gaussians.clone(), ..GaussianScene::default() };
        let particle = |(index, gaussian): (usize, GaussianBlock)| {
            let rest = scene.f_rest.get(index * count..(index + 1) * count).filter(|_| self.recipe.degree > 0);
            Particle::begun(gaussian, rest.map_or_else(Harmonics::default, Harmonics::new))
        };
        self.particles = flat.blocks(Vec3::ZERO).into_iter().enumerate().map(particle).collect();
        self.first_count = self.particles.len();
        let [.., finest] = self.recipe.iterations;
        self.iteration = self.iteration_count() - finest;
        self.level = Some(self.level_of(self.iteration).0);
    }

    fn extend(&mut self, iterations: u32) {
        let [.., finest] = &mut self.recipe.iterations;
        *finest += iterations;
    }

    fn set_finest(&mut self, iterations: u32) {
        let least = self.done_at_finest();
        let [.., finest] = &mut self.recipe.iterations;
        *finest = iterations.max(least);
    }

    fn done_at_finest(&self) -> u32 {
        let [.., finest] = self.recipe.iterations;
        self.iteration.saturating_sub(self.iteration_count() - finest)
    }

    fn done(&self) -> u32 {
        self.iteration
    }

    fn iteration_count(&self) -> u32 {
        self.recipe.iterations.iter().sum()
    }

    fn run_to(&mut self, iteration: u32, progress: &dyn Progress) -> Result<(), FieldError> {
        let end = iteration.min(self.iteration_count());
        progress.expect(end.saturating_sub(self.iteration) as usize);
        while self.iteration < end {
            progress.check()?;
            self.iterate()?;
            progress.step();
        }
        Ok(())
    }

    fn optimised(&self) -> Optimised {
        let count = self.particles.iter().map(|particle| particle.harmonics.count()).max().unwrap_or(0);
        let degree = REST_COUNTS.iter().position(|rest| *rest as usize == count).unwrap_or(0);
        Optimised {
            gaussians: self.particles.iter().map(|particle| particle.gaussian).collect(),
            degree: degree as u32,
            f_rest: self.particles.iter().flat_map(|particle| particle.harmonics.coefficients(count)).collect(),
            near: self.splatter.near,
            background: self.splatter.background,
            gains: self.gains.iter().map(|gain| gain.value).collect(),
        }
    }
}

/// A source's gain and the moments of its derivative.
#[derive(Clone, Copy, Debug)]
struct Gain {
    value: [f32; 3],
    moments: [[f32; 2]; 3],
    step_count: i32,
}

/// Optimises Gaussians for source views, an iteration at a time.
struct Optimiser<'d, D> {
    splatter: Splatter<'d, D>,
    recipe: Recipe,
    extent: Extent,
    /// `[level][source]`, the finest level first.
    levels: Vec<Vec<LevelView>>,
    particles: Vec<Particle>,
    /// How many Gaussians the finest level began with.
    first_count: usize,
    gains: Vec<Gain>,
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

impl<'d, D: Device> Optimiser<'d, D> {
    /// Begins with the sources' surface points; `None` if there are too few of them.
    fn new(
        device: &'d D,
        images: &SourceImages,
        points: &[CloudPoint],
        mut recipe: Recipe,
    ) -> Result<Option<Optimiser<'d, D>>, FieldError> {
        let own_side = images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let side = own_side.min(recipe.side);
        let levels = map(LEVELS, 1, |number| level(images, side, number as u32));
        let levels: Vec<Vec<LevelView>> =
            levels.into_iter().collect::<Result<_, _>>().map_err(FieldError::unsuitable)?;
        let finest = levels.first().and_then(|views| views.first()).map_or(1.0, |view| view.camera.intrinsics[0]);
        let Some(extent) = Extent::of(points, images, finest) else { return Ok(None) };
        recipe.max_count = recipe.max_count.min(most_for(&levels[0], recipe.max_per_pixel));
        let background = behind(images);
        let particles = start(points, images, &extent, &recipe).into_iter().map(Particle::new).collect();
        let gain = Gain { value: [1.0; 3], moments: [[0.0; 2]; 3], step_count: 0 };
        let source_count = images.images.len();
        Ok(Some(Optimiser {
            splatter: Splatter { device, near: recipe.near * extent.depth, background },
            recipe,
            extent,
            levels,
            first_count: 0,
            particles,
            gains: vec![gain; source_count],
            weights: vec![1.0; source_count],
            round: Vec::new(),
            iteration: 0,
            level: None,
        }))
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

    /// Keeps the mean of the gains at 1: the Gaussians have the sources' mean exposure.
    fn level_gains(&mut self) {
        for channel in 0..3 {
            let sum: f32 = self.gains.iter().map(|gain| gain.value[channel]).sum();
            let mean = sum / self.gains.len().max(1) as f32;
            self.gains.iter_mut().for_each(|gain| gain.value[channel] /= mean);
        }
    }

    fn iterate(&mut self) -> Result<(), FieldError> {
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
        let finest = if level == 0 { self.recipe.iterations[LEVELS - 1] } else { 0 };
        if self.recipe.grows
            && let Some(growth) = growth_at((share * finest as f32).round() as u32, finest.max(1))
        {
            grow(&mut self.particles, growth, self.first_count, self.recipe.max_count);
        }
        let degree = if level == 0 { self.recipe.degree.min((share / DEGREE_SHARE) as u32) } else { 0 };
        let source = self.next_source();
        let view = &self.levels[level][source];
        let device = self.splatter.device;
        let mut gaussians = vec![GaussianBlock::default(); self.particles.len()];
        for_each(&mut gaussians, 256, |index, gaussian| *gaussian = self.particles[index].block(&view.camera));
        let uploaded = device.upload(&gaussians)?;
        let picture = self.splatter.picture(&uploaded, gaussians.len(), &view.camera)?;
        let colours = device.download(&picture.colours)?;
        let (by_pixels, by_gain) =
            by_pixels(&colours, view, self.gains[source].value, self.weights[source], &self.recipe);
        let gradients = self.splatter.gradients(&uploaded, &picture, &by_pixels)?;
        let done = self.iteration as f32 / self.iteration_count() as f32;
        let [place, scale, turn, opaque, colour, gain_rate] = self.recipe.rates;
        let rates = [
            place * footprint * 0.3_f32.powf(share),
            scale * 0.2_f32.powf(done),
            turn,
            opaque * 0.2_f32.powf(done),
            colour * 0.1_f32.powf(done),
        ];
        let opacity_penalty = self.recipe.opacity_penalty / (view.camera.width * view.camera.height) as f32;
        let camera = view.camera;
        let depth = self.extent.depth;
        let in_sight = &picture.lists.in_sight[..];
        let step = Step { gradients: &gradients, in_sight, camera, rates, opacity_penalty, footprint, depth, degree };
        step_all(&mut self.particles, &step);
        self.gains[source].step(by_gain, gain_rate);
        self.level_gains();
        self.iteration += 1;
        Ok(())
    }
}

impl Gain {
    fn step(&mut self, by_gain: [f32; 3], rate: f32) {
        self.step_count += 1;
        let corrections = [1.0 - 0.9_f32.powi(self.step_count), 1.0 - 0.99_f32.powi(self.step_count)];
        for (channel, by_channel) in by_gain.into_iter().enumerate() {
            let pulled = by_channel + GAIN_PULL * (self.value[channel] - 1.0);
            adam_step(&mut self.value[channel], &mut self.moments[channel], pulled, rate, corrections);
        }
    }
}

/// Derivatives of the loss by the picture's pixels and by the source's gain.
fn by_pixels(
    colours: &[[f32; 4]],
    view: &LevelView,
    gain: [f32; 3],
    weight: f32,
    recipe: &Recipe,
) -> (Vec<[f32; 4]>, [f32; 3]) {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let factor = weight / (3 * width * height) as f32;
    let channels = map(3, 1, |channel| {
        let mut picture: Vec<f32> = colours.iter().map(|colour| colour[channel] * gain[channel]).collect();
        let (photograph, structure, seen) = (&view.channels[channel], &view.structure[channel], &view.seen[..]);
        // What the photograph does not show is the same in both: windows that hold some of it compare the rest.
        let pixels = picture.iter_mut().zip(photograph).zip(seen);
        pixels.filter(|(_, seen)| **seen == 0.0).for_each(|((x, y), _)| *x = *y);
        gradient(&Pair { picture: &picture, photograph, structure, seen, width, height }, recipe.structure_share)
    });
    let mut by_gain = [0.0; 3];
    let mut by_pixels = vec![[0.0; 4]; colours.len()];
    for (channel, values) in channels.iter().enumerate() {
        let mut sum = 0.0_f64;
        for ((by, value), colour) in by_pixels.iter_mut().zip(values).zip(colours) {
            by[channel] = factor * gain[channel] * value;
            sum += f64::from(value * colour[channel]);
        }
        by_gain[channel] = factor * sum as f32;
    }
    if view.seen.is_empty() && recipe.silhouette_share > 0.0 && view.has_silhouette {
        for ((by, colour), alpha) in by_pixels.iter_mut().zip(colours).zip(&view.channels[3]) {
            by[3] = 3.0 * factor * recipe.silhouette_share * ((colour[3] - alpha) / 0.01).clamp(-1.0, 1.0);
        }
    }
    (by_pixels, by_gain)
}
