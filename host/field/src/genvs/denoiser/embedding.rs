//! The noise level as the network's blocks take it: what each adds to its channels.
//!
//! Source: `networks.py` (`PositionalEmbedding` with `endpoint`, its halves exchanged, and `map_layer0`, `map_layer1`,
//! `affine`). The embedding runs on the host, once a call and not once a pixel; the layers of all blocks are one product.

use super::super::layers::Loader;
use super::Outcome;
use crate::FieldError;
use viewfuse_core::math::{exp, ln, sin_cos};
use viewfuse_core::network::normalise::silu;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_device::{Device, Layer, LayerShape};
use viewfuse_nn::checkpoint::CheckpointError;

/// Ratio of the highest frequency to the lowest.
const FREQUENCY_RATIO: f32 = 10_000.0;

/// The layers of blocks, as they are read.
#[derive(Default)]
pub(super) struct Parts {
    /// `[block]`: `weights[in][out]` and bias.
    layers: Vec<(Vec<f32>, Vec<f32>)>,
    count: usize,
}

impl Parts {
    /// Reads a block's layer. Returns where its shifts will start.
    pub(super) fn push<D: Device>(&mut self, loader: &Loader<'_, D>, block: &str) -> Result<u32, CheckpointError> {
        let (weights, bias) = loader.host_linear(&format!("{block}.affine"))?;
        let first = self.count;
        self.count += bias.len();
        self.layers.push((weights, bias));
        Ok(first as u32)
    }
}

/// From noise level to shifts.
pub(super) struct Embedding<D: Device> {
    /// `weights[in][out]` and bias of two layers.
    mapping: [(Vec<f32>, Vec<f32>); 2],
    affine: Layer<D>,
    shape: LayerShape,
}

impl<D: Device> Embedding<D> {
    pub(super) fn load(loader: &Loader<'_, D>, parts: Parts) -> Outcome<Embedding<D>, D> {
        let mapping = [loader.host_linear("map_layer0")?, loader.host_linear("map_layer1")?];
        let inner_count = mapping[1].1.len();
        let mut weights = Vec::with_capacity(inner_count * parts.count);
        for inner in 0..inner_count {
            for (own, bias) in &parts.layers {
                weights.extend_from_slice(&own[inner * bias.len()..(inner + 1) * bias.len()]);
            }
        }
        let bias: Vec<f32> = parts.layers.into_iter().flat_map(|(_, bias)| bias).collect();
        let shape = LayerShape { inner_count, column_count: parts.count, has_wide_images: false };
        let affine = Layer::new(loader.device, &shape, &weights, &bias).map_err(FieldError::Device)?;
        Ok(Embedding { mapping, affine, shape })
    }

    /// The shifts of all blocks at a noise level, given as [`viewfuse_core::schedule::Preconditioning::noise`].
    pub(super) fn shifts(&self, device: &D, noise: f32) -> Result<D::Buffer<f32>, D::Error> {
        let [first, second] = &self.mapping;
        let waves = waves(noise, first.0.len() / first.1.len());
        let embedded = mapped(second, &mapped(first, &waves));
        let block = ProductBlock {
            row_count: 1,
            inner_count: self.shape.inner_count as u32,
            column_count: self.shape.column_count as u32,
            ..ProductBlock::default()
        };
        let mut shifts = device.zeros(self.shape.column_count)?;
        let Layer { weights, bias } = &self.affine;
        device.product(&block, &device.upload(&embedded)?, weights, bias, None, &mut shifts)?;
        Ok(shifts)
    }
}

/// Sines, then cosines, of the number times frequencies from 1 down to 1 / [`FREQUENCY_RATIO`], evenly spread in their
/// logarithms, both included.
fn waves(noise: f32, count: usize) -> Vec<f32> {
    let half = count / 2;
    let last = half.saturating_sub(1).max(1) as f32;
    let pairs: Vec<(f32, f32)> =
        (0..half).map(|index| sin_cos(noise * exp(-ln(FREQUENCY_RATIO) * (index as f32 / last)))).collect();
    let (sines, cosines): (Vec<f32>, Vec<f32>) = pairs.into_iter().unzip();
    [sines, cosines].concat()
}

/// A layer with [`silu`] behind it.
fn mapped((weights, bias): &(Vec<f32>, Vec<f32>), inputs: &[f32]) -> Vec<f32> {
    let mut sums = bias.clone();
    for (input, weights) in inputs.iter().zip(weights.chunks_exact(bias.len())) {
        sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += input * weight);
    }
    sums.into_iter().map(silu).collect()
}
