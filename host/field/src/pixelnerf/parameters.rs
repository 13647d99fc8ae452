//! A checkpoint's parameters in the layers' form: batch norms folded into the convolutions, matrices transposed.

use super::architecture::{Architecture, Pass};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_nn::convolution::Convolution;
use viewfuse_nn::linear::Linear;
use viewfuse_nn::loader::Tensors;
use viewfuse_nn::resnet::{BATCH_NORM_EPSILON, ResNet};
use viewfuse_nn::weights::{ConvolutionWeights, LinearWeights};

/// The prefix of the trunk's tensors.
const TRUNK: &str = "encoder.model.";

/// A point network.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PointNetwork<L> {
    pub(super) lin_in: L,
    /// `lin_z` of the first blocks.
    pub(super) lin_z: Vec<L>,
    /// `fc_0` and `fc_1` of each block.
    pub(super) blocks: Vec<[L; 2]>,
    pub(super) lin_out: L,
}

/// All parameters, of convolutions and of linear layers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameters<C, L> {
    pub(super) trunk: ResNet<C>,
    /// The first pass's, then the second's if it has its own.
    pub(super) networks: Vec<PointNetwork<L>>,
}

/// On the host.
pub(super) type HostParameters = Parameters<ConvolutionWeights, LinearWeights>;
/// On a device.
pub(super) type DeviceParameters<D> = Parameters<Convolution<D>, Linear<D>>;

impl HostParameters {
    /// Reads them from a checkpoint of this architecture.
    pub(super) fn read(checkpoint: &Checkpoint, architecture: &Architecture) -> Result<Self, CheckpointError> {
        let tensors = Tensors { checkpoint, prefix: TRUNK };
        let trunk = ResNet::new(architecture.stem_channels, &architecture.levels);
        let trunk = ResNet { has_pool: architecture.has_pool, ..trunk }
            .try_map(|layer| tensors.convolution_with_norm(&layer.name, &layer.norm, BATCH_NORM_EPSILON))?;
        let network = |pass: &Pass| PointNetwork::read(checkpoint, architecture, *pass);
        Ok(Parameters { trunk, networks: architecture.passes().iter().map(network).collect::<Result<_, _>>()? })
    }

    /// Takes them to a device.
    pub(super) fn load<D: Device>(&self, device: &D) -> Result<DeviceParameters<D>, DeviceError> {
        // Not the algorithm for large images: a view is encoded once, and rounding is the same for all sizes.
        let trunk = self.trunk.try_map(|convolution| convolution.load(device, 0))?;
        let network = |network: &PointNetwork<LinearWeights>| {
            let block = |[fc_0, fc_1]: &[LinearWeights; 2]| Ok([fc_0.load(device)?, fc_1.load(device)?]);
            Ok(PointNetwork {
                lin_in: network.lin_in.load(device)?,
                lin_z: network.lin_z.iter().map(|layer| layer.load(device)).collect::<Result<_, _>>()?,
                blocks: network.blocks.iter().map(block).collect::<Result<_, DeviceError>>()?,
                lin_out: network.lin_out.load(device)?,
            })
        };
        Ok(Parameters { trunk, networks: self.networks.iter().map(network).collect::<Result<_, DeviceError>>()? })
    }
}

impl PointNetwork<LinearWeights> {
    fn read(checkpoint: &Checkpoint, architecture: &Architecture, pass: Pass) -> Result<Self, CheckpointError> {
        let prefix = format!("{}.", pass.prefix());
        let tensors = Tensors { checkpoint, prefix: &prefix };
        let lin_z = (0..architecture.injected_count).map(|block| tensors.linear(&format!("lin_z.{block}")));
        let blocks = (0..architecture.block_count).map(|block| {
            Ok([tensors.linear(&format!("blocks.{block}.fc_0"))?, tensors.linear(&format!("blocks.{block}.fc_1"))?])
        });
        Ok(PointNetwork {
            lin_in: tensors.linear("lin_in")?,
            lin_z: lin_z.collect::<Result<_, _>>()?,
            blocks: blocks.collect::<Result<_, CheckpointError>>()?,
            lin_out: tensors.linear("lin_out")?,
        })
    }
}
