//! Dispatches in pieces that a watchdog stands: systems end a GPU's work that takes seconds.
//!
//! Of a kernel that this device has not run yet nobody knows how long it takes, so its first dispatch is small, and is
//! waited for. From its time follows how many elements a piece may have.

use crate::dispatch::DispatchJob;
use crate::error::VulkanError;
use crate::gpu::{Gpu, State};
use crate::kernel::{Form, WORKGROUP};
use std::ops::Range;
use std::time::{Duration, Instant};

/// Elements of the first dispatch of a kernel: some hundred workgroups (or a quarter, of large tiles), which any GPU
/// has the units for.
const FIRST: u32 = 256 * WORKGROUP;

impl Gpu {
    /// Records a dispatch in pieces, each expected to take no longer than the device's longest piece, and returns how
    /// many there are. `count` elements are counted.
    pub(crate) fn record_in_pieces(
        &self,
        state: &mut State,
        job: &DispatchJob<'_>,
        form: Form,
        elements: Range<u32>,
        count: u64,
    ) -> Result<u64, VulkanError> {
        let Some(longest) = self.longest_piece else { return self.record_job(state, job, form, elements, count) };
        let all = elements.end - elements.start;
        // Counted elements up to one of the form's, so that the pieces' counts sum to the whole.
        let counted = |end: u32| count * u64::from(end - elements.start) / u64::from(all);
        let (mut first, mut dispatches) = (elements.start, 0);
        while first < elements.end {
            let rest = elements.end - first;
            let time = state.rates[job.kernel as usize].time_of(counted(elements.end) - counted(first));
            let len = time.map_or(FIRST, |time| within(longest, time, rest, form.invocations())).min(rest);
            let count = counted(first + len) - counted(first);
            dispatches += self.record_job(state, job, form, first..first + len, count)?;
            if time.is_none() && len < rest {
                let start = Instant::now();
                state.wait()?;
                // A device without timestamps.
                state.rates[job.kernel as usize].or_took(start.elapsed());
            }
            first += len;
        }
        Ok(dispatches)
    }
}

/// How many of `rest` elements, which together take `time`, take at most `longest`: whole workgroups of so many
/// invocations, at least those of a first dispatch.
fn within(longest: Duration, time: Duration, rest: u32, workgroup: u32) -> u32 {
    if time <= longest {
        return rest;
    }
    let share = longest.as_secs_f64() / time.as_secs_f64();
    ((f64::from(rest) * share) as u32 / workgroup * workgroup).max(FIRST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_whole_workgroups_and_none_is_tiny() {
        let second = Duration::from_secs(1);
        for workgroup in [WORKGROUP, 4 * WORKGROUP] {
            assert_eq!(within(second, second, 1_000_001, workgroup), 1_000_001);
            assert_eq!(within(second, 10 * second, 1_000_000, workgroup), 100_000 / workgroup * workgroup);
            assert_eq!(within(second, 1_000_000 * second, 1_000_000, workgroup), FIRST);
            assert_eq!(within(Duration::ZERO, second, 1_000_000, workgroup), FIRST);
            assert_eq!(FIRST % workgroup, 0);
        }
    }
}
