//! The trunk that both published networks have: torchvision's ResNet of basic blocks, its sizes and its tensors.

use viewfuse_nn::checkpoint::TensorShape;

/// A level of the trunk: basic blocks of two 3x3 convolutions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    /// Its channels.
    pub channels: usize,
    /// Its blocks.
    pub block_count: usize,
}

/// Whether the first block of level `level` (counted from 1) has a convolution beside it: where the level halves the image
/// or, in a trunk that stops halving, is meant to, and where it changes the channels.
pub fn needs_downsample(level: usize, in_channels: usize, out_channels: usize) -> bool {
    level > 1 || in_channels != out_channels
}

/// Every tensor of a trunk, in the order of the data; the names begin with `prefix` and a dot.
pub fn tensors(prefix: &str, stem_channels: usize, levels: &[Level]) -> Vec<TensorShape> {
    let mut tensors = Vec::new();
    let mut convolution = |name: &str, norm: &str, shape: [usize; 4]| {
        tensors.push(TensorShape { name: format!("{prefix}.{name}.weight"), shape: shape.to_vec() });
        batch_norm(&mut tensors, &format!("{prefix}.{norm}"), shape[0]);
    };
    convolution("conv1", "bn1", [stem_channels, 3, 7, 7]);
    let mut channels = stem_channels;
    for (level, Level { channels: own, block_count }) in (1..).zip(levels) {
        for block in 0..*block_count {
            let name = format!("layer{level}.{block}");
            convolution(&format!("{name}.conv1"), &format!("{name}.bn1"), [*own, channels, 3, 3]);
            convolution(&format!("{name}.conv2"), &format!("{name}.bn2"), [*own, *own, 3, 3]);
            if block == 0 && needs_downsample(level, channels, *own) {
                let shape = [*own, channels, 1, 1];
                convolution(&format!("{name}.downsample.0"), &format!("{name}.downsample.1"), shape);
            }
            channels = *own;
        }
    }
    tensors
}

/// The tensors of a batch norm.
pub fn batch_norm(tensors: &mut Vec<TensorShape>, name: &str, channels: usize) {
    for leaf in ["weight", "bias", "running_mean", "running_var"] {
        tensors.push(TensorShape { name: format!("{name}.{leaf}"), shape: vec![channels] });
    }
}
