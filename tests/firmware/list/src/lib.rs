//! What core computes, as a list of named numbers from a few inputs.
//!
//! The firmware and `tests/embedded/firmware.rs` call these same functions, the one on a Cortex-M4F, the other on the
//! host; the lists must agree in every bit. All numbers are finite: the bits of a NaN are not a result.
#![no_std]
#![forbid(unsafe_code)]

pub mod attended;
pub mod denoised;
pub mod formulas;
pub mod quantised;
pub mod rig;
pub mod sampled;
pub mod splatted;

/// Where the named numbers go. One function on purpose: a firmware has no room for a copy per caller.
pub type Emit<'a> = &'a mut dyn FnMut(&str, f32);

/// What the list is computed from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Where the cameras stand on their way around the object, and what latents, densities and parameters start from.
    pub phase: f32,
    /// The seed of the random numbers.
    pub seed: u64,
}

impl Inputs {
    /// The inputs whose results are compared.
    pub const STANDARD: Inputs = Inputs { phase: 0.3, seed: 0x0123_4567_89ab_cdef };
}

/// A number in `[-1, 1]` that depends on `index` irregularly and on the phase smoothly.
pub fn wave(inputs: Inputs, index: u32) -> f32 {
    viewfuse_core::math::sin_cos(inputs.phase + 0.618 * index as f32 + 0.01 * (index % 7) as f32).0
}

/// Emits several numbers under one name.
fn emit_all(name: &str, values: &[f32], emit: Emit) {
    for value in values {
        emit(name, *value);
    }
}
