//! An optimisation whose iterations are a device's own: Gaussians, photographs, lists of tiles, the loss and the steps
//! stay in its memory.
//!
//! An iteration is 15 dispatches, 16 with spherical harmonics; nothing is uploaded for it and nothing downloaded. The
//! device does not tell how many entries the lists of a picture have, so there is a capacity for them: every
//! [`ROUND`] iterations the host reads 12 bytes, whether it sufficed. From the first picture on for which it did not,
//! nothing was stepped; the host then enlarges the lists and dispatches the iterations from that one on again, so that
//! results do not depend on the capacity. The Gaussians come back to the host when their number changes, and when they
//! are asked for.

use super::course::{Course, Optimisation, Optimised, Plan};
use super::harmonics::Harmonics;
use super::level::LevelView;
use super::particles::Particle;
use crate::FieldError;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_device::{Device, DeviceError, Element};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::gaussians::blend_gradient::SplatGradient;
use viewfuse_kernels::gaussians::lists::ListStatus;
use viewfuse_kernels::rows::{
    GainBlock, GainStepBlock, GaussianBlock, HarmonicTerm, LIST_PARTS, ListBlock, LossBlock, ParticleBlock,
    ParticleState, ProjectedGaussian, SHARE_RUN, STATUS_NUMBERS, SplatBlock, StepBlock,
};
use viewfuse_scene::gaussians::GaussianScene;

/// Iterations after which the host sees whether the lists had room.
const ROUND: usize = 32;
/// Entries that there is room for at first: so many for each Gaussian, and at least these.
const ENTRIES_A_GAUSSIAN: usize = 8;
const MIN_ENTRIES: usize = 4096;
/// Gaussians must be fewer: their number has 24 bits.
const MAX_GAUSSIANS: usize = 1 << 24;

/// Whether all arrays of an optimisation can be bound on a device.
pub(super) fn fits<D: Device>(device: &D, course: &Course) -> bool {
    let count = course.recipe.max_count.max(course.particles.len());
    let terms = count * REST_COUNTS[course.recipe.degree.min(3) as usize] as usize;
    let pixels = |views: &Vec<LevelView>| views.iter().map(pixel_count).sum::<usize>();
    let most_pixels = course.levels.iter().map(pixels).max().unwrap_or(0);
    let most_elements = device.most_elements::<ParticleState>();
    count < MAX_GAUSSIANS.min(most_elements)
        && terms <= device.most_elements::<HarmonicTerm>()
        && most_pixels <= device.most_elements::<[f32; 4]>()
        && count * ENTRIES_A_GAUSSIAN <= device.most_elements::<SplatGradient>()
}

fn pixel_count(view: &LevelView) -> usize {
    (view.camera.width * view.camera.height) as usize
}

/// An array before and after a step.
struct Stepped<B> {
    now: B,
    next: B,
}

impl<B> Stepped<B> {
    fn swap(&mut self) {
        std::mem::swap(&mut self.now, &mut self.next);
    }
}

/// An array of these values, and another of as many. No device has empty ones.
fn stepped<D: Device, T: Element>(device: &D, values: &[T]) -> Result<Stepped<D::Buffer<T>>, DeviceError> {
    let now = if values.is_empty() { device.zeros(1)? } else { device.upload(values)? };
    Ok(Stepped { now, next: device.zeros(values.len().max(1))? })
}

/// The photographs of a level, and arrays for a picture of the largest of them.
struct Level<D: Device> {
    number: usize,
    /// `[source]`: where its pixels begin.
    firsts: Vec<u32>,
    photographs: D::Buffer<[f32; 4]>,
    means: D::Buffer<[f32; 4]>,
    variances: D::Buffer<[f32; 4]>,
    counts: D::Buffer<u32>,
    sums: D::Buffer<u32>,
    starts: D::Buffer<u32>,
    colours: D::Buffer<[f32; 4]>,
    depths: D::Buffer<f32>,
    by_windows: D::Buffer<[f32; 4]>,
    by_pixels: D::Buffer<[f32; 4]>,
    shares: D::Buffer<[f32; 4]>,
    share_sums: D::Buffer<[f32; 4]>,
    bin_count: u32,
}

