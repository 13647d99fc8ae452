//! Random numbers of a training run: each a function of the run's seed, the step, what it is for, and its index. So a run
//! that was interrupted goes on with the numbers that it would have had.

use viewfuse_core::random::{normal, threefry_2x32, uniform_pair};

/// What a number is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Which objects.
    Objects,
    /// How many sources.
    SourceCount,
    /// Which views are sources.
    Sources,
    /// Which views and pixels are rendered.
    Rays,
    /// Where in its part of a ray a sample is.
    Samples,
    /// Samples of the second pass.
    FineSamples,
    /// How noisy pictures are.
    NoiseLevel,
    /// Noise on pictures.
    Noise,
}

/// The numbers of one step.
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

    /// `wanted` different whole numbers below `count`, in random order; all if there are fewer. `index` tells draws of one
    /// purpose apart.
    pub(crate) fn choose(&self, purpose: Purpose, index: usize, count: usize, wanted: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..count).collect();
        let wanted = wanted.min(count);
        for place in 0..wanted {
            let other = place + self.below(purpose, (index << 12) + place, count - place);
            all.swap(place, other);
        }
        all.truncate(wanted);
        all
    }
}
