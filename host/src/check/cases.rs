//! The cases, one for each kernel.

pub mod attend;
pub mod composite;
pub mod embed_pose;
pub mod fuse_views;
pub mod hull_entry;
pub mod march;
pub mod match_cost;
pub mod pick_depth;
pub mod weigh;
pub mod window;

use super::poses::Random;

/// The random numbers of a seed and a size, for one kernel.
fn random(kernel: u32, seed: u64, size: u32) -> Random {
    Random::new((seed as u32).wrapping_mul(0x9e37_79b9) ^ (size << 8) ^ kernel)
}

/// As `f32`, so many.
fn numbers(count: usize, mut next: impl FnMut() -> f64) -> Vec<f32> {
    (0..count).map(|_| next() as f32).collect()
}
