//! The kernels of a device, in the order of the data.

pub mod light;
pub mod network;
pub mod photo;
pub mod points;
pub mod rays;
pub mod sampler;
pub mod weighting;

pub use light::{LightKernels, Pixels};
pub use network::{Layer, NetworkKernels};
pub use photo::{PhotoKernels, PhotoScene};
pub use points::PointKernels;
pub use rays::{RayKernels, Rays};
pub use sampler::SamplerKernels;
pub use weighting::WeightingKernels;

/// Something that runs every kernel.
pub trait Device:
    WeightingKernels + RayKernels + PointKernels + NetworkKernels + LightKernels + PhotoKernels + SamplerKernels
{
}
impl<D: WeightingKernels + RayKernels + PointKernels + NetworkKernels + LightKernels + PhotoKernels + SamplerKernels>
    Device for D
{
}
