//! The form of a tiled kernel for a class of products: as was asked for, as is known, or the fastest of those that are
//! measured.
//!
//! What a form writes before it is timed is compared with what [`Form::Single`] writes, bit by bit: a driver may
//! compile one of them wrongly. Outputs are overwritten before, or what an earlier form wrote would stand for a form
//! that writes nothing. A dispatch need not write all of an array (some channels of a wider image), so the array is
//! restored at the end.

use crate::buffer::Array;
use crate::dispatch::DispatchJob;
use crate::error::{Missing, VulkanError};
use crate::forms::{self, Class};
use crate::gpu::{Gpu, State};
use crate::kernel::{Form, Kernel};
use crate::pipelines::Key;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What outputs are overwritten with: a NaN that no arithmetic gives.
const SPOILT: u32 = u32::MAX;

impl Gpu {
    /// Begins to compile these kernels, in the order of their first use, and returns at once. Of tiled kernels it takes
    /// the forms that were chosen in earlier processes, and where none is known, those that come into question.
    pub fn compile_ahead(&self, kernels: &[Kernel]) {
        let known = self.lock().choices.clone();
        let is_run = |form: &Form| self.form.map_or_else(|| self.handle.runs(*form), |only| only == *form);
        let candidates = |kernel: &Kernel| -> Vec<Form> {
            let chosen = known.forms_of(*kernel);
            let forms = if chosen.is_empty() { kernel.forms().to_vec() } else { chosen };
            forms.into_iter().filter(|form| *form != Form::Single && is_run(form)).collect()
        };
        // All need the plain form: for little work, or to compare with.
        let single = kernels.iter().map(|kernel| (*kernel, Form::Single, 0));
        let others = kernels.iter().flat_map(|kernel| candidates(kernel).into_iter().map(|form| (*kernel, form, 0)));
        let keys: Vec<Key> = single.chain(others).filter(|key| !self.pipelines.has(*key)).collect();
        self.ahead.start(&self.pipelines, keys);
    }
}

impl Gpu {
    /// The form for a class of products.
    pub(crate) fn form(&self, state: &mut State, job: &DispatchJob<'_>, class: &Class) -> Result<Form, VulkanError> {
        if let Some(form) = self.form {
            if form.needs_fours() && !class.is_in_fours() {
                return Ok(Form::Single);
            }
            return match self.pipelines.fits((job.kernel, form, job.page_shift))? {
                true => Ok(form),
                false => {
                    let missing = vec![Missing::Feature("subgroups of the size that was asked for")];
                    Err(VulkanError::Missing(self.handle.name.clone(), missing))
                }
            };
        }
        let candidates = || class.candidates(self.is_software).filter(|form| self.handle.runs(*form));
        if candidates().nth(1).is_none() {
            return Ok(Form::Single);
        }
        if let Some(form) = state.choices.get(class).filter(|form| candidates().any(|candidate| candidate == *form)) {
            return Ok(form);
        }
        let candidates: Vec<Form> = candidates().collect();
        let outputs = job.outputs();
        if outputs.iter().any(|array| self.start_bytes(array) == 0) {
            return Ok(Form::Single);
        }
        // What cannot be restored is not measured: writing it once shows that there is memory for that.
        let before = self.read_starts(state, &outputs);
        let before = before.and_then(|before| self.write_starts(state, &outputs, &before).map(|()| before));
        let before = match before {
            Err(VulkanError::OutOfMemory { .. }) => return Ok(Form::Single),
            before => before?,
        };
        let form = self.fastest(state, job, class, &candidates, &outputs)?;
        self.write_starts(state, &outputs, &before)?;
        state.choices.set(class, form);
        Ok(form)
    }

    /// Forms that gave other results than [`Form::Single`], or were compiled for subgroups of another size than was
    /// asked for: they are not used for the products of their class. On a driver without faults there are none.
    pub fn refused_forms(&self) -> Vec<(Kernel, Form)> {
        self.lock().refused.clone()
    }

    /// Invocations of a subgroup that the driver reports of the kernel's pipelines that need them; `None` where it
    /// reports nothing, or there are none yet.
    pub fn reported_subgroup_size(&self, kernel: Kernel) -> Option<u32> {
        self.pipelines.reported(kernel)
    }

