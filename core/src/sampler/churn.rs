//! Stochastic churn: noise that is added before a step and corrects errors of earlier steps.
//!
//! Source: Karras et al. (2022), algorithm 2. Only for samplers that use the newest result only
//! ([`super::Sampler::is_single_step`]).

use crate::math::{min, sqrt};
use core::f32::consts::SQRT_2;

/// How much noise is added, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Churn {
    /// `S_churn`: amount over the whole run, at least 0; 0 for none.
    pub amount: f32,
    /// `S_min`: the lowest level at which noise is added.
    pub lowest: f32,
    /// `S_max`: the highest level at which noise is added; may be infinite.
    pub highest: f32,
    /// `S_noise`: standard deviation of the added noise, relative to that of the level.
    pub deviation: f32,
}

/// Where a step begins after noise was added.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Churned {
    /// The level then.
    pub level: f32,
    /// Standard deviation of the noise to add; 0 for none.
    pub scale: f32,
}

impl Churn {
    /// No noise between the steps.
    pub const NONE: Churn = Churn { amount: 0.0, lowest: 0.0, highest: f32::INFINITY, deviation: 1.0 };

    /// The noise before the step from level `sigma`, one of `level_count`: the level rises by
    /// `gamma = min(S_churn / level_count, sqrt(2) - 1)`, and what must be added to reach it has the standard deviation
    /// `sigma sqrt(gamma (2 + gamma))`. That is `sqrt((1 + gamma)^2 sigma^2 - sigma^2)` as published, of which rounding
    /// can make the root of a negative number.
    pub fn before(&self, sigma: f32, level_count: u32) -> Churned {
        let is_within = self.amount > 0.0 && sigma >= self.lowest && sigma <= self.highest;
        if !is_within {
            return Churned { level: sigma, scale: 0.0 };
        }
        let gamma = min(self.amount / level_count as f32, SQRT_2 - 1.0);
        Churned { level: sigma + sigma * gamma, scale: sigma * sqrt(gamma * (2.0 + gamma)) * self.deviation }
    }
}
