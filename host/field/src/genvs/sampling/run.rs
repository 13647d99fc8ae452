//! The run for one picture.

use super::{Accuracy, Plan, Sampled, Start};
use crate::FieldError;
use crate::finite::download_finite;
use std::collections::VecDeque;
use viewfuse_core::math::{clamp, ln_ratio};
use viewfuse_core::sampler::control::{FIRST_STEP, change_to_come, reached, verdict};
use viewfuse_core::sampler::{Corrected, History, Mix, NoiseBlock, Sampler};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;

/// The noise that a run starts from; the noise before level `index` is number `index + 1`.
const START: u32 = 0;

/// The state of a run.
pub(super) struct Run<'a, D: Device, F> {
    device: &'a D,
    plan: &'a Plan,
    element_count: usize,
    progress: &'a dyn Progress,
    denoise: F,
    /// Free buffers.
    free: Vec<D::Buffer<f32>>,
    /// The kept results of the calls, the newest first, and their levels.
    results: VecDeque<D::Buffer<f32>>,
    history: History,
    /// Levels of all calls.
    levels: Vec<f32>,
    /// The denoiser's last result, and its level.
    last: Option<(Vec<f32>, f32)>,
    /// Of the steps so far: the sum of the squares of their embedded differences.
    step_squares: f32,
    /// Of the last call.
    last_change: f32,
}

/// A result of the denoiser: on the device, and on the host.
struct Denoised<D: Device> {
    buffer: D::Buffer<f32>,
    values: Vec<f32>,
}

