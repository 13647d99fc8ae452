//! Arrays of an optimisation in a device's memory.

use super::super::course::Course;
use super::super::harmonics::Harmonics;
use super::super::level::LevelView;
use super::super::particles::Particle;
use super::super::picture::{ENTRIES_A_GAUSSIAN, can_be_listed};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_device::parallel::for_each;
use viewfuse_device::{Device, DeviceError, Element, Later};
use viewfuse_kernels::gaussians::blend_gradient::SplatGradient;
use viewfuse_kernels::rows::{
    GaussianBlock, HarmonicTerm, ListBlock, LossBlock, ParticleState, ProjectedGaussian, SHARE_RUN, TILE_RUN, TermState,
};

/// Pixels that are enough work for a thread.
const MIN_PIXELS: usize = 4096;
/// Gaussians must be fewer: their number has 24 bits.
const MAX_GAUSSIANS: usize = 1 << 24;

/// Whether all arrays of an optimisation can be bound on a device.
pub(in crate::gaussians) fn fits<D: Device>(device: &D, course: &Course) -> bool {
    let count = course.recipe.max_count.max(course.particles.len());
    let terms = count * REST_COUNTS[course.recipe.degree.min(3) as usize] as usize;
    let pixels = |views: &Vec<LevelView>| views.iter().map(pixel_count).sum::<usize>();
    let most_pixels = course.levels.iter().map(pixels).max().unwrap_or(0);
    let cameras = course.levels.iter().flatten().map(|view| &view.camera);
    count < MAX_GAUSSIANS.min(device.most_elements::<ParticleState>())
        && cameras.into_iter().all(|camera| can_be_listed(device, camera, count))
        && terms <= device.most_elements::<TermState>()
        && most_pixels <= device.most_elements::<[f32; 4]>()
        && count * ENTRIES_A_GAUSSIAN <= device.most_elements::<SplatGradient>()
}

fn pixel_count(view: &LevelView) -> usize {
    (view.camera.width * view.camera.height) as usize
}

/// What the host needs of the Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Needed {
    /// What lower levels have: colours of degree 0.
    Blocks,
    /// What pictures and files have: so many coefficients of a channel, too.
    Scene(u32),
    /// The state of the optimisation, too.
    All,
}

/// An array before and after a step.
pub(super) struct Stepped<B> {
    pub(super) now: B,
    pub(super) next: B,
}

impl<B> Stepped<B> {
    /// After the step.
    pub(super) fn swap(&mut self) {
        std::mem::swap(&mut self.now, &mut self.next);
    }
}

/// An array of these values, and another of as many. No device has empty ones; default values, with which states begin,
/// are neither collected nor uploaded.
pub(super) fn stepped<D: Device, T: Element + PartialEq>(
    device: &D,
    values: impl Iterator<Item = T> + Clone,
) -> Result<Stepped<D::Buffer<T>>, DeviceError> {
    let count = values.clone().count().max(1);
    let is_begun = values.clone().any(|value| value != T::default());
    let now = if is_begun { device.upload_owned(values.collect())? } else { device.zeros(count)? };
    Ok(Stepped { now, next: device.zeros(count)? })
}

/// The photographs at all levels that have iterations, or at one where there is no room for all.
pub(super) struct Photographs<D: Device> {
    /// `[level][source]`: where its pixels begin; nothing of a level that is not there.
    pub(super) firsts: Vec<Vec<u32>>,
    /// `[level][source][row][column]`: red, green, blue, opacity.
    pub(super) pixels: D::Buffer<[f32; 4]>,
    /// The same of their windows, for the structural similarity.
    pub(super) means: D::Buffer<[f32; 4]>,
    pub(super) variances: D::Buffer<[f32; 4]>,
}

