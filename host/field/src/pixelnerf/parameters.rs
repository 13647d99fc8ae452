//! A checkpoint's parameters as the kernels take them: batch norm folded into the convolutions, matrices transposed.

use super::architecture::{Architecture, Pass};
use crate::resnet::needs_downsample;
use viewfuse_device::{Device, Layer, LayerShape};
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// What torchvision's batch norm adds to variances.
const VARIANCE_FLOOR: f64 = 1.0e-5;

/// Weights and bias of a layer on the host; see [`Layer`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HostLayer {
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl HostLayer {
    fn load<D: Device>(&self, device: &D) -> Result<Layer<D>, D::Error> {
        let column_count = self.bias.len();
        let inner_count = self.weights.len() / column_count;
        let shape = LayerShape { inner_count, column_count, has_wide_images: false };
        Layer::new(device, &shape, &self.weights, &self.bias)
    }
}

/// A basic block: two convolutions, and one beside them where sizes change.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block<L> {
    pub(super) first: L,
    pub(super) second: L,
    pub(super) beside: Option<L>,
}

/// The trunk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trunk<L> {
    pub(super) stem: L,
    /// `[level][block]`.
    pub(super) levels: Vec<Vec<Block<L>>>,
}

/// A point network.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PointNetwork<L> {
    pub(super) entry: L,
    /// Latents into the first blocks.
    pub(super) injections: Vec<L>,
    /// Two layers each.
    pub(super) blocks: Vec<[L; 2]>,
    pub(super) exit: L,
}

/// All parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameters<L> {
    pub(super) trunk: Trunk<L>,
    /// The first pass's, then the second's if it has its own.
    pub(super) networks: Vec<PointNetwork<L>>,
}

impl Parameters<HostLayer> {
    /// Reads them from a checkpoint of this architecture.
    pub(super) fn read(
        checkpoint: &Checkpoint,
        architecture: &Architecture,
    ) -> Result<Parameters<HostLayer>, CheckpointError> {
        let mut levels = Vec::new();
        let mut channels = architecture.stem_channels;
        for (level, sizes) in (1..).zip(&architecture.levels) {
            let mut blocks = Vec::new();
            for block in 0..sizes.block_count {
                let name = format!("layer{level}.{block}");
                let convolution =
                    |index| folded(checkpoint, &format!("{name}.conv{index}"), &format!("{name}.bn{index}"));
                let has_beside = block == 0 && needs_downsample(level, channels, sizes.channels);
                blocks.push(Block {
                    first: convolution(1)?,
                    second: convolution(2)?,
                    beside: match has_beside {
                        true => {
                            Some(folded(checkpoint, &format!("{name}.downsample.0"), &format!("{name}.downsample.1"))?)
                        }
                        false => None,
                    },
                });
                channels = sizes.channels;
            }
            levels.push(blocks);
        }
        let trunk = Trunk { stem: folded(checkpoint, "conv1", "bn1")?, levels };
        let networks = architecture
            .passes()
            .iter()
            .map(|pass| PointNetwork::read(checkpoint, architecture, *pass))
            .collect::<Result<_, _>>()?;
        Ok(Parameters { trunk, networks })
    }

    /// Takes them to a device.
    pub(super) fn load<D: Device>(&self, device: &D) -> Result<Parameters<Layer<D>>, D::Error> {
        let block = |block: &Block<HostLayer>| {
            Ok(Block {
                first: block.first.load(device)?,
                second: block.second.load(device)?,
                beside: block.beside.as_ref().map(|layer| layer.load(device)).transpose()?,
            })
        };
        let layers = |layers: &[HostLayer]| layers.iter().map(|layer| layer.load(device)).collect::<Result<_, _>>();
        let network = |network: &PointNetwork<HostLayer>| {
            let pair = |[first, second]: &[HostLayer; 2]| Ok([first.load(device)?, second.load(device)?]);
            Ok(PointNetwork {
                entry: network.entry.load(device)?,
                injections: layers(&network.injections)?,
                blocks: network.blocks.iter().map(pair).collect::<Result<_, D::Error>>()?,
                exit: network.exit.load(device)?,
            })
        };
        Ok(Parameters {
            trunk: Trunk {
                stem: self.trunk.stem.load(device)?,
                levels: self
                    .trunk
                    .levels
                    .iter()
                    .map(|blocks| blocks.iter().map(block).collect::<Result<_, D::Error>>())
                    .collect::<Result<_, _>>()?,
            },
            networks: self.networks.iter().map(network).collect::<Result<_, D::Error>>()?,
        })
    }
}

