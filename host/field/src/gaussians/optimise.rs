//! The loop: a source at a time is drawn, compared with its photograph, and what made it is stepped. Where a device's
//! memory is the host's, the host makes lists, loss and steps; elsewhere all of an iteration is the device's
//! ([`resident`](super::resident)).

use super::course::{Course, Optimisation, Optimised, Plan, Steps};
use super::level::LevelView;
use super::loss::{Pair, gradient};
use super::particles::step_all;
use super::picture::Splatter;
use super::recipe::Recipe;
use super::resident::{Resident, fits};
use crate::FieldError;
use crate::point_cloud::CloudPoint;
use viewfuse_device::Device;
use viewfuse_device::cpu::Cpu;
use viewfuse_device::parallel::{for_each, map};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::gaussians::steps::step_gain;
use viewfuse_kernels::rows::{GaussianBlock, LossBlock};
use viewfuse_scene::photographs::SourceImages;

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
) -> Result<Option<Optimisation<'d>>, FieldError> {
    match device.is_software() {
        true => optimisation_by_host(&Cpu, images, points, recipe),
        false => optimisation_on_device(device, images, points, recipe, None),
    }
}

/// An optimisation whose lists, loss and steps are the host's, with the kernels of its pictures and their derivatives
/// on a device: what [`optimisation`] takes for the CPU.
///
/// # Errors
/// [`FieldError`].
pub fn optimisation_by_host<'d, D: Device>(
    device: &'d D,
    images: &SourceImages,
    points: &[CloudPoint],
    recipe: Recipe,
) -> Result<Option<Optimisation<'d>>, FieldError> {
    let course = Course::new(images, points, recipe)?;
    Ok(course.map(|course| Optimisation::new(course, ByHost { device })))
}

/// An optimisation whose iterations are a device's own: what [`optimisation`] takes for a GPU. The lists of a picture's
/// tiles have room for so many entries at first, or for what pictures usually have; results do not depend on it. A
/// scene that is too large for this on the device is optimised by [`optimisation_by_host`].
///
/// # Errors
/// [`FieldError`].
pub fn optimisation_on_device<'d, D: Device>(
    device: &'d D,
    images: &SourceImages,
    points: &[CloudPoint],
    recipe: Recipe,
    capacity: Option<usize>,
) -> Result<Option<Optimisation<'d>>, FieldError> {
    let Some(course) = Course::new(images, points, recipe)? else { return Ok(None) };
    Ok(Some(match fits(device, &course) {
        true => Optimisation::new(course, Resident::new(device, capacity)),
        false => Optimisation::new(course, ByHost { device }),
    }))
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
    optimisation.optimised().map(Some)
}

/// Lists, loss and steps by the host.
struct ByHost<'d, D> {
    device: &'d D,
}

impl<D: Device> Steps for ByHost<'_, D> {
    fn iterate(&mut self, course: &mut Course) -> Result<(), FieldError> {
        let Plan { level, source, step, loss, gain_rate } = course.plan();
        let device = self.device;
        let Course { near, background, recipe: Recipe { is_antialiased, .. }, .. } = *course;
        let splatter = Splatter { device, near, background, is_antialiased, harmonics: None };
        let view = &course.levels[level][source];
        let mut gaussians = vec![GaussianBlock::default(); course.particles.len()];
        for_each(&mut gaussians, 256, |index, gaussian| *gaussian = course.particles[index].block(&view.camera));
        let uploaded = device.upload(&gaussians)?;
        let picture = splatter.picture(&uploaded, gaussians.len(), &view.camera)?;
        let colours = device.download(&picture.colours)?;
        let (by_pixels, by_gain) = by_pixels(&colours, view, course.gains[source].value, &loss);
        let gradients = splatter.gradients(&uploaded, &picture, &by_pixels)?;
        step_all(&mut course.particles, &gradients, &picture.lists.in_sight, &step);
        course.gains[source] = step_gain(&course.gains[source], by_gain, gain_rate);
        course.level_gains();
        Ok(())
    }
}

/// Derivatives of the loss by the picture's pixels and by the source's gain.
fn by_pixels(colours: &[[f32; 4]], view: &LevelView, gain: [f32; 3], loss: &LossBlock) -> (Vec<[f32; 4]>, [f32; 3]) {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let factor = loss.factor;
    let structures = view.structure();
    let channels = map(3, 1, |channel| {
        let mut picture: Vec<f32> = colours.iter().map(|colour| colour[channel] * gain[channel]).collect();
        let (photograph, structure, seen) = (&view.channels[channel], &structures[channel], &view.seen[..]);
        // What the photograph does not show is the same in both: windows that hold some of it compare the rest.
        let pixels = picture.iter_mut().zip(photograph).zip(seen);
        pixels.filter(|(_, seen)| **seen == 0.0).for_each(|((x, y), _)| *x = *y);
        gradient(&Pair { picture: &picture, photograph, structure, seen, width, height }, loss.structure_share)
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
    if view.seen.is_empty() && loss.silhouette_share > 0.0 && view.has_silhouette {
        for ((by, colour), alpha) in by_pixels.iter_mut().zip(colours).zip(&view.channels[3]) {
            by[3] = 3.0 * factor * loss.silhouette_share * ((colour[3] - alpha) / 0.01).clamp(-1.0, 1.0);
        }
    }
    (by_pixels, by_gain)
}
