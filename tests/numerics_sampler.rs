//! Samplers: their coefficients against `f64`, their order and their error on data whose ideal denoiser is known, what a
//! state in `f32` costs, churn and the step controller.

#[path = "numerics_sampler/coefficients.rs"]
mod coefficients;
#[path = "numerics_sampler/errors.rs"]
mod errors;
#[path = "numerics_sampler/orders.rs"]
mod orders;
#[path = "numerics_sampler/walk.rs"]
mod walk;