impl<D: Device> Photographs<D> {
    /// Those of a level, and of the others if there is room.
    pub(super) fn new(device: &D, course: &Course, needed: usize) -> Result<Photographs<D>, DeviceError> {
        let iterations = course.recipe.iterations.iter().rev();
        let mut levels: Vec<usize> = iterations
            .enumerate()
            .filter(|(level, count)| *level == needed || **count > 0)
            .map(|(level, _)| level)
            .collect();
        let count_of = |levels: &[usize]| levels.iter().flat_map(|level| &course.levels[*level]).map(pixel_count).sum();
        if count_of(&levels) > device.most_elements::<[f32; 4]>() {
            levels = vec![needed];
        }
        let count = count_of(&levels);
        let views: Vec<&LevelView> = levels.iter().flat_map(|level| &course.levels[*level]).collect();
        let pixels = device.upload_owned(joined(&views, count))?;
        let (mut means, mut variances) = (device.zeros(count)?, device.zeros(count)?);
        let (mut firsts, mut first) = (vec![Vec::new(); course.levels.len()], 0);
        for level in levels {
            for view in &course.levels[level] {
                let CameraBlock { width, height, .. } = view.camera;
                let photograph = LossBlock { width, height, first, ..LossBlock::default() };
                device.measure_windows(&photograph, &pixels, &mut means, &mut variances)?;
                firsts[level].push(first);
                first += width * height;
            }
        }
        Ok(Photographs { firsts, pixels, means, variances })
    }
}

/// Arrays for a picture of the largest photograph of a level.
pub(super) struct Level<D: Device> {
    pub(super) number: usize,
    pub(super) counts: D::Buffer<u32>,
    pub(super) before: D::Buffer<u32>,
    pub(super) sums: D::Buffer<u32>,
    pub(super) starts: D::Buffer<u32>,
    pub(super) colours: D::Buffer<[f32; 4]>,
    pub(super) depths: D::Buffer<f32>,
    pub(super) by_windows: D::Buffer<[f32; 4]>,
    pub(super) by_pixels: D::Buffer<[f32; 4]>,
    pub(super) shares: D::Buffer<[f32; 4]>,
    pub(super) share_sums: D::Buffer<[f32; 4]>,
    pub(super) bin_count: u32,
}

impl<D: Device> Level<D> {
    pub(super) fn new(device: &D, number: usize, views: &[LevelView]) -> Result<Level<D>, DeviceError> {
        let most = |of: fn(&ListBlock) -> u32| {
            let blocks = views.iter().map(|view| list_block(&view.camera, 0, 0));
            blocks.map(|block| of(&block)).max().unwrap_or(0).max(1) as usize
        };
        let (tile_count, run_count) = (most(ListBlock::tile_count), most(ListBlock::run_count));
        let count_count = most(ListBlock::most_counts);
        let pixels = views.iter().map(pixel_count).max().unwrap_or(0).max(1);
        Ok(Level {
            number,
            counts: device.zeros(count_count)?,
            before: device.zeros(count_count)?,
            sums: device.zeros(run_count * TILE_RUN as usize)?,
            starts: device.zeros(tile_count + 1)?,
            colours: device.zeros(pixels)?,
            depths: device.zeros(pixels)?,
            by_windows: device.zeros(3 * pixels)?,
            by_pixels: device.zeros(pixels)?,
            shares: device.zeros(pixels)?,
            share_sums: device.zeros(pixels.div_ceil(SHARE_RUN as usize))?,
            bin_count: most(ListBlock::bin_count) as u32,
        })
    }
}

/// `[view][row][column]`: the channels of all views.
fn joined(views: &[&LevelView], count: usize) -> Vec<[f32; 4]> {
    let mut pixels = vec![[0.0; 4]; count];
    let mut rest = &mut pixels[..];
    for view in views {
        let (of_view, others) = rest.split_at_mut(pixel_count(view));
        for_each(of_view, MIN_PIXELS, |pixel, numbers| *numbers = [0, 1, 2, 3].map(|of| view.channels[of][pixel]));
        rest = others;
    }
    pixels
}

/// A picture of a camera.
pub(super) fn list_block(camera: &CameraBlock, splat_count: u32, capacity: u32) -> ListBlock {
    ListBlock { width: camera.width, height: camera.height, splat_count, capacity }
}

/// Arrays of entries.
pub(super) struct Entries<D: Device> {
    pub(super) capacity: usize,
    pub(super) keys: D::Buffer<[u32; 2]>,
    pub(super) sorted: D::Buffer<u32>,
    pub(super) sums: D::Buffer<SplatGradient>,
}

impl<D: Device> Entries<D> {
    pub(super) fn new(device: &D, capacity: usize) -> Result<Entries<D>, DeviceError> {
        let capacity = capacity.max(1);
        let (keys, sorted) = (device.zeros(capacity)?, device.zeros(capacity)?);
        Ok(Entries { capacity, keys, sorted, sums: device.zeros(capacity)? })
    }
}

