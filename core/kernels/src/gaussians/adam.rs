//! A step of Adam (Kingma and Ba 2015).

use viewfuse_core::math::sqrt;

/// Share of the first moment that stays.
pub const FIRST_DECAY: f32 = 0.9;
/// Share of the second moment that stays: fewer steps than in training of networks, so a shorter memory.
pub const SECOND_DECAY: f32 = 0.99;
/// What is added to the root of the second moment.
const LEAST: f32 = 1.0e-15;

/// Steps a parameter against its derivative and brings its two moments up to date. `corrections` are 1 less the decays
/// to the power of the steps so far, this one included.
#[inline(always)]
pub fn adam_step(value: &mut f32, moments: &mut [f32; 2], gradient: f32, rate: f32, corrections: [f32; 2]) {
    moments[0] = FIRST_DECAY * moments[0] + (1.0 - FIRST_DECAY) * gradient;
    moments[1] = SECOND_DECAY * moments[1] + (1.0 - SECOND_DECAY) * gradient * gradient;
    *value -= rate * (moments[0] / corrections[0]) / (sqrt(moments[1] / corrections[1]) + LEAST);
}
