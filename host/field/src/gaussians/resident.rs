//! An optimisation whose iterations are a device's own: Gaussians, photographs, lists of tiles, the loss and the steps
//! stay in its memory.
//!
//! An iteration is 15 dispatches, 16 with spherical harmonics; nothing is uploaded for it and nothing downloaded. The
//! device does not tell how many entries the lists of a picture have, so there is a capacity for them: every
//! [`ROUND`] iterations the host reads 12 bytes, whether it sufficed. From the first picture on for which it did not,
//! nothing was stepped; the host then enlarges the lists and dispatches the iterations from that one on again, so that
//! results do not depend on the capacity. The Gaussians come back to the host when their number changes, and when they
//! are asked for.

mod arrays;

use super::course::{Course, Plan, Steps};
use super::particles::Particle;
use super::picture::{ENTRIES_A_GAUSSIAN, MIN_ENTRIES};
use crate::FieldError;
use arrays::{Entries, Level, Needed, Particles, Photographs, Stepped, list_block, stepped};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_device::{Device, DeviceError, Later};
use viewfuse_kernels::gaussians::blend_gradient::SplatGradient;
use viewfuse_kernels::gaussians::lists::ListStatus;
use viewfuse_kernels::rows::{
    GainBlock, GainStepBlock, LossBlock, ParticleBlock, SHARE_RUN, STATUS_NUMBERS, SplatBlock, StepBlock,
};

pub(super) use arrays::fits;

/// Iterations after which the host sees whether the lists had room: with more of them it waits less often, and more are
/// dispatched in vain where they had none.
const ROUND: usize = 128;

/// What an optimisation has on a device.
pub(super) struct Resident<'d, D: Device> {
    device: &'d D,
    /// What the lists have room for at first.
    first_capacity: Option<usize>,
    photographs: Option<Photographs<D>>,
    level: Option<Level<D>>,
    gains: Option<Stepped<D::Buffer<GainBlock>>>,
    particles: Option<Particles<D>>,
    /// The most coefficients of a channel beyond degree 0 that a Gaussian has.
    rest_count: u32,
    entries: Option<Entries<D>>,
    status: Option<Stepped<D::Buffer<u32>>>,
    /// Iterations that are dispatched, of which it is not yet known whether the lists had room.
    pending: Vec<Plan>,
    /// What was asked for after the last of them.
    asked: Option<Asked<'d>>,
}

/// What is on its way to the host.
struct Asked<'d> {
    needed: Needed,
    particles: Option<Coming<'d>>,
    gains: Option<Later<'d, GainBlock>>,
    status: Option<Later<'d, u32>>,
}

/// Gaussians on their way.
type Coming<'d> = Box<dyn FnOnce() -> Result<Vec<Particle>, DeviceError> + 'd>;

impl<'d, D: Device> Resident<'d, D> {
    pub(super) fn new(device: &'d D, first_capacity: Option<usize>) -> Resident<'d, D> {
        Resident {
            device,
            first_capacity,
            photographs: None,
            level: None,
            gains: None,
            particles: None,
            rest_count: 0,
            entries: None,
            status: None,
            pending: Vec::new(),
            asked: None,
        }
    }

    /// Takes what an iteration needs to the device, as far as it is not there.
    fn load(&mut self, course: &Course, plan: &Plan) -> Result<(), DeviceError> {
        let device = self.device;
        if self.photographs.as_ref().is_none_or(|photographs| photographs.firsts[plan.level].is_empty()) {
            self.photographs = None;
            self.photographs = Some(Photographs::new(device, course, plan.level)?);
        }
        if self.gains.is_none() {
            self.gains = Some(stepped(device, course.gains.iter().copied())?);
        }
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
            self.rest_count = there;
            let usual = (course.particles.len() * ENTRIES_A_GAUSSIAN).max(MIN_ENTRIES);
            let least = self.first_capacity.unwrap_or(usual).min(device.most_elements::<SplatGradient>());
            if self.entries.as_ref().is_none_or(|entries| entries.capacity < least) {
                self.entries = Some(Entries::new(device, least)?);
            }
        }
        if self.status.is_none() {
            self.status = Some(stepped(device, [0; STATUS_NUMBERS as usize].into_iter())?);
        }
        self.level = Some(level);
        Ok(())
    }