    /// The fastest of the forms that give what the first one gives.
    fn fastest(
        &self,
        state: &mut State,
        job: &DispatchJob<'_>,
        class: &Class,
        candidates: &[Form],
        outputs: &[&Arc<Array>],
    ) -> Result<Form, VulkanError> {
        let keys: Vec<_> = candidates.iter().map(|form| (job.kernel, *form, job.page_shift)).collect();
        self.pipelines.prepare(&keys)?;
        let (mut fastest, mut expected) = ((Form::Single, Duration::MAX), None);
        for &form in candidates {
            // A driver that compiled it for subgroups of another size would give other results.
            if !self.pipelines.fits((job.kernel, form, job.page_shift))? {
                state.refuse(job.kernel, form);
                continue;
            }
            self.spoil_starts(state, outputs)?;
            let elements = class.measured_elements(form, self.is_software);
            self.record_job(state, job, form, 0..elements, 0)?;
            let written = self.read_starts(state, outputs)?;
            if expected.is_none() && written.iter().all(|bytes| words(bytes).all(|word| word == SPOILT)) {
                // Nothing to compare with: what is written lies further on.
                return Ok(form);
            }
            if !is_same(expected.get_or_insert_with(|| written.clone()), &written) {
                state.refuse(job.kernel, form);
                continue;
            }
            let time = self.time_form(state, job, form, elements)?;
            if time < fastest.1 {
                fastest = (form, time);
            }
        }
        Ok(fastest.0)
    }

    /// The least time of a few dispatches of some tiles, whose pipeline is there.
    fn time_form(
        &self,
        state: &mut State,
        job: &DispatchJob<'_>,
        form: Form,
        elements: u32,
    ) -> Result<Duration, VulkanError> {
        let mut least = Duration::MAX;
        for _ in 0..forms::ROUNDS {
            state.wait()?;
            let start = Instant::now();
            self.record_job(state, job, form, 0..elements, 0)?;
            state.wait()?;
            least = least.min(start.elapsed());
        }
        Ok(least)
    }

    /// How many of an array's first bytes are compared: those of whole words that staging holds.
    fn start_bytes(&self, array: &Array) -> usize {
        (array.len.min(array.chunk_len) * array.stride).min(self.staging_bytes()) & !3
    }

    fn read_starts(&self, state: &mut State, arrays: &[&Arc<Array>]) -> Result<Vec<Vec<u8>>, VulkanError> {
        let read = |array: &&Arc<Array>| {
            let mut bytes = vec![0; self.start_bytes(array)];
            self.read_piece(state, array, &array.chunks[0], 0, &mut bytes)?;
            Ok(bytes)
        };
        arrays.iter().map(read).collect()
    }

    fn write_starts(&self, state: &mut State, arrays: &[&Arc<Array>], bytes: &[Vec<u8>]) -> Result<(), VulkanError> {
        let mut pairs = arrays.iter().zip(bytes);
        pairs.try_for_each(|(array, bytes)| self.write_piece(state, array, &array.chunks[0], 0, bytes))
    }

    fn spoil_starts(&self, state: &mut State, arrays: &[&Arc<Array>]) -> Result<(), VulkanError> {
        arrays.iter().try_for_each(|array| self.fill_start(state, array, self.start_bytes(array), SPOILT))
    }
}

impl State {
    fn refuse(&mut self, kernel: Kernel, form: Form) {
        if !self.refused.contains(&(kernel, form)) {
            self.refused.push((kernel, form));
        }
    }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned)
}

/// Whether outputs are the same numbers. All NaN are one: which of them an operation gives is the device's choice.
fn is_same(expected: &[Vec<u8>], found: &[Vec<u8>]) -> bool {
    let is_nan = |word: u32| word != SPOILT && f32::from_bits(word).is_nan();
    let same = |(a, b): (u32, u32)| a == b || (is_nan(a) && is_nan(b));
    expected.iter().zip(found).all(|(a, b)| words(a).zip(words(b)).all(same))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_compared_by_their_bits() {
        let outputs = |words: &[u32]| vec![words.iter().flat_map(|word| word.to_ne_bytes()).collect::<Vec<u8>>()];
        let [one, next, zero, minus_zero] = [1.0, 1.000_000_1, 0.0, -0.0_f32].map(f32::to_bits);
        let nan = f32::NAN.to_bits();
        let is_same = |a: &[u32], b: &[u32]| is_same(&outputs(a), &outputs(b));
        assert!(is_same(&[one, zero, SPOILT], &[one, zero, SPOILT]));
        assert!(!is_same(&[one, zero], &[next, zero]) && !is_same(&[zero], &[minus_zero]));
        assert!(is_same(&[nan], &[nan ^ 0x8000_0000]) && !is_same(&[nan], &[one]));
        assert!(!is_same(&[nan], &[SPOILT]) && !is_same(&[one], &[SPOILT]), "a number that was not written");
    }
}
