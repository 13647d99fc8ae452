//! From an image to a volume of features: DeepLabV3+ on a ResNet trunk, with learned upsampling.

use super::{COLOUR_CHANNELS, with_bias};
use viewfuse_nn::checkpoint::{CheckpointError, Sizes, TensorShape};
use viewfuse_nn::resnet::{self, Level, batch_norm_tensors};

/// Dilations of the three dilated branches of the ASPP module (atrous spatial pyramid pooling).
pub const ASPP_RATES: [usize; 3] = [12, 24, 36];

/// The prefix of its tensors' names.
pub(in crate::genvs) const PREFIX: &str = "pixel_nerf_net.encoder";

/// Sizes of the encoder.
///
/// With `s` the image's side: the stem (7x7, stride 2) has side `s / 2`; behind a 3x3 max pool with stride 2, the
/// levels have `s / 4`, `s / 8`, `s / 16` and, with dilation 2 in place of the stride, `s / 16` again. On the last
/// level follows the ASPP module. Three stages of convolutions lead up again, to `s / 4`: each sees the levels of its
/// side (the last two levels and ASPP's result, the second level, the first). Their result and the first level's
/// high-resolution channels are fused, two more stages lead up to `s` beside the stem's channels and the image's own,
/// and a 1x1 convolution maps every pixel to the features of a row of voxels. All norms are switched off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoder {
    /// Channels after the first convolution.
    pub stem_channels: usize,
    /// The four levels behind it.
    pub levels: [Level; 4],
    /// Channels of everything behind the trunk.
    pub decoder_channels: usize,
    /// Channels to which the first level's are reduced for fusing.
    pub high_resolution_channels: usize,
    /// Features of a voxel.
    pub feature_count: usize,
    /// Voxels in depth. The volume's channel `feature * volume_depth + depth` is that feature of the voxel at that
    /// depth.
    pub volume_depth: usize,
}

impl Encoder {
    /// Those of the published network.
    pub(super) fn published() -> Encoder {
        let level = |channels, block_count| Level { channels, block_count };
        Encoder {
            stem_channels: 64,
            levels: [level(64, 3), level(128, 4), level(256, 6), level(512, 3)],
            decoder_channels: 256,
            high_resolution_channels: 48,
            feature_count: 16,
            volume_depth: 64,
        }
    }

    /// Those with a quarter of the channels, and two blocks a level.
    pub(super) fn small() -> Encoder {
        let published = Encoder::published();
        Encoder {
            stem_channels: published.stem_channels / 4,
            levels: published.levels.map(|level| Level { channels: level.channels / 4, block_count: 2 }),
            decoder_channels: published.decoder_channels / 4,
            high_resolution_channels: published.high_resolution_channels / 4,
            feature_count: published.feature_count,
            volume_depth: published.volume_depth / 2,
        }
    }

    /// The small ones with a narrower decoder, whose images are large, and half as many depths.
    pub(super) fn narrow(decoder_channels: usize) -> Encoder {
        let small = Encoder::small();
        Encoder { decoder_channels, volume_depth: small.volume_depth / 2, ..small }
    }

    /// Channels of the volume as an image.
    pub fn volume_channels(&self) -> usize {
        self.feature_count * self.volume_depth
    }

    /// Reads the sizes from the tensors; the number of features is given.
    pub(super) fn of(sizes: &Sizes<'_>, feature_count: usize) -> Result<Encoder, CheckpointError> {
        let size = |name: &str, axis| sizes.size(&format!("{PREFIX}.{name}"), 4, axis);
        let level = |level: usize| {
            let block_count = sizes.count(|block| format!("{PREFIX}.encoder.layer{level}.{block}.conv1.weight"));
            Ok(Level { channels: size(&format!("encoder.layer{level}.0.conv1.weight"), 0)?, block_count })
        };
        let volume_channels = size("volume_head.reshape_conv.weight", 0)?;
        if volume_channels % feature_count != 0 {
            return Err(sizes.refuse(format!(
                "{PREFIX}.volume_head.reshape_conv has {volume_channels} output channels, not whole voxels of \
                 {feature_count} features"
            )));
        }
        Ok(Encoder {
            stem_channels: size("encoder.conv1.weight", 0)?,
            levels: [level(1)?, level(2)?, level(3)?, level(4)?],
            decoder_channels: size("decoder.block2.0.1.weight", 0)?,
            high_resolution_channels: size("decoder.block1.0.weight", 0)?,
            feature_count,
            volume_depth: volume_channels / feature_count,
        })
    }

