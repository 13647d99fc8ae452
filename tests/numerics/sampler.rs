//! Samplers: their coefficients against `f64`, their order and their error on data whose ideal denoiser is known, what
//! a state in `f32` costs, churn and the step controller.

mod coefficients;
mod errors;
mod orders;
mod walk;
