//! The settings of a run.

use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::sampler::control::HALF_A_LEVEL;
use viewfuse_core::schedule::NoiseSchedule;

/// The settings of a run from noise to a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// The sampler and its levels.
    pub steps: Steps,
    /// The largest and the smallest noise level.
    pub schedule: NoiseSchedule,
    /// Noise that is added between steps (churn). Earlier results are then dropped: multistep samplers start again.
    pub churn: Churn,
    /// The run stops when no value of the picture will change by more than this; `None` to run to the last level.
    pub early_termination: Option<f32>,
    /// Whether a denoiser that knows the colours of the feature image starts from them with noise of the largest level,
    /// instead of from noise alone. Above some level its estimate hardly depends on the noisy picture, and calls there
    /// are left out.
    pub from_colours: bool,
    /// Whether [`Accuracy`](super::Accuracy) has the differences of steps, for which each step brings a picture back
    /// from the device.
    pub compares_orders: bool,
    /// Seed of the noise.
    pub seed: u64,
}

/// The levels at which the denoiser is called.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// Those of the schedule.
    Fixed {
        /// The sampler.
        sampler: Sampler,
        /// The number of levels above 0, at least 1.
        level_count: u32,
    },
    /// Adaptive levels by `unipc`, without churn: each step is as long as its estimated error allows.
    Chosen {
        /// The largest error of a step, root mean square over the picture.
        tolerance: f32,
        /// The most calls, after which the run stops.
        most_calls: u32,
    },
}

impl Steps {
    /// Adaptive levels for this error of a step, with as many calls as the published run at most.
    pub fn within(tolerance: f32) -> Steps {
        Steps::Chosen { tolerance, most_calls: 49 }
    }
}

impl Plan {
    /// The published run: Heun's method over 25 levels from 80 to 0.002, 49 calls.
    pub fn published(seed: u64) -> Plan {
        let steps = Steps::Fixed { sampler: Sampler::Heun, level_count: 25 };
        let (schedule, churn) = (NoiseSchedule::published(), Churn::NONE);
        Plan { steps, schedule, churn, early_termination: None, from_colours: false, compares_orders: false, seed }
    }

    /// The default: `ipndm` with 10 calls, a fifth of the published run's, and an early stop when no visible change
    /// remains. On mixtures of normal distributions with deviations of 0.1 and 0.2 to 0.3 its error is 0.032 and 0.033,
    /// that of the published run 0.006 and 0.010 (`tests/numerics/sampler/errors.rs`); with 18 calls it is 0.009 and
    /// 0.008. Where data are much narrower, [`Steps::within`] is better: for 0.01 it takes 15 or 16 calls on the same
    /// data, and on data 0.001 wide as well.
    pub fn fast(seed: u64) -> Plan {
        let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count: 10 };
        Plan { steps, early_termination: Some(HALF_A_LEVEL), ..Plan::published(seed) }
    }
}