    /// Dispatches an iteration.
    fn dispatch(&mut self, course: &Course, plan: &Plan) -> Result<(), DeviceError> {
        let (device, near, background) = (self.device, course.near, course.background);
        let is_antialiased = u32::from(course.recipe.is_antialiased);
        let (Some(level), Some(particles)) = (&mut self.level, &mut self.particles) else { return Ok(()) };
        let (Some(entries), Some(status)) = (&mut self.entries, &mut self.status) else { return Ok(()) };
        let (Some(photographs), Some(gains)) = (&self.photographs, &mut self.gains) else { return Ok(()) };
        let Particles { count: gaussian_count, term_count, gaussians, states, terms, term_states, .. } = particles;
        let (gaussian_count, term_count) = (*gaussian_count, *term_count);
        let (splats, gradients, masks) = (&mut particles.splats, &mut particles.gradients, &mut particles.masks);
        let camera = CameraBlock { first_texel: 0, ..plan.step.camera };
        let projected = ParticleBlock { camera, near, gaussian_count, term_count, is_antialiased, has_states: 1 };
        device.project_particles(&projected, &gaussians.now, &terms.now, Some(&states.now), splats)?;

        let lists = list_block(&camera, gaussian_count, entries.capacity as u32);
        let (counts, before, starts) = (&mut level.counts, &mut level.before, &mut level.starts);
        device.mark_bins(&lists, splats, masks)?;
        device.count_entries(&lists, splats, masks, counts)?;
        device.sum_entries(&lists, counts, before, &mut level.sums)?;
        device.start_tiles(&lists, &level.sums, &status.now, starts, &mut status.next)?;
        status.swap();
        device.list_entries(&lists, splats, masks, starts, before, &mut entries.keys)?;
        device.sort_entries(&lists, starts, &entries.keys, &mut entries.sorted)?;

        let tiles = lists.tiles(background);
        device.blend_splats(&tiles, starts, &entries.sorted, splats, &mut level.colours, &mut level.depths)?;
        let loss = LossBlock { first: photographs.firsts[plan.level][plan.source], ..plan.loss };
        let (colours, Photographs { pixels, means, variances, .. }) = (&level.colours, photographs);
        if loss.structure_share > 0.0 {
            device.compare_windows(&loss, colours, pixels, means, variances, &gains.now, &mut level.by_windows)?;
        }
        let (by_pixels, shares) = (&mut level.by_pixels, &mut level.shares);
        device.compare_pixels(&loss, colours, pixels, &level.by_windows, &gains.now, by_pixels, shares)?;

        device.blend_gradient(&tiles, starts, &entries.sorted, splats, colours, by_pixels, &mut entries.sums)?;
        let projected = SplatBlock { camera, near, gaussian_count, is_antialiased, padding: 0 };
        let (sorted, sums) = (&entries.sorted, &entries.sums);
        device.gather_gradients(&projected, &gaussians.now, splats, starts, sorted, sums, gradients)?;
        let step = StepBlock { camera, ..plan.step }.with_counts(gaussian_count, term_count);
        let (before, after) = (&gaussians.now, &mut gaussians.next);
        device.step_particles(&step, before, &states.now, splats, gradients, &status.now, after, &mut states.next)?;
        if step.degree > 0 && term_count > 0 {
            let (terms_now, states_now) = (&terms.now, &term_states.now);
            let (terms_next, states_next) = (&mut terms.next, &mut term_states.next);
            device.step_harmonics(
                &step, before, &states.now, splats, gradients, &status.now, terms_now, states_now, terms_next,
                states_next,
            )?;
            terms.swap();
            term_states.swap();
        }
        gaussians.swap();
        states.swap();

        let pixel_count = camera.width * camera.height;
        device.sum_shares(&pixel_count, &level.shares, &mut level.share_sums)?;
        let gain = GainStepBlock {
            source: loss.source,
            gain_count: course.gains.len() as u32,
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
    /// dispatched again, with longer lists. Returns whether there were some. `asked` is the status, if it was asked for.
    fn settle(&mut self, course: &Course, mut asked: Option<Later<'d, u32>>) -> Result<bool, DeviceError> {
        let mut changes = false;
        while !self.pending.is_empty() {
            let Some(status) = &mut self.status else { break };
            let numbers = match asked.take() {
                Some(asked) => asked.get()?,
                None => self.device.download(&status.now)?,
            };
            let [is_over, done, most] = [0, 1, 2].map(|number| numbers.get(number).copied().unwrap_or(0));
            status.now = self.device.zeros(STATUS_NUMBERS as usize)?;
            let status = ListStatus::of([is_over, done, most]);
            if !status.is_over {
                self.pending.clear();
                break;
            }
            changes = true;
            self.asked = None;
            self.pending.drain(..(status.done as usize).min(self.pending.len()));
            let most = status.most as usize;
            self.entries = None;
            self.entries = Some(Entries::new(self.device, most + most / 4)?);
            for plan in self.pending.clone() {
                self.dispatch(course, &plan)?;
            }
        }
        Ok(changes)
    }

    /// Asks for what is needed of the Gaussians, with the status, if that is not on its way.
    fn ask_for(&mut self, needed: Needed) -> Result<Asked<'d>, DeviceError> {
        if let Some(asked) = self.asked.take().filter(|asked| asked.needed == needed) {
            return Ok(asked);
        }
        let device = self.device;
        let particles = match &self.particles {
            Some(particles) => Some(Box::new(particles.later(device, needed)?) as Coming<'d>),
            None => None,
        };
        let status = match &self.status {
            Some(status) if !self.pending.is_empty() => Some(device.download_later(&status.now)?),
            _ => None,
        };
        // Nothing on the host depends on the gains before the end.
        let gains = match (&self.gains, needed) {
            (Some(gains), Needed::Scene(_)) => Some(device.download_later(&gains.now)?),
            _ => None,
        };
        Ok(Asked { needed, particles, gains, status })
    }

    /// Gives the course what is needed of the Gaussians, and at the end the gains. They stay on the device, too.
    fn give(&mut self, course: &mut Course, needed: Needed) -> Result<(), DeviceError> {
        // They come with the status, and a second time where that says that they are not there yet.
        let mut asked = self.ask_for(needed)?;
        if self.settle(course, asked.status.take())? {
            asked = self.ask_for(needed)?;
        }
        if let Some(arrived) = asked.particles {
            course.particles = arrived()?;
        }
        if let Some(gains) = asked.gains {
            course.gains = gains.get()?;
        }
        Ok(())
    }

    /// What the host needs of the Gaussians before the next iteration, or at the end.
    fn needed(&self, course: &Course) -> Needed {
        match course.is_done() {
            true => Needed::Scene(self.rest_count),
            // What grows goes on with its states; a level begins without any.
            false if course.begins_level() => Needed::Blocks,
            false => Needed::All,
        }
    }
}

impl<D: Device> Steps for Resident<'_, D> {
    fn iterate(&mut self, course: &mut Course) -> Result<(), FieldError> {
        if course.changes() {
            self.give(course, self.needed(course))?;
            self.particles = None;
        }
        let plan = course.plan();
        self.load(course, &plan)?;
        self.rest_count = self.rest_count.max(REST_COUNTS[plan.step.degree as usize]);
        self.pending.push(plan);
        self.asked = None;
        self.dispatch(course, &plan)?;
        if self.pending.len() >= ROUND {
            self.settle(course, None)?;
        }
        Ok(())
    }

    fn ask(&mut self, course: &Course) -> Result<(), FieldError> {
        self.asked = Some(self.ask_for(self.needed(course))?);
        Ok(self.device.submit()?)
    }

    fn forget(&mut self) {
        (self.particles, self.gains, self.status, self.pending, self.asked) = (None, None, None, Vec::new(), None);
    }

    fn finish(&mut self, course: &Course) -> Result<(), FieldError> {
        self.settle(course, None)?;
        Ok(self.device.finish()?)
    }

    fn bring(&mut self, course: &mut Course) -> Result<(), FieldError> {
        Ok(self.give(course, Needed::Scene(self.rest_count))?)
    }
}
