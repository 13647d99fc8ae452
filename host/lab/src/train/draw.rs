//! Random draws of a training run: each a function of the run's seed, the step, its purpose and its index. So an
//! interrupted run continues with the same draws.

use viewfuse_core::random::{normal, threefry_2x32, uniform_pair};

/// The purpose of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The choice of objects.
    Objects,
    /// The number of sources.
    SourceCount,
    /// The choice of source views.
    Sources,
    /// The choice of target views and pixels.
    Rays,
    /// Jitter of samples in their parts of a ray.
    Samples,
    /// Samples of the second pass.
    FineSamples,
    /// Noise levels of pictures.
    NoiseLevel,
    /// Noise on pictures.
    Noise,
    /// The side of sources.
    Sides,
    /// What sources show of photographs.
    Crops,
    /// The weighting scheme.
    Schemes,
}

/// The draws of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Draw {
    pub(crate) seed: u64,
    pub(crate) step: u32,
}

impl Draw {
    fn key(&self, purpose: Purpose) -> [u32; 2] {
        threefry_2x32([self.seed as u32, (self.seed >> 32) as u32], [self.step, purpose as u32])
    }

    /// A number in `[0, 1)`.
    pub(crate) fn uniform(&self, purpose: Purpose, index: usize) -> f32 {
        uniform_pair(self.key(purpose), index as u32, 0)[0]
    }

    /// A whole number below `count`.
    pub(crate) fn below(&self, purpose: Purpose, index: usize, count: usize) -> usize {
        ((f64::from(self.uniform(purpose, index)) * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// A number of mean 0 and variance 1, normally distributed.
    pub(crate) fn normal(&self, purpose: Purpose, index: usize) -> f32 {
        normal(self.key(purpose), index as u32, 0)
    }

    /// `chosen` different whole numbers below `count`, in random order; all if there are fewer. `index` distinguishes
    /// draws of one purpose.
    pub(crate) fn choose(&self, purpose: Purpose, index: usize, count: usize, chosen: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..count).collect();
        let chosen = chosen.min(count);
        for place in 0..chosen {
            let other = place + self.below(purpose, (index << 12) + place, count - place);
            all.swap(place, other);
        }
        all.truncate(chosen);
        all
    }
}