impl PointNetwork<HostLayer> {
    fn read(
        checkpoint: &Checkpoint,
        architecture: &Architecture,
        pass: Pass,
    ) -> Result<PointNetwork<HostLayer>, CheckpointError> {
        let prefix = pass.prefix();
        let (width, latent_channels) = (architecture.width, architecture.latent_channels());
        let linear = |name: String, inner| linear(checkpoint, &format!("{prefix}.{name}"), inner);
        let pair = |block| {
            let layers =
                [linear(format!("blocks.{block}.fc_0"), width)?, linear(format!("blocks.{block}.fc_1"), width)?];
            Ok::<_, CheckpointError>(layers)
        };
        Ok(PointNetwork {
            entry: linear("lin_in".to_owned(), architecture.embedded_len())?,
            injections: (0..architecture.injected_count)
                .map(|block| linear(format!("lin_z.{block}"), latent_channels))
                .collect::<Result<_, _>>()?,
            blocks: (0..architecture.block_count).map(pair).collect::<Result<_, CheckpointError>>()?,
            exit: linear("lin_out".to_owned(), width)?,
        })
    }
}

/// A linear layer, from `[out][in]` to `[in][out]`.
fn linear(checkpoint: &Checkpoint, name: &str, inner: usize) -> Result<HostLayer, CheckpointError> {
    let weights = checkpoint.tensor(&format!("{name}.weight"))?;
    Ok(HostLayer { weights: transposed(&weights, inner), bias: checkpoint.tensor(&format!("{name}.bias"))? })
}

/// A convolution with its batch norm folded in (in `f64`): from `[out][in][row][column]` to `[row][column][in][out]`.
fn folded(checkpoint: &Checkpoint, convolution: &str, norm: &str) -> Result<HostLayer, CheckpointError> {
    let tensor = |name: String| checkpoint.tensor(&format!("encoder.model.{name}"));
    let weights = tensor(format!("{convolution}.weight"))?;
    let (scale, shift) = (tensor(format!("{norm}.weight"))?, tensor(format!("{norm}.bias"))?);
    let (mean, variance) = (tensor(format!("{norm}.running_mean"))?, tensor(format!("{norm}.running_var"))?);
    let (out_channels, shape) = (scale.len(), &checkpoint.shapes()[&format!("encoder.model.{convolution}.weight")]);
    let (in_channels, window) = (shape[1], shape[2] * shape[3]);
    let factors: Vec<f64> = scale
        .iter()
        .zip(&variance)
        .map(|(scale, variance)| f64::from(*scale) / (f64::from(*variance).max(0.0) + VARIANCE_FLOOR).sqrt())
        .collect();
    let mut ordered = Vec::with_capacity(weights.len());
    for place in 0..window {
        for in_channel in 0..in_channels {
            for (out_channel, factor) in factors.iter().enumerate() {
                let weight = weights[(out_channel * in_channels + in_channel) * window + place];
                ordered.push((f64::from(weight) * factor) as f32);
            }
        }
    }
    let bias = (0..out_channels)
        .map(|channel| (f64::from(shift[channel]) - f64::from(mean[channel]) * factors[channel]) as f32)
        .collect();
    Ok(HostLayer { weights: ordered, bias })
}

/// `[outer][inner]` as `[inner][outer]`.
fn transposed(values: &[f32], inner: usize) -> Vec<f32> {
    let outer = values.len() / inner;
    (0..inner * outer).map(|at| values[at % outer * inner + at / outer]).collect()
}
