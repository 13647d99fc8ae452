//! Test networks: checkpoints with deterministic initialisation, for comparison with other implementations and for
//! timing.

use super::architecture::Architecture;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_nn::initialisation;

/// Factors of tensors of test networks, so that volumes and densities vary.
const GAINS: [(&str, f32); 2] =
    [("pixel_nerf_net.encoder.volume_head.reshape_conv.weight", 8.0), ("pixel_nerf_net.mlp.layers.2.weight", 4.0)];

/// Every tensor by [`initialisation`], computed when it is read. With [`Architecture::published`] it is the network of
/// the reference values.
pub fn deterministic(architecture: &Architecture) -> Checkpoint {
    Checkpoint::computed("genvs", architecture.tensors(), architecture.metadata(), |tensor| {
        let mut values = initialisation::tensor(&tensor.name, &tensor.shape);
        if let Some((_, gain)) = GAINS.iter().find(|(name, _)| *name == tensor.name) {
            values.iter_mut().for_each(|value| *value *= gain);
        }
        values
    })
}

/// [`deterministic`] of the published size, or with any number of the small member of the family.
pub fn deterministic_of_size(small: Option<u16>) -> Checkpoint {
    deterministic(&small.map_or_else(Architecture::published, |_| Architecture::small()))
}
