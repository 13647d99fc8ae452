//! GeNVS: a feature field, rendered, and a denoiser that turns features and noise into a picture.

mod architecture;
pub mod made;

pub use architecture::{
    ASPP_RATES, Architecture, Block, COLOUR_CHANNELS, Convolution, Denoiser, DenoiserLevel, DenoiserStep, Encoder,
    Level, Resampling, group_count,
};
