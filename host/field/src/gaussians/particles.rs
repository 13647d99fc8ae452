//! Gaussians with the state of their optimisation: steps of Adam, pruning, splitting.

use super::harmonics::Harmonics;
use super::recipe::Recipe;
use super::start::Extent;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{axes, opacity};
use viewfuse_device::parallel::for_each;
use viewfuse_kernels::gaussians::steps::{ParticleState, StepBlock, by_colour, corrections, direction, step_particle};
use viewfuse_kernels::rows::GaussianBlock;

/// Most times that a Gaussian is split in a row.
const MAX_SPLITS: u32 = 3;

/// A Gaussian and the state of its optimisation.
#[derive(Clone, Debug)]
pub(super) struct Particle {
    /// Its colour is that of degree 0.
    pub(super) gaussian: GaussianBlock,
    pub(super) harmonics: Harmonics,
    pub(super) state: ParticleState,
}

impl Particle {
    pub(super) fn new(gaussian: GaussianBlock) -> Particle {
        Particle::begun(gaussian, Harmonics::default())
    }

    pub(super) fn begun(gaussian: GaussianBlock, harmonics: Harmonics) -> Particle {
        let state = ParticleState { rest_count: harmonics.count() as u32, ..ParticleState::default() };
        Particle { gaussian, harmonics, state }
    }

    /// As a camera sees it.
    pub(super) fn block(&self, camera: &CameraBlock) -> GaussianBlock {
        let unit = direction(&self.gaussian, camera);
        GaussianBlock { colour: self.harmonics.along(self.gaussian.colour, unit), ..self.gaussian }
    }

    /// How much the loss moves it: 0 if it was in no picture.
    pub(super) fn score(&self) -> f32 {
        self.state.moved / self.state.moved_count.max(1) as f32
    }

    pub(super) fn reset_score(&mut self) {
        (self.state.moved, self.state.moved_count) = (0.0, 0);
    }

    fn step(&mut self, gradient: &GaussianBlock, block: &StepBlock) {
        let mut seen = self.gaussian.colour;
        if block.degree > 0 {
            let unit = direction(&self.gaussian, &block.camera);
            self.harmonics.raise(block.degree);
            seen = self.harmonics.along(self.gaussian.colour, unit);
            let by_colour = by_colour(gradient.colour, seen, block.degree);
            if by_colour.iter().all(|by| by.is_finite()) {
                self.harmonics.step(by_colour, unit, block.rates[4], corrections(self.state.step_count + 1));
            }
        }
        (self.gaussian, self.state) = step_particle(&self.gaussian, &self.state, gradient, seen, block, f32::ln);
    }
}

/// Steps all Gaussians that are in the picture.
pub(super) fn step_all(particles: &mut [Particle], gradients: &[GaussianBlock], in_sight: &[bool], block: &StepBlock) {
    for_each(particles, 128, |index, particle| {
        if in_sight[index] {
            particle.step(&gradients[index], block);
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
        let limit = recipe.split_scale * footprint * nearest(&gaussian, cameras, extent, recipe.near);
        if splits < MAX_SPLITS && has_room && gaussian.log_scales[axis].exp() > limit {
            kept.extend(halves(&gaussian, axis).map(|half| (half, splits + 1)));
        } else {
            refined.push(Particle::new(gaussian));
        }
    }
    refined
}

/// The least depth at which a source sees a Gaussian, relative to the median depth, 0.6 of where Gaussians begin to be
/// seen at the least. Half of that is as far as no Gaussian has to be looked at.
fn nearest(gaussian: &GaussianBlock, cameras: &[CameraBlock], extent: &Extent, near: f32) -> f32 {
    let position = Vec3::from_array(gaussian.position);
    let depths = cameras.iter().map(|camera| camera.pose.rotate_to_camera(position - camera.centre_world()).z);
    let begin = extent.near(near);
    let least = depths.filter(|depth| *depth > 0.5 * begin).fold(f32::INFINITY, f32::min);
    (least.min(1.0e6 * extent.depth) / extent.depth).max(0.6 * (begin / extent.depth))
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
