//! Arithmetic against `f64`, known answers and the published codes: every function of core, its errors and its ends.

mod agreement;
mod attention;
mod camera;
mod census;
mod compare;
mod compositing;
mod front;
mod gaussian;
mod gaussians;
mod group_norm;
mod half_precision;
mod lens;
mod math;
mod metrics;
mod network;
mod plane_sweep;
mod quantised;
mod rays;
mod sampler;
mod sampling;
mod schedule;
mod visual_hull;
mod volumes;
mod weighting;
mod weights;
