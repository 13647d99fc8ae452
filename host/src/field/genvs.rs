//! GeNVS with weighted views, on any device: volumes of features, a feature image, a diffusion denoiser; the mathematics is
//! in [`viewfuse_core::genvs`], [`viewfuse_core::network`], [`viewfuse_core::schedule`] and [`viewfuse_core::sampler`].
//!
//! Source: Chan et al., "Generative novel view synthesis with 3D-aware diffusion models" (2023), and the code of "Pay
//! Attention to Where You Looked". The views are combined by weights where the published network takes their mean.

mod architecture;
mod denoiser;
mod encoder;
mod feature_image;
mod image;
mod layers;
pub mod made;
pub mod sampling;

pub use architecture::{
    ASPP_RATES, Architecture, Block, COLOUR_CHANNELS, Convolution, Denoiser, DenoiserLevel, DenoiserStep, Encoder,
    Level, Resampling, group_count,
};
