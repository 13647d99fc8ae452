//! How long an optimisation takes: said once a few iterations of the finest level are measured, and how many fit into a
//! time.

use crate::FieldError;
use crate::gaussians::Optimisation;
use std::time::{Duration, Instant};
use viewfuse_job::progress::Progress;

/// Iterations of the finest level that are measured.
const MEASURED: u32 = 20;
/// How much longer than these the mean iteration takes, because the number of Gaussians grows: measured on fox, where
/// it is four times as many at last (`host/results/gaussian_quality.md`).
const GROWN: f64 = 1.9;
/// Fewest iterations of the finest level that a limit leaves.
const MIN_ITERATIONS: u32 = 100;

/// The time of an optimisation.
pub(super) struct Clock {
    begun: Instant,
    limit: Option<Duration>,
    /// When the finest level began, and after how many of its iterations.
    finest: Option<(Instant, u32)>,
    is_told: bool,
}

impl Clock {
    /// Starts, with a limit or without.
    pub(super) fn start(limit: Option<Duration>) -> Clock {
        Clock { begun: Instant::now(), limit, finest: None, is_told: false }
    }

    /// To be called after each iteration: once, when the first ones of the finest level are measured, it sets how many
    /// there are, says how long they will take, and returns true.
    ///
    /// # Errors
    /// [`FieldError`] if the device fails.
    pub(super) fn has_measured(
        &mut self,
        optimisation: &mut dyn Optimisation,
        progress: &dyn Progress,
    ) -> Result<bool, FieldError> {
        let done = optimisation.done_at_finest();
        if self.is_told || done == 0 {
            return Ok(false);
        }
        let Some((begun, first)) = self.finest else {
            optimisation.finish()?;
            self.finest = Some((Instant::now(), done));
            return Ok(false);
        };
        if done < first + MEASURED {
            return Ok(false);
        }
        optimisation.finish()?;
        self.is_told = true;
        let one = GROWN * begun.elapsed().as_secs_f64() / f64::from(done - first);
        if let Some(limit) = self.limit {
            let left = limit.saturating_sub(self.begun.elapsed()).as_secs_f64();
            let fitting = done + (left / one.max(1.0e-9)) as u32;
            let whole = done + optimisation.iteration_count() - optimisation.done();
            optimisation.set_finest(fitting.clamp(MIN_ITERATIONS, whole.max(MIN_ITERATIONS)));
        }
        let left = optimisation.iteration_count() - optimisation.done();
        progress.note(&format!("{left} iterations more, about {}", words(f64::from(left) * one)));
        Ok(true)
    }
}

/// A time in words.
fn words(seconds: f64) -> String {
    match seconds {
        0.0..90.0 => format!("{seconds:.0} s"),
        _ => format!("{:.0} minutes", seconds / 60.0),
    }
}
