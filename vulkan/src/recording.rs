//! Dispatches that are recorded once and submitted again.
//!
//! Work that stays the same, such as a call of a network with other numbers in the same arrays, costs the host some
//! microseconds for each dispatch whenever it is recorded. Recorded once, all of it is one submission. A barrier at its
//! beginning and one at its end stand for all that a later submission depends on.

use crate::error::VulkanError;
use crate::gpu::{Gpu, Tally};
use crate::kernel::Kernel;
use std::sync::Arc;

/// Dispatches that [`Gpu::recorded`] has recorded. They hold their arrays, whose memory is given back by what the device
/// does after it was dropped ([`Gpu::release`]).
pub struct Recording {
    mark: Arc<()>,
    device: String,
    /// Dispatches and elements of each kernel.
    counts: Vec<(Kernel, Tally)>,
}

impl Gpu {
    /// Does work, and records what it dispatches, to be submitted [again](Gpu::submit_again). The recording is `None`
    /// if the work is not to be repeated as it was: if arrays were made, uploaded or downloaded in it, if forms of
    /// kernels were measured or tried, if another thread used the device, if it dispatched nothing, or if it is a part
    /// of work that is recorded.
    ///
    /// # Errors
    /// The work's, and others if the device fails, or failed before.
    pub fn recorded<T, E: From<VulkanError>>(
        &self,
        work: impl FnOnce() -> Result<T, E>,
    ) -> Result<(T, Option<Recording>), E> {
        let begun = self.with_state(|_, state| Ok(state.submissions.begin_recording()?.zip(Some(state.tallies))))?;
        let Some((mark, before)) = begun else { return Ok((work()?, None)) };
        let _end = End(self, &mark);
        self.with_state(|gpu, state| gpu.record_barrier(state))?;
        let value = work()?;
        let recording = self.with_state(|gpu, state| {
            gpu.record_barrier(state)?;
            if !state.submissions.end_recording(&mark)? {
                return Ok(None);
            }
            let counts =
                Kernel::ALL.into_iter().zip(state.tallies.iter().zip(&before)).map(|(kernel, (now, before))| {
                    let (dispatches, elements) = (now.dispatches - before.dispatches, now.elements - before.elements);
                    (kernel, Tally { dispatches, elements, ..Tally::default() })
                });
            let counts: Vec<_> = counts.filter(|(_, counted)| counted.dispatches > 0).collect();
            let is_work = !counts.is_empty();
            Ok(is_work.then(|| Recording { mark: mark.clone(), device: gpu.handle.name.clone(), counts }))
        })?;
        Ok((value, recording))
    }

    /// Gives back what recordings that were dropped have held, unless it is in flight. New commands do that, too.
    pub fn release(&self) {
        self.lock().submissions.release();
    }

    /// Submits the dispatches of a recording again, behind all earlier work: they read what their arrays contain by
    /// then, but for weights that a form reads as f16, which are those of the recording's time. Weights that they write
    /// are made into f16 again by the next dispatch that reads them so. It waits only if they are still in flight.
    ///
    /// # Errors
    /// [`VulkanError::OtherDevice`], and others if the device fails, or failed before.
    pub fn submit_again(&self, recording: &Recording) -> Result<(), VulkanError> {
        self.with_state(|gpu, state| {
            state.submissions.note(false);
            if !state.queue_again(&recording.mark)? {
                return Err(VulkanError::OtherDevice(gpu.handle.name.clone(), recording.device.clone()));
            }
            for (kernel, counted) in &recording.counts {
                let tally = &mut state.tallies[*kernel as usize];
                tally.dispatches += counted.dispatches;
                tally.elements += counted.elements;
            }
            Ok(())
        })
    }
}

/// Ends a recording also where the work fails or panics.
struct End<'a>(&'a Gpu, &'a Arc<()>);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.lock().submissions.drop_recording(self.1);
    }
}