    /// Its tensors, in the order of the data.
    pub(super) fn tensors(&self) -> Vec<TensorShape> {
        let mut tensors = resnet::tensors(&format!("{PREFIX}.encoder"), self.stem_channels, &self.levels);
        let [first, second, third, last] = self.levels.each_ref().map(|level| level.channels);
        let (inner, high) = (self.decoder_channels, self.high_resolution_channels);
        let decoder = format!("{PREFIX}.decoder");
        let branch = |branch: usize| format!("{decoder}.aspp.0.convs.{branch}");
        let pooled = 1 + ASPP_RATES.len();
        pointwise(&mut tensors, &format!("{}.0", branch(0)), inner, last);
        batch_norm_tensors(&mut tensors, &format!("{}.1", branch(0)), inner);
        for dilated in 1..pooled {
            separable(&mut tensors, &format!("{}.0", branch(dilated)), inner, last);
            batch_norm_tensors(&mut tensors, &format!("{}.1", branch(dilated)), inner);
        }
        pointwise(&mut tensors, &format!("{}.1", branch(pooled)), inner, last);
        batch_norm_tensors(&mut tensors, &format!("{}.2", branch(pooled)), inner);
        pointwise(&mut tensors, &format!("{decoder}.aspp.0.project.0"), inner, (pooled + 1) * inner);
        batch_norm_tensors(&mut tensors, &format!("{decoder}.aspp.0.project.1"), inner);
        separable(&mut tensors, &format!("{decoder}.aspp.1"), inner, inner);
        batch_norm_tensors(&mut tensors, &format!("{decoder}.aspp.2"), inner);
        pointwise(&mut tensors, &format!("{decoder}.block1.0"), high, first);
        batch_norm_tensors(&mut tensors, &format!("{decoder}.block1.1"), high);
        separable(&mut tensors, &format!("{decoder}.block2.0"), inner, inner + high);
        batch_norm_tensors(&mut tensors, &format!("{decoder}.block2.1"), inner);
        // Convolutions by their inputs' channels, with transposed ones between that double the side.
        let up = format!("{decoder}.modified_up");
        stage(&mut tensors, &format!("{up}.stage1"), inner, third + last + inner);
        doubling(&mut tensors, &format!("{up}.upconv1"), inner);
        stage(&mut tensors, &format!("{up}.stage2"), inner, second + inner);
        doubling(&mut tensors, &format!("{up}.upconv2"), inner);
        stage(&mut tensors, &format!("{up}.stage3"), inner, first + inner);
        with_bias(&mut tensors, &format!("{PREFIX}.segmentation_head.0"), &[1, inner, 1, 1]);
        let head = format!("{PREFIX}.volume_head");
        doubling(&mut tensors, &format!("{head}.up.upconv1"), inner);
        stage(&mut tensors, &format!("{head}.up.stage1"), inner, self.stem_channels + inner);
        doubling(&mut tensors, &format!("{head}.up.upconv2"), inner);
        stage(&mut tensors, &format!("{head}.up.stage2"), inner, COLOUR_CHANNELS + inner);
        with_bias(&mut tensors, &format!("{head}.reshape_conv"), &[self.volume_channels(), inner, 1, 1]);
        tensors
    }
}

/// A 1x1 convolution without bias.
fn pointwise(tensors: &mut Vec<TensorShape>, name: &str, out_channels: usize, in_channels: usize) {
    tensors.push(TensorShape { name: format!("{name}.weight"), shape: vec![out_channels, in_channels, 1, 1] });
}

/// A 3x3 depthwise convolution, then a 1x1 convolution, both without bias.
fn separable(tensors: &mut Vec<TensorShape>, name: &str, out_channels: usize, in_channels: usize) {
    tensors.push(TensorShape { name: format!("{name}.0.weight"), shape: vec![in_channels, 1, 3, 3] });
    pointwise(tensors, &format!("{name}.1"), out_channels, in_channels);
}

/// Three 3x3 convolutions; the layers between them have no parameters.
fn stage(tensors: &mut Vec<TensorShape>, name: &str, out_channels: usize, in_channels: usize) {
    for (layer, in_channels) in [(0, in_channels), (2, out_channels), (4, out_channels)] {
        with_bias(tensors, &format!("{name}.{layer}"), &[out_channels, in_channels, 3, 3]);
    }
}

/// A transposed 2x2 convolution with stride 2.
fn doubling(tensors: &mut Vec<TensorShape>, name: &str, channels: usize) {
    with_bias(tensors, &format!("{name}.0"), &[channels, channels, 2, 2]);
}