impl<D: Device> Level<D> {
    fn new(device: &D, number: usize, views: &[LevelView]) -> Result<Level<D>, DeviceError> {
        let (mut photographs, mut means, mut variances) = (Vec::new(), Vec::new(), Vec::new());
        let mut firsts = Vec::new();
        for view in views {
            firsts.push(photographs.len() as u32);
            let of = |channels: [&[f32]; 4], pixel: usize| {
                channels.map(|channel| channel.get(pixel).copied().unwrap_or(0.0))
            };
            let [red, green, blue] = &view.structure;
            let [a, b, c, d] = &view.channels;
            for pixel in 0..pixel_count(view) {
                photographs.push(of([a, b, c, d], pixel));
                means.push(of([&red.means, &green.means, &blue.means, &[]], pixel));
                variances.push(of([&red.variances, &green.variances, &blue.variances, &[]], pixel));
            }
        }
        let most = |of: fn(&ListBlock) -> u32| {
            let blocks = views.iter().map(|view| list_block(&view.camera, 0, 0));
            blocks.map(|block| of(&block)).max().unwrap_or(0).max(1) as usize
        };
        let (tile_count, run_count) = (most(ListBlock::tile_count), most(ListBlock::run_count));
        let pixels = views.iter().map(pixel_count).max().unwrap_or(0).max(1);
        Ok(Level {
            number,
            firsts,
            photographs: device.upload_owned(photographs)?,
            means: device.upload_owned(means)?,
            variances: device.upload_owned(variances)?,
            counts: device.zeros(tile_count * LIST_PARTS as usize)?,
            sums: device.zeros(run_count)?,
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

fn list_block(camera: &CameraBlock, splat_count: u32, capacity: u32) -> ListBlock {
    ListBlock { width: camera.width, height: camera.height, splat_count, capacity }
}

/// Arrays of entries.
struct Entries<D: Device> {
    capacity: usize,
    keys: D::Buffer<[u32; 2]>,
    sorted: D::Buffer<u32>,
    sums: D::Buffer<SplatGradient>,
}

impl<D: Device> Entries<D> {
    fn new(device: &D, capacity: usize) -> Result<Entries<D>, DeviceError> {
        let capacity = capacity.max(1);
        let (keys, sorted) = (device.zeros(capacity)?, device.zeros(capacity)?);
        Ok(Entries { capacity, keys, sorted, sums: device.zeros(capacity)? })
    }
}

/// The Gaussians on the device.
struct Particles<D: Device> {
    count: u32,
    /// Terms of each Gaussian in the array of all.
    term_count: u32,
    gaussians: Stepped<D::Buffer<GaussianBlock>>,
    states: Stepped<D::Buffer<ParticleState>>,
    terms: Stepped<D::Buffer<HarmonicTerm>>,
    gains: Stepped<D::Buffer<GainBlock>>,
    splats: D::Buffer<ProjectedGaussian>,
    gradients: D::Buffer<GaussianBlock>,
    masks: D::Buffer<u32>,
}

impl<D: Device> Particles<D> {
    fn new(device: &D, course: &Course, term_count: u32, bin_count: u32) -> Result<Particles<D>, DeviceError> {
        let all = &course.particles;
        let gaussians: Vec<GaussianBlock> = all.iter().map(|particle| particle.gaussian).collect();
        let states: Vec<ParticleState> = all.iter().map(|particle| particle.state).collect();
        let term =
            |particle: &Particle, index: u32| particle.harmonics.0.get(index as usize).copied().unwrap_or_default();
        let terms: Vec<HarmonicTerm> =
            all.iter().flat_map(|particle| (0..term_count).map(move |index| term(particle, index))).collect();
        let count = all.len() as u32;
        let mask_count = list_block(&CameraBlock::default(), count, 0).mask_count();
        Ok(Particles {
            count,
            term_count,
            gaussians: stepped(device, &gaussians)?,
            states: stepped(device, &states)?,
            terms: stepped(device, &terms)?,
            gains: stepped(device, &course.gains)?,
            splats: device.zeros(all.len().max(1))?,
            gradients: device.zeros(all.len().max(1))?,
            masks: device.zeros((bin_count * mask_count).max(1) as usize)?,
        })
    }

    /// As they are now.
    fn download(&self, device: &D) -> Result<Vec<Particle>, DeviceError> {
        let gaussians = device.download(&self.gaussians.now)?;
        let states = device.download(&self.states.now)?;
        let terms = if self.term_count > 0 { device.download(&self.terms.now)? } else { Vec::new() };
        let particle = |(index, (gaussian, state)): (usize, (GaussianBlock, ParticleState))| {
            let first = index * self.term_count as usize;
            let count = state.rest_count.min(self.term_count) as usize;
            Particle { gaussian, harmonics: Harmonics(terms[first..first + count].to_vec()), state }
        };
        let all = gaussians.into_iter().zip(states).take(self.count as usize);
        Ok(all.enumerate().map(particle).collect())
    }
}

/// An optimisation on a device.
pub(super) struct Resident<'d, D: Device> {
    device: &'d D,
    course: Course,
    /// What the lists have room for at first.
    first_capacity: Option<usize>,
    level: Option<Level<D>>,
    particles: Option<Particles<D>>,
    entries: Option<Entries<D>>,
    status: Option<Stepped<D::Buffer<u32>>>,
    /// Iterations that are dispatched, of which it is not yet known whether the lists had room.
    pending: Vec<Plan>,
}

impl<'d, D: Device> Resident<'d, D> {
    pub(super) fn new(device: &'d D, course: Course, first_capacity: Option<usize>) -> Resident<'d, D> {
        let (level, particles, entries, status, pending) = (None, None, None, None, Vec::new());
        Resident { device, course, first_capacity, level, particles, entries, status, pending }
    }

    /// Takes what an iteration needs to the device, as far as it is not there.
    fn load(&mut self, plan: &Plan) -> Result<(), DeviceError> {
        let (device, course) = (self.device, &self.course);
        let level = match self.level.take().filter(|level| level.number == plan.level) {
            Some(level) => level,
            None => Level::new(device, plan.level, &course.levels[plan.level])?,
        };
        if self.particles.is_none() {
            // Harmonics are optimised at the finest level.
            let degree = if plan.level == 0 { course.recipe.degree.min(3) } else { 0 };
            let there = course.particles.iter().map(|particle| particle.harmonics.count()).max().unwrap_or(0) as u32;
            let term_count = REST_COUNTS[degree as usize].max(there);
            self.particles = Some(Particles::new(device, course, term_count, level.bin_count)?);
            let usual = (course.particles.len() * ENTRIES_A_GAUSSIAN).max(MIN_ENTRIES);
            let least = self.first_capacity.unwrap_or(usual).min(device.most_elements::<SplatGradient>());
            if self.entries.as_ref().is_none_or(|entries| entries.capacity < least) {
                self.entries = Some(Entries::new(device, least)?);
            }
        }
        if self.status.is_none() {
            self.status = Some(stepped(device, &[0; STATUS_NUMBERS as usize])?);
        }
        self.level = Some(level);
        Ok(())
    }

    /// Dispatches an iteration.
    fn dispatch(&mut self, plan: &Plan) -> Result<(), DeviceError> {
        let (device, near, background) = (self.device, self.course.near, self.course.background);
        let (Some(level), Some(particles)) = (&mut self.level, &mut self.particles) else { return Ok(()) };
        let (Some(entries), Some(status)) = (&mut self.entries, &mut self.status) else { return Ok(()) };
        let Particles { count: gaussian_count, term_count, gaussians, states, terms, gains, .. } = particles;
        let (gaussian_count, term_count) = (*gaussian_count, *term_count);
        let (splats, gradients, masks) = (&mut particles.splats, &mut particles.gradients, &mut particles.masks);
        let camera = CameraBlock { first_texel: 0, ..plan.step.camera };
        let projected = ParticleBlock { camera, near, gaussian_count, term_count, padding: 0 };
        device.project_particles(&projected, &gaussians.now, &states.now, &terms.now, splats)?;

        let lists = list_block(&camera, gaussian_count, entries.capacity as u32);
        let (counts, starts) = (&mut level.counts, &mut level.starts);
        device.mark_bins(&lists, splats, masks)?;
        device.count_entries(&lists, splats, masks, counts)?;
        device.sum_entries(&lists, counts, &mut level.sums)?;
        device.start_tiles(&lists, counts, &level.sums, &status.now, starts, &mut status.next)?;
        status.swap();
        device.list_entries(&lists, splats, masks, starts, counts, &mut entries.keys)?;
        device.sort_entries(&lists, starts, &entries.keys, &mut entries.sorted)?;

        let tiles = lists.tiles(background);
        device.blend_splats(&tiles, starts, &entries.sorted, splats, &mut level.colours, &mut level.depths)?;
        let loss = LossBlock { first: level.firsts[plan.source], ..plan.loss };
        let (colours, photographs) = (&level.colours, &level.photographs);
        if loss.structure_share > 0.0 {
            let (means, variances) = (&level.means, &level.variances);
            device.compare_windows(&loss, colours, photographs, means, variances, &gains.now, &mut level.by_windows)?;
        }
        let (by_pixels, shares) = (&mut level.by_pixels, &mut level.shares);
        device.compare_pixels(&loss, colours, photographs, &level.by_windows, &gains.now, by_pixels, shares)?;

        device.blend_gradient(&tiles, starts, &entries.sorted, splats, colours, by_pixels, &mut entries.sums)?;
        let projected = SplatBlock { camera, near, gaussian_count, padding: [0; 2] };
        let (sorted, sums) = (&entries.sorted, &entries.sums);
        device.gather_gradients(&projected, &gaussians.now, splats, starts, sorted, sums, gradients)?;
        let step = StepBlock { camera, ..plan.step }.with_counts(gaussian_count, term_count);
        let (before, after) = (&gaussians.now, &mut gaussians.next);
        device.step_particles(&step, before, &states.now, splats, gradients, &status.now, after, &mut states.next)?;
        if step.degree > 0 && term_count > 0 {
            let (now, next) = (&terms.now, &mut terms.next);
            device.step_harmonics(&step, before, &states.now, splats, gradients, &status.now, now, next)?;
            terms.swap();
        }
        gaussians.swap();
        states.swap();

        let pixel_count = camera.width * camera.height;
        device.sum_shares(&pixel_count, &level.shares, &mut level.share_sums)?;
        let gain = GainStepBlock {
            source: loss.source,
            gain_count: self.course.gains.len() as u32,
            run_count: pixel_count.div_ceil(SHARE_RUN),
            rate: plan.gain_rate,
            factor: loss.factor,
            padding: [0; 3],
        };
        device.step_gains(&gain, &level.share_sums, &status.now, &gains.now, &mut gains.next)?;
        gains.swap();
        Ok(())
    }

    /// Sees to it that all iterations so far are done: those from the first one on whose lists had no room are
    /// dispatched again, with longer lists.
    fn settle(&mut self) -> Result<(), DeviceError> {
        while !self.pending.is_empty() {
            let Some(status) = &mut self.status else { return Ok(()) };
            let numbers = self.device.download(&status.now)?;
            let [is_over, done, most] = [0, 1, 2].map(|number| numbers.get(number).copied().unwrap_or(0));
            status.now = self.device.zeros(STATUS_NUMBERS as usize)?;
            let status = ListStatus::of([is_over, done, most]);
            if !status.is_over {
                self.pending.clear();
                return Ok(());
            }
            self.pending.drain(..(status.done as usize).min(self.pending.len()));
            let most = status.most as usize;
            self.entries = None;
            self.entries = Some(Entries::new(self.device, most + most / 4)?);
            for plan in self.pending.clone() {
                self.dispatch(&plan)?;
            }
        }
        Ok(())
    }

    /// The Gaussians and gains to the host. They stay on the device, too.
    fn bring(&mut self) -> Result<(), DeviceError> {
        self.settle()?;
        if let Some(particles) = &self.particles {
            self.course.particles = particles.download(self.device)?;
            self.course.gains = self.device.download(&particles.gains.now)?;
        }
        Ok(())
    }

    fn iterate(&mut self) -> Result<(), DeviceError> {
        if self.course.changes() {
            self.bring()?;
            self.particles = None;
        }
        let plan = self.course.plan();
        self.load(&plan)?;
        self.pending.push(plan);
        self.dispatch(&plan)?;
        if self.pending.len() >= ROUND { self.settle() } else { Ok(()) }
    }
}

impl<D: Device> Optimisation for Resident<'_, D> {
    fn weigh(&mut self, weights: &[f32]) {
        self.course.weigh(weights);
    }

    fn resume(&mut self, scene: &GaussianScene) {
        (self.particles, self.pending) = (None, Vec::new());
        self.status = None;
        self.course.resume(scene);
    }

    fn extend(&mut self, iterations: u32) {
        self.course.extend(iterations);
    }

    fn set_finest(&mut self, iterations: u32) {
        self.course.set_finest(iterations);
    }

    fn done_at_finest(&self) -> u32 {
        self.course.done_at_finest()
    }

    fn done(&self) -> u32 {
        self.course.iteration
    }

    fn iteration_count(&self) -> u32 {
        self.course.iteration_count()
    }

    fn run_to(&mut self, iteration: u32, progress: &dyn Progress) -> Result<(), FieldError> {
        let end = iteration.min(self.iteration_count());
        progress.expect(end.saturating_sub(self.done()) as usize);
        while self.done() < end {
            progress.check()?;
            self.iterate()?;
            progress.step();
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), FieldError> {
        self.settle()?;
        Ok(self.device.finish()?)
    }

    fn optimised(&mut self) -> Result<Optimised, FieldError> {
        self.bring()?;
        Ok(self.course.optimised())
    }
}