/// The Gaussians on the device.
pub(super) struct Particles<D: Device> {
    pub(super) count: u32,
    /// Terms of each Gaussian in the array of all.
    pub(super) term_count: u32,
    pub(super) gaussians: Stepped<D::Buffer<GaussianBlock>>,
    pub(super) states: Stepped<D::Buffer<ParticleState>>,
    pub(super) terms: Stepped<D::Buffer<HarmonicTerm>>,
    pub(super) term_states: Stepped<D::Buffer<TermState>>,
    pub(super) splats: D::Buffer<ProjectedGaussian>,
    pub(super) gradients: D::Buffer<GaussianBlock>,
    pub(super) masks: D::Buffer<u32>,
}

impl<D: Device> Particles<D> {
    pub(super) fn new(
        device: &D,
        course: &Course,
        term_count: u32,
        bin_count: u32,
    ) -> Result<Particles<D>, DeviceError> {
        let all = &course.particles;
        let terms = all.iter().flat_map(|particle| first_of(&particle.harmonics.terms, term_count));
        let term_states = all.iter().flat_map(|particle| first_of(&particle.harmonics.states, term_count));
        let count = all.len() as u32;
        let mask_count = list_block(&CameraBlock::default(), count, 0).mask_count();
        Ok(Particles {
            count,
            term_count,
            gaussians: stepped(device, all.iter().map(|particle| particle.gaussian))?,
            states: stepped(device, all.iter().map(|particle| particle.state))?,
            terms: stepped(device, terms)?,
            term_states: stepped(device, term_states)?,
            splats: device.zeros(all.len().max(1))?,
            gradients: device.zeros(all.len().max(1))?,
            masks: device.zeros((bin_count * mask_count).max(1) as usize)?,
        })
    }

    /// What the host needs of them as they are now, to be waited for later. What it does not need is as at the beginning
    /// of an optimisation.
    pub(super) fn later<'d>(
        &self,
        device: &'d D,
        needed: Needed,
    ) -> Result<impl FnOnce() -> Result<Vec<Particle>, DeviceError> + use<'d, D>, DeviceError> {
        let (term_count, count) = (self.term_count as usize, self.count as usize);
        let gaussians = device.download_later(&self.gaussians.now)?;
        let has_terms = term_count > 0 && !matches!(needed, Needed::Blocks | Needed::Scene(0));
        let terms = later_if(device, &self.terms.now, has_terms)?;
        let states = later_if(device, &self.states.now, needed == Needed::All)?;
        let term_states = later_if(device, &self.term_states.now, term_count > 0 && needed == Needed::All)?;
        Ok(move || {
            let (gaussians, terms) = (gaussians.get()?, arrived(terms)?);
            let (states, term_states) = (arrived(states)?, arrived(term_states)?);
            let particle = |(index, gaussian): (usize, GaussianBlock)| {
                let state = states.get(index).copied().unwrap_or_default();
                let there = match needed {
                    Needed::Blocks => 0,
                    Needed::Scene(there) => there as usize,
                    Needed::All => state.rest_count as usize,
                };
                let first = if has_terms { index * term_count } else { 0 };
                let those = first..first + there.min(term_count);
                let mut harmonics = Harmonics::begun(terms[those.clone()].to_vec());
                if needed == Needed::All {
                    harmonics.states.copy_from_slice(&term_states[those]);
                }
                Particle { gaussian, harmonics, state }
            };
            Ok(gaussians.into_iter().take(count).enumerate().map(particle).collect())
        })
    }
}

/// So many elements, the last of them defaults if there are fewer.
fn first_of<T: Element>(elements: &[T], count: u32) -> impl Iterator<Item = T> + Clone {
    (0..count as usize).map(|index| elements.get(index).copied().unwrap_or_default())
}

/// An array to be waited for later, where it is needed.
fn later_if<'d, D: Device, T: Element>(
    device: &'d D,
    buffer: &D::Buffer<T>,
    is_needed: bool,
) -> Result<Option<Later<'d, T>>, DeviceError> {
    is_needed.then(|| device.download_later(buffer)).transpose()
}

/// What was needed; nothing where it was not.
fn arrived<T>(later: Option<Later<'_, T>>) -> Result<Vec<T>, DeviceError> {
    later.map_or_else(|| Ok(Vec::new()), Later::get)
}
