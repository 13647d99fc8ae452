//! Fields as a whole, on the CPU: pictures of scenes whose geometry is known, extremes, and what may be omitted.

mod auto;
mod budget;
mod counts;
mod every;
mod gaussians;
mod genvs;
mod near;
mod pixelnerf;
mod plane_sweep;
mod posed;
mod sampling;
mod scales;
mod variants;
mod visual_hull;
