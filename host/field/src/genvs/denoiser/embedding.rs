//! The embedding of the noise level, and the shifts of the blocks' channels that follow from it.
//!
//! Source: `networks.py` (`PositionalEmbedding` with `endpoint`, its halves exchanged, and `map_layer0`, `map_layer1`,
//! `affine`). The embedding runs on the host, once a call and not once a pixel; the layers of all blocks are one linear
//! layer.

use super::super::architecture::DENOISER;
use crate::FieldError;
use viewfuse_core::math::{exp, ln, sin_cos};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_kernels::network::group_norm::silu;
use viewfuse_nn::checkpoint::CheckpointError;
use viewfuse_nn::linear::{Linear, LinearOptions};
use viewfuse_nn::loader::{Loader, Tensors};
use viewfuse_nn::weights::LinearWeights;

/// Ratio of the highest frequency to the lowest.
const FREQUENCY_RATIO: f32 = 10_000.0;

/// The blocks' layers `affine`, while they are loaded.
#[derive(Default)]
pub(super) struct ShiftLayers {
    layers: Vec<LinearWeights>,
    out_count: usize,
}

impl ShiftLayers {
    /// Loads a block's layer. Returns the offset of its shifts.
    pub(super) fn push(&mut self, tensors: &Tensors<'_>, block: &str) -> Result<u32, CheckpointError> {
        let layer = tensors.linear(&format!("{block}.affine"))?;
        let first = self.out_count;
        self.out_count += layer.bias.len();
        self.layers.push(layer);
        Ok(first as u32)
    }
}

/// The layers from a noise level to the shifts.
pub(super) struct Embedding<D: Device> {
    map_layer0: LinearWeights,
    map_layer1: LinearWeights,
    /// The shifts' layers of all blocks.
    affine: Linear<D>,
}

impl<D: Device> Embedding<D> {
    pub(super) fn load(loader: &Loader<'_, D>, shifts: ShiftLayers) -> Result<Embedding<D>, FieldError> {
        let [map_layer0, map_layer1] =
            ["0", "1"].map(|layer| loader.tensors.linear(&format!("{DENOISER}.map_layer{layer}")));
        let (map_layer0, map_layer1) = (map_layer0?, map_layer1?);
        let affine = LinearWeights::concatenated(&shifts.layers, map_layer1.bias.len());
        let affine = affine.load(loader.device)?;
        Ok(Embedding { map_layer0, map_layer1, affine })
    }

    /// How many shifts all blocks have.
    pub(super) fn shift_count(&self) -> usize {
        self.affine.out_count as usize
    }

    /// Writes the shifts of all blocks at a noise level, given as
    /// [`viewfuse_core::schedule::Preconditioning::noise`].
    pub(super) fn shifts(&self, device: &D, noise: f32, shifts: &mut D::Buffer<f32>) -> Result<(), DeviceError> {
        let mapped =
            |layer: &LinearWeights, inputs: &[f32]| layer.run(inputs).into_iter().map(silu).collect::<Vec<f32>>();
        let waves = waves(noise, self.map_layer0.in_count());
        let embedded = mapped(&self.map_layer1, &mapped(&self.map_layer0, &waves));
        self.affine.run(device, 1, LinearOptions::PLAIN, &device.upload(&embedded)?, None, shifts)
    }
}

/// Sines, then cosines, of the number times frequencies from 1 down to 1 / [`FREQUENCY_RATIO`], evenly spaced in their
/// logarithms, both included.
fn waves(noise: f32, count: usize) -> Vec<f32> {
    let half = count / 2;
    let last = half.saturating_sub(1).max(1) as f32;
    let pairs: Vec<(f32, f32)> =
        (0..half).map(|index| sin_cos(noise * exp(-ln(FREQUENCY_RATIO) * (index as f32 / last)))).collect();
    let (sines, cosines): (Vec<f32>, Vec<f32>) = pairs.into_iter().unzip();
    [sines, cosines].concat()
}
