//! How long an optimisation takes: said once a few iterations of the finest level are measured; and how many fit into a
//! time.

use crate::FieldError;
use crate::gaussians::Optimisation;
use std::time::{Duration, Instant};
use viewfuse_job::progress::{Progress, Silent};

/// Iterations of the finest level that are measured.
const MEASURED: u32 = 20;
/// Iterations before those, in which memory is taken.
const FIRST: u32 = 3;
/// How much longer an iteration takes with twice the Gaussians, less 1, where that is not measured: the rest of it is a
/// matter of the pixels. On fox, where the number grows four times, the mean iteration takes 1.9 times the first ones
/// (`host/results/gaussian_quality.md`).
const OF_GAUSSIANS: f64 = 0.44;
/// Share of a limit after which a trial ends.
const TRIAL: f64 = 0.4;

/// The time of an optimisation.
pub(super) struct Clock {
    begun: Instant,
    limit: Option<Duration>,
    /// When it was measured last at the finest level, and after how many of its iterations.
    measured: Option<(Instant, u32)>,
    is_told: bool,
    /// Iterations of the finest level that there are without a limit.
    wanted: u32,
    /// As [`OF_GAUSSIANS`], of this scene.
    of_gaussians: f64,
}

/// What an iteration of an optimisation takes that begins at its finest level.
#[derive(Clone, Copy)]
pub(super) struct Pace {
    /// Seconds of one of the first iterations.
    pub(super) first: f64,
    /// Gaussians at first.
    count: usize,
    /// How many times as many there are at last.
    growth: f64,
}

impl Pace {
    /// Of an optimisation's first iterations.
    ///
    /// # Errors
    /// [`FieldError`] if the device fails.
    pub(super) fn of(optimisation: &mut Optimisation<'_>) -> Result<Pace, FieldError> {
        let (count, growth) = (optimisation.optimised()?.gaussians.len(), optimisation.growth());
        optimisation.run_to(FIRST, &Silent)?;
        optimisation.finish()?;
        let begun = Instant::now();
        optimisation.run_to(FIRST + MEASURED, &Silent)?;
        optimisation.finish()?;
        Ok(Pace { first: begun.elapsed().as_secs_f64() / f64::from(MEASURED), count, growth })
    }

    /// How much longer an iteration takes with twice the Gaussians, less 1, by another one of the same pictures.
    fn of_gaussians(&self, other: &Pace) -> f64 {
        let more = other.count as f64 / self.count.max(1) as f64 - 1.0;
        let longer = other.first / self.first.max(1.0e-9) - 1.0;
        if more > 0.5 { (longer / more).clamp(0.0, 1.0) } else { OF_GAUSSIANS }
    }
}

impl Clock {
    /// Starts, with a limit or without.
    pub(super) fn start(limit: Option<Duration>) -> Clock {
        Clock { begun: Instant::now(), limit, measured: None, is_told: false, wanted: 0, of_gaussians: OF_GAUSSIANS }
    }

    /// Seconds that a mean iteration takes, by the first ones and by those of an optimisation of the same pictures with
    /// more Gaussians, of which it learns what these cost.
    pub(super) fn mean(&mut self, pace: Pace, of_more: Pace) -> f64 {
        self.of_gaussians = pace.of_gaussians(&of_more);
        mean_cost(pace.growth, self.of_gaussians) * pace.first
    }

    /// When a trial must end, if there is a limit.
    pub(super) fn end_of_trial(&self) -> Option<Instant> {
        self.limit.and_then(|limit| self.begun.checked_add(limit.mul_f64(TRIAL)))
    }

    /// The time that is left, if there is a limit.
    pub(super) fn left(&self) -> Option<Duration> {
        self.limit.map(|limit| limit.saturating_sub(self.begun.elapsed()))
    }

    /// To be called after each iteration: once, when the first ones of the finest level are measured, it sets how many
    /// there are, says how long they will take, and returns true.
    ///
    /// # Errors
    /// [`FieldError`] if the device fails.
    pub(super) fn has_measured(
        &mut self,
        optimisation: &mut Optimisation<'_>,
        progress: &dyn Progress,
    ) -> Result<bool, FieldError> {
        let done = optimisation.done_at_finest();
        if self.is_told || done == 0 {
            return Ok(false);
        }
        let Some((begun, first)) = self.measured else {
            optimisation.finish()?;
            self.wanted = done + optimisation.iteration_count() - optimisation.done();
            self.measured = Some((Instant::now(), done));
            return Ok(false);
        };
        if done < first + MEASURED {
            return Ok(false);
        }
        optimisation.finish()?;
        self.is_told = true;
        let one = mean_cost(optimisation.growth(), self.of_gaussians) * begun.elapsed().as_secs_f64()
            / f64::from(done - first);
        self.measured = Some((Instant::now(), done));
        self.fit(optimisation, one);
        let left = optimisation.iteration_count() - optimisation.done();
        progress.note(&match self.limit {
            Some(_) if optimisation.done_at_finest() + left < self.wanted => {
                format!("some {left} iterations more, as many as fit into the time")
            }
            Some(_) => format!("{left} iterations more, which fit into the time"),
            None => format!("{left} iterations more, about {}", words(f64::from(left) * one)),
        });
        Ok(true)
    }

    /// To be called on the way, after what is done beside the iterations: with a limit, as many of them are left as fit
    /// at the pace since the last time; none once it is over.
    pub(super) fn go_on(&mut self, optimisation: &mut Optimisation<'_>) {
        let done = optimisation.done_at_finest();
        let Some((begun, first)) = self.measured.filter(|(_, first)| self.is_told && done > *first) else { return };
        let one = begun.elapsed().as_secs_f64() / f64::from(done - first);
        self.measured = Some((Instant::now(), done));
        self.fit(optimisation, one);
    }

    /// With a limit, leaves as many iterations as fit, of so many seconds each, and no more than without.
    fn fit(&self, optimisation: &mut Optimisation<'_>, one: f64) {
        let Some(left) = self.left() else { return };
        let fitting = (left.as_secs_f64() / one.max(1.0e-9)) as u32;
        optimisation.set_finest(optimisation.done_at_finest().saturating_add(fitting).min(self.wanted));
    }
}

/// What the mean iteration costs, relative to one now, if the number of Gaussians grows so many times: by equal factors
/// in three fifths of the iterations.
fn mean_cost(growth: f64, of_gaussians: f64) -> f64 {
    let mean = if growth > 1.0 + 1.0e-6 { 0.6 * (growth - 1.0) / growth.ln() + 0.4 * growth } else { 1.0 };
    1.0 + of_gaussians * (mean - 1.0)
}

/// A time in words.
pub(super) fn words(seconds: f64) -> String {
    match seconds {
        0.0..90.0 => format!("{seconds:.0} s"),
        _ => format!("{:.0} minutes", seconds / 60.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_makes_iterations_dearer() {
        let mean_cost = |growth: f64| mean_cost(growth, OF_GAUSSIANS);
        assert_eq!(mean_cost(1.0), 1.0);
        assert!((mean_cost(4.25) - 1.9).abs() < 0.01, "fox: {}", mean_cost(4.25));
        assert!(mean_cost(20.0) > mean_cost(4.25));
    }
}
