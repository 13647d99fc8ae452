//! Gaussians with the state of their optimisation: steps of Adam, pruning, splitting.

use super::harmonics::Harmonics;
use super::recipe::Recipe;
use super::start::Extent;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{axes, opacity};
use viewfuse_device::parallel::for_each;
use viewfuse_kernels::gaussians::adam::{FIRST_DECAY, SECOND_DECAY, adam_step};
use viewfuse_kernels::rows::GaussianBlock;

/// Most times that a Gaussian is split in a row.
const MAX_SPLITS: u32 = 3;
/// Logarithm of the greatest quotient of a Gaussian's scales: ten.
const MAX_ELONGATION: f32 = 2.3;
/// Greatest magnitude of an opacity's logit.
const MAX_LOGIT: f32 = 6.0;
/// Greatest standard deviation, in footprints of the level.
const MAX_SCALE: f32 = 8.0;

/// A Gaussian and the moments of its derivatives.
#[derive(Clone, Debug)]
pub(super) struct Particle {
    /// Its colour is that of degree 0.
    pub(super) gaussian: GaussianBlock,
    pub(super) harmonics: Harmonics,
    moments: [[f32; 2]; 14],
    step_count: i32,
    /// Sum of the lengths of the derivative by its place in a picture, and of how many pictures.
    moved: (f32, u32),
}

/// What an iteration does to the particles.
pub(super) struct Step<'a> {
    /// Derivatives by the Gaussians' parameters.
    pub(super) gradients: &'a [GaussianBlock],
    /// Whether each Gaussian is in the picture: others stay as they are.
    pub(super) in_sight: &'a [bool],
    pub(super) camera: CameraBlock,
    /// Of position, log scale, rotation, opacity, colour.
    pub(super) rates: [f32; 5],
    /// What the opacity's derivative grows by, a unit of it.
    pub(super) opacity_penalty: f32,
    /// Size of the level's pixel at the median depth, world units.
    pub(super) footprint: f32,
    /// Median depth, world units.
    pub(super) depth: f32,
    /// Degree of the spherical harmonics so far.
    pub(super) degree: u32,
}

impl Particle {
    pub(super) fn new(gaussian: GaussianBlock) -> Particle {
        Particle::begun(gaussian, Harmonics::default())
    }

    pub(super) fn begun(gaussian: GaussianBlock, harmonics: Harmonics) -> Particle {
        Particle { gaussian, harmonics, moments: [[0.0; 2]; 14], step_count: 0, moved: (0.0, 0) }
    }

    /// As a camera sees it.
    pub(super) fn block(&self, camera: &CameraBlock) -> GaussianBlock {
        GaussianBlock { colour: self.harmonics.along(self.gaussian.colour, self.direction(camera)), ..self.gaussian }
    }

    /// From a camera to its mean, of length 1; 0 at the camera itself.
    fn direction(&self, camera: &CameraBlock) -> Vec3 {
        (Vec3::from_array(self.gaussian.position) - camera.centre_world()).normalize_or_zero()
    }

    /// How much the loss moves it: 0 if it was in no picture.
    pub(super) fn score(&self) -> f32 {
        self.moved.0 / self.moved.1.max(1) as f32
    }

    /// Counts a picture with a derivative of this length.
    pub(super) fn scored(&mut self, length: f32) {
        if length.is_finite() {
            self.moved = (self.moved.0 + length, self.moved.1 + 1);
        }
    }

    pub(super) fn reset_score(&mut self) {
        self.moved = (0.0, 0);
    }

