//! A stream of random numbers that belongs to one object.

use viewfuse_core::random::{threefry_2x32, uniform_from};

/// Numbers that depend on the seed, the kind, the index and how many were drawn before.
pub(crate) struct Draws {
    key: [u32; 2],
    count: u32,
}

impl Draws {
    pub(crate) fn new(seed: u64, kind: u32, index: u32) -> Draws {
        Draws { key: threefry_2x32([seed as u32, (seed >> 32) as u32], [index, kind]), count: 0 }
    }

    /// In `[0, 1)`.
    pub(crate) fn unit(&mut self) -> f32 {
        self.count += 1;
        uniform_from(self.key, self.count, 0)
    }

    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `count`.
    pub(crate) fn below(&mut self, count: u32) -> u32 {
        // A product of almost 1 could round up to `count`.
        ((self.unit() * count as f32) as u32).min(count - 1)
    }

    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    pub(crate) fn one_of<T: Copy, const N: usize>(&mut self, all: [T; N]) -> T {
        all[self.below(N as u32) as usize]
    }
}
