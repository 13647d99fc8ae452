//! The kernels of a device, in the order of the data.

pub mod light;
pub mod matrices;
pub mod network;
pub mod normalise;
pub mod photo;
pub mod points;
pub mod rays;
pub mod sampler;
pub mod volumes;
pub mod weighting;

pub use light::{LightKernels, Pixels};
pub use matrices::MatrixKernels;
pub use network::{Layer, LayerShape, NetworkKernels};
pub use normalise::NormaliseKernels;
pub use photo::{PhotoKernels, PhotoScene};
pub use points::PointKernels;
pub use rays::{RayKernels, Rays};
pub use sampler::SamplerKernels;
pub use volumes::VolumeKernels;
pub use weighting::WeightingKernels;

/// Something that runs every kernel.
pub trait Device:
    WeightingKernels
    + RayKernels
    + PointKernels
    + VolumeKernels
    + NetworkKernels
    + NormaliseKernels
    + MatrixKernels
    + LightKernels
    + PhotoKernels
    + SamplerKernels
{
}

impl<D> Device for D where
    D: WeightingKernels
        + RayKernels
        + PointKernels
        + VolumeKernels
        + NetworkKernels
        + NormaliseKernels
        + MatrixKernels
        + LightKernels
        + PhotoKernels
        + SamplerKernels
{
}