impl<'a, D: Device, F> Run<'a, D, F>
where
    F: FnMut(&D::Buffer<f32>, f32, &mut D::Buffer<f32>) -> Result<(), FieldError>,
{
    pub(super) fn new(
        device: &'a D,
        plan: &'a Plan,
        element_count: usize,
        progress: &'a dyn Progress,
        denoise: F,
    ) -> Run<'a, D, F> {
        Run {
            device,
            plan,
            element_count,
            progress,
            denoise,
            free: Vec::new(),
            results: VecDeque::new(),
            history: History::NONE,
            levels: Vec::new(),
            last: None,
            step_squares: 0.0,
            last_change: 0.0,
        }
    }

    /// Runs over the levels of the schedule.
    pub(super) fn over_levels(
        mut self,
        sampler: Sampler,
        level_count: u32,
        start: Start<'_, D>,
    ) -> Result<Sampled<D>, FieldError> {
        let schedule = self.plan.schedule;
        let level = |index: u32| schedule.level(index, level_count);
        let is_reached = |index: &u32| level(*index) <= start.highest();
        let first = (0..level_count).find(is_reached).unwrap_or(level_count - 1);
        let planned = sampler.call_count(level_count);
        self.progress.expect(sampler.call_count(level_count - first) as usize);
        let mut state = self.begun(&start, level(first))?;
        // Where the last step began: its correction starts there.
        let mut begun: Option<D::Buffer<f32>> = None;
        for index in first..level_count {
            let (mut sigma, next) = (level(index), level(index + 1));
            let churned = self.plan.churn.before(sigma, level_count);
            if churned.scale > 0.0 {
                let noisy = self.noisy(Some(&state), churned.scale, index + 1)?;
                self.free.push(std::mem::replace(&mut state, noisy));
                self.forget();
                self.free.extend(begun.take());
                sigma = churned.level;
            }
            let denoised = self.call(&state, sigma)?;
            if next <= 0.0 || self.may_end(&denoised.values, sigma) {
                return Ok(self.finished(denoised.buffer, planned));
            }
            if let Some(begun) = begun.take() {
                let correction = sampler.correction(&self.history, sigma);
                let corrected = self.mixed(&correction, &begun, Some(&denoised.buffer))?;
                self.free.extend([begun, std::mem::replace(&mut state, corrected)]);
            }
            self.keep(sampler, sigma, &state, denoised)?;
            self.note_difference(sampler, next, &state)?;
            let mut reached = self.mixed(&sampler.step(&self.history, next), &state, None)?;
            if sampler.corrected() == Corrected::ByAnotherCall {
                let there = self.call(&reached, next)?;
                if self.may_end(&there.values, next) {
                    return Ok(self.finished(there.buffer, planned));
                }
                let correction = sampler.correction(&self.history, next);
                let corrected = self.mixed(&correction, &reached, Some(&there.buffer))?;
                self.last = Some((there.values, next));
                self.free.extend([std::mem::replace(&mut reached, corrected), there.buffer]);
            }
            let before = std::mem::replace(&mut state, reached);
            match sampler.corrected() {
                Corrected::ByTheNextCall => begun = Some(before),
                Corrected::Never | Corrected::ByAnotherCall => self.free.push(before),
            }
        }
        // Not reached: the level behind the last is 0. Without levels, the result is the start.
        Ok(self.finished(state, planned))
    }

    /// Runs over adaptive levels.
    pub(super) fn by_tolerance(
        mut self,
        tolerance: f32,
        most_calls: u32,
        start: Start<'_, D>,
    ) -> Result<Sampled<D>, FieldError> {
        let sampler = Sampler::UniPc;
        let [largest, smallest] = [0, 1].map(|index| self.plan.schedule.level(index, 2));
        let highest = clamp(start.highest(), smallest, largest);
        let mut state = self.begun(&start, highest)?;
        let (mut sigma, mut step) = (highest, FIRST_STEP);
        self.progress.expect(1);
        let mut newest = self.call(&state, sigma)?;
        loop {
            let is_last = sigma <= smallest || self.levels.len() >= most_calls as usize;
            if is_last || self.may_end(&newest.values, sigma) {
                return Ok(self.finished(newest.buffer, 0));
            }
            self.keep(sampler, sigma, &state, newest)?;
            // Until a step is accepted.
            newest = loop {
                let next = reached(sigma, step, smallest);
                let predictor = sampler.step(&self.history, next);
                let predicted = self.mixed(&predictor, &state, None)?;
                self.progress.expect(1);
                let denoised = self.call(&predicted, next)?;
                self.free.push(predicted);
                let corrector = sampler.correction(&self.history, next);
                let beyond = self.mixed(&corrector.correction_beyond(&predictor), &state, Some(&denoised.buffer))?;
                let error = root_mean_square(&self.device.download(&beyond)?);
                self.free.push(beyond);
                let known = self.history.count().min(sampler.result_count());
                let verdict = verdict(error, tolerance, ln_ratio(sigma, next), known + 1);
                step = verdict.step;
                let is_last = self.levels.len() >= most_calls as usize;
                if verdict.is_accepted || is_last {
                    let corrected = self.mixed(&corrector, &state, Some(&denoised.buffer))?;
                    self.free.push(std::mem::replace(&mut state, corrected));
                    sigma = next;
                    break denoised;
                }
                self.free.push(denoised.buffer);
            };
        }
    }

    /// A call of the denoiser, whose result is checked to be finite.
    fn call(&mut self, state: &D::Buffer<f32>, sigma: f32) -> Result<Denoised<D>, FieldError> {
        self.progress.check()?;
        let mut buffer = self.buffer()?;
        (self.denoise)(state, sigma, &mut buffer)?;
        let values = download_finite(self.device, &buffer, &format!("denoising at level {sigma}"), "denoised picture")?;
        self.levels.push(sigma);
        self.progress.step();
        if let Some((before, _)) = &self.last {
            let changes: Vec<f32> = values.iter().zip(before).map(|(now, then)| now - then).collect();
            self.last_change = root_mean_square(&changes);
        }
        Ok(Denoised { buffer, values })
    }

    /// Whether no visible change of the picture remains.
    fn may_end(&self, values: &[f32], sigma: f32) -> bool {
        let (Some(early_termination), Some((before, level))) = (self.plan.early_termination, &self.last) else {
            return false;
        };
        let change = values.iter().zip(before).fold(0.0, |largest: f32, (now, then)| largest.max((now - then).abs()));
        change_to_come(change, *level, sigma) <= early_termination
    }

    /// Keeps the result of a call for later steps.
    fn keep(
        &mut self,
        sampler: Sampler,
        sigma: f32,
        state: &D::Buffer<f32>,
        denoised: Denoised<D>,
    ) -> Result<(), FieldError> {
        let Denoised { buffer, values } = denoised;
        let kept = match sampler.kept(sigma) {
            None => buffer,
            Some(mix) => {
                let mut kept = self.buffer()?;
                let count = self.element_count as u32;
                self.device.mix_pictures(&mix, count, state, &buffer, state, state, state, &mut kept)?;
                self.free.push(buffer);
                kept
            }
        };
        self.last = Some((values, sigma));
        self.history.push(sigma);
        self.results.push_front(kept);
        self.free.extend(self.results.drain(self.history.count().min(sampler.result_count()) as usize..));
        Ok(())
    }

    /// Notes the difference of the step to a level from one by one result less.
    fn note_difference(&mut self, sampler: Sampler, next: f32, state: &D::Buffer<f32>) -> Result<(), FieldError> {
        if self.plan.compares_orders
            && let Some(mix) = sampler.embedded_difference(&self.history, next)
        {
            let difference = self.mixed(&mix, state, None)?;
            self.step_squares += root_mean_square(&self.device.download(&difference)?).powi(2);
            self.free.push(difference);
        }
        Ok(())
    }

    /// Drops the results of all calls: noise was added.
    fn forget(&mut self) {
        self.history = History::NONE;
        self.free.extend(self.results.drain(..));
    }

    /// A combination of a state, the latest result, if given, and the kept results.
    fn mixed(
        &mut self,
        mix: &Mix,
        state: &D::Buffer<f32>,
        estimate: Option<&D::Buffer<f32>>,
    ) -> Result<D::Buffer<f32>, FieldError> {
        let mut mixed = self.buffer()?;
        // A missing result has coefficient 0.
        let mut all = estimate.into_iter().chain(&self.results);
        let [newest, second, third, fourth] = std::array::from_fn(|_| all.next().unwrap_or(state));
        let count = self.element_count as u32;
        self.device.mix_pictures(mix, count, state, newest, second, third, fourth, &mut mixed)?;
        Ok(mixed)
    }

    /// The state at a run's first level.
    fn begun(&mut self, start: &Start<'_, D>, level: f32) -> Result<D::Buffer<f32>, FieldError> {
        match start {
            Start::Noise => self.noisy(None, level, START),
            Start::Picture { picture, .. } => self.noisy(Some(picture), level, START),
            Start::Latents(latents) => self.mixed(&Mix { state: level, ..Mix::default() }, latents, None),
        }
    }

    /// A picture, or nothing, with noise.
    fn noisy(
        &mut self,
        picture: Option<&D::Buffer<f32>>,
        scale: f32,
        stream: u32,
    ) -> Result<D::Buffer<f32>, FieldError> {
        let mut noisy = self.buffer()?;
        let block = NoiseBlock { seed: [self.plan.seed as u32, (self.plan.seed >> 32) as u32], stream, scale };
        let nothing;
        let picture = match picture {
            Some(picture) => picture,
            None => {
                nothing = self.device.zeros(self.element_count)?;
                &nothing
            }
        };
        self.device.add_noise(&block, self.element_count as u32, picture, &mut noisy)?;
        Ok(noisy)
    }

    fn buffer(&mut self) -> Result<D::Buffer<f32>, FieldError> {
        match self.free.pop() {
            Some(buffer) => Ok(buffer),
            None => Ok(self.device.zeros(self.element_count)?),
        }
    }

    fn finished(self, picture: D::Buffer<f32>, planned: u32) -> Sampled<D> {
        let made = u32::try_from(self.levels.len()).unwrap_or(u32::MAX);
        let accuracy = Accuracy { steps: self.step_squares.sqrt(), last_change: self.last_change };
        Sampled { picture, levels: self.levels, left_out: planned.saturating_sub(made), accuracy }
    }
}

/// Root mean square in `f64`; infinite or NaN if a value is.
pub(in crate::genvs) fn root_mean_square(values: &[f32]) -> f32 {
    let sum: f64 = values.iter().map(|value| f64::from(*value) * f64::from(*value)).sum();
    (sum / values.len().max(1) as f64).sqrt() as f32
}
