//! An error and a value of core, logged with defmt. Only compiled, by `tests/embedded/defmt.rs`: with it, every type of
//! core that derives defmt's `Format`.
#![no_std]
#![forbid(unsafe_code)]

use viewfuse_core::pose::PoseError;
use viewfuse_core::weights::Weights;

/// As a firmware logs them.
pub fn logged(error: PoseError, weights: &Weights<8>) {
    defmt::error!("{}", error);
    defmt::info!("weights {}", weights);
}
