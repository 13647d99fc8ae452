//! GeNVS: a feature field, rendered, and a denoiser that turns features and noise into a picture.

pub mod sampling;