    fn step(&mut self, gradient: &GaussianBlock, step: &Step<'_>) {
        self.step_count += 1;
        let corrections = [1.0 - FIRST_DECAY.powi(self.step_count), 1.0 - SECOND_DECAY.powi(self.step_count)];
        let unit = self.direction(&step.camera);
        let mut by_colour = gradient.colour;
        if step.degree > 0 {
            self.harmonics.raise(step.degree);
            let seen = self.harmonics.along(self.gaussian.colour, unit);
            // Colours end at 0.
            by_colour.iter_mut().zip(seen).filter(|(_, seen)| *seen <= 0.0).for_each(|(by, _)| *by = 0.0);
            if by_colour.iter().all(|by| by.is_finite()) {
                self.harmonics.step(by_colour, unit, step.rates[4], corrections);
            }
        }
        let gaussian = &mut self.gaussian;
        let solid = opacity(gaussian.opacity);
        let penalty = step.opacity_penalty * solid * (1.0 - solid);
        let [place, scale, turn, opaque, colour] = step.rates;
        let mut moments = self.moments.iter_mut();
        let mut all = |values: &mut [f32], gradients: &[f32], rate: f32| {
            for ((value, gradient), moments) in values.iter_mut().zip(gradients).zip(&mut moments) {
                if gradient.is_finite() {
                    adam_step(value, moments, *gradient, rate, corrections);
                }
            }
        };
        all(&mut gaussian.position, &gradient.position, place);
        all(&mut gaussian.log_scales, &gradient.log_scales, scale);
        all(&mut gaussian.rotation, &gradient.rotation, turn);
        all(std::slice::from_mut(&mut gaussian.opacity), &[gradient.opacity + penalty], opaque);
        all(&mut gaussian.colour, &by_colour, colour);
        let [x, y, z] = gaussian.position;
        let depth = step.camera.pose.rotate_to_camera(Vec3::new(x, y, z) - step.camera.centre_world()).z;
        let most = (MAX_SCALE * step.footprint * (depth / step.depth).max(1.0)).ln();
        let scales = &mut gaussian.log_scales;
        scales.iter_mut().for_each(|scale| *scale = scale.min(most));
        let least = scales.iter().copied().fold(f32::NEG_INFINITY, f32::max) - MAX_ELONGATION;
        scales.iter_mut().for_each(|scale| *scale = scale.max(least));
        gaussian.opacity = gaussian.opacity.clamp(-MAX_LOGIT, MAX_LOGIT);
        // A place in the picture moves by the focal length over the depth.
        self.scored(Vec3::from_array(gradient.position).length() * depth / step.camera.intrinsics[0]);
    }
}

/// Steps all Gaussians that are seen.
pub(super) fn step_all(particles: &mut [Particle], step: &Step<'_>) {
    for_each(particles, 128, |index, particle| {
        if step.in_sight[index] {
            particle.step(&step.gradients[index], step);
        }
    });
}

/// Prunes the faintest and splits the largest for a level whose pixel has this size at the median depth.
pub(super) fn refined(
    particles: &[Particle],
    cameras: &[CameraBlock],
    extent: &Extent,
    footprint: f32,
    recipe: &Recipe,
) -> Vec<Particle> {
    let mut kept: Vec<(GaussianBlock, u32)> = particles
        .iter()
        .filter(|particle| opacity(particle.gaussian.opacity) >= recipe.prune_opacity)
        .map(|particle| (particle.gaussian, 0))
        .collect();
    let mut refined = Vec::with_capacity(2 * kept.len());
    kept.reverse();
    while let Some((gaussian, splits)) = kept.pop() {
        let axis = longest_axis(&gaussian);
        let has_room = refined.len() + kept.len() + 1 < recipe.max_count;
        let limit = recipe.split_scale * footprint * nearest(&gaussian, cameras, extent).max(0.3);
        if splits < MAX_SPLITS && has_room && gaussian.log_scales[axis].exp() > limit {
            kept.extend(halves(&gaussian, axis).map(|half| (half, splits + 1)));
        } else {
            refined.push(Particle::new(gaussian));
        }
    }
    refined
}

/// The least depth at which a source sees a Gaussian, relative to the median depth.
fn nearest(gaussian: &GaussianBlock, cameras: &[CameraBlock], extent: &Extent) -> f32 {
    let position = Vec3::from_array(gaussian.position);
    let depths = cameras.iter().map(|camera| camera.pose.rotate_to_camera(position - camera.centre_world()).z);
    let least = depths.filter(|depth| *depth > 0.25 * extent.depth).fold(f32::INFINITY, f32::min);
    least.min(1.0e6 * extent.depth) / extent.depth
}

/// The axis of the greatest standard deviation.
pub(super) fn longest_axis(gaussian: &GaussianBlock) -> usize {
    (0..3).fold(0, |most, axis| if gaussian.log_scales[axis] > gaussian.log_scales[most] { axis } else { most })
}

/// Two Gaussians in the place of one, apart along an axis.
pub(super) fn halves(gaussian: &GaussianBlock, axis: usize) -> [GaussianBlock; 2] {
    let apart = axes(gaussian.rotation)[axis] * (0.5 * gaussian.log_scales[axis].exp());
    let solid = 1.0 - (1.0 - opacity(gaussian.opacity)).powf(0.8);
    let half = |side: f32| {
        let mut half = *gaussian;
        half.position = (Vec3::from_array(gaussian.position) + apart * side).to_array();
        // A standard deviation of 0.62: with the distance, that of both together stays.
        half.log_scales[axis] -= 0.47;
        half.opacity = (solid / (1.0 - solid)).ln();
        half
    };
    [half(-1.0), half(1.0)]
}
