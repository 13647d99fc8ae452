//! A view's grid of latents, or of a layer's outputs for them, that points look up: in `f32`, or in half precision
//! (f16).

use viewfuse_core::camera::CameraBlock;
use viewfuse_core::half_precision::word_count;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::pixelnerf::GatherBlock;

/// Numbers `[row][column][channel]`.
pub(super) struct Grid<D: Device> {
    nodes: Nodes<D>,
    number_count: u32,
}

enum Nodes<D: Device> {
    /// In `f32`.
    Whole(D::Buffer<f32>),
    /// In half precision (f16), two in a word: the nearest to each, off by at most 2^-11 of it.
    F16(D::Buffer<u32>),
}

impl<D: Device> Grid<D> {
    /// Takes `number_count` values; with `half` they are packed into half precision.
    pub(super) fn new(
        device: &D,
        values: D::Buffer<f32>,
        number_count: u32,
        half: bool,
    ) -> Result<Grid<D>, DeviceError> {
        let nodes = if half {
            let mut words = device.zeros(word_count(number_count) as usize)?;
            device.pack_f16(&number_count, &values, &mut words)?;
            Nodes::F16(words)
        } else {
            Nodes::Whole(values)
        };
        Ok(Grid { nodes, number_count })
    }

    /// Bytes that it takes, and that it took in `f32`.
    pub(super) fn bytes(&self) -> [u64; 2] {
        [matches!(self.nodes, Nodes::F16(_)), false].map(|half| grid_bytes(self.number_count, half))
    }

    /// Interpolates every channel at points, by [`GatherBlock`], and adds the residual.
    pub(super) fn gather(
        &self,
        device: &D,
        block: &GatherBlock,
        views: &D::Buffer<CameraBlock>,
        points: &D::Buffer<RayPoint>,
        residual: Option<&D::Buffer<f32>>,
        gathered: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        match &self.nodes {
            Nodes::Whole(values) => device.gather_latents(block, views, points, values, residual, gathered),
            Nodes::F16(words) => device.gather_latents_f16(block, views, points, words, residual, gathered),
        }
    }
}

/// Bytes of a grid of so many numbers.
pub(super) fn grid_bytes(number_count: u32, half: bool) -> u64 {
    4 * u64::from(if half { word_count(number_count) } else { number_count })
}
