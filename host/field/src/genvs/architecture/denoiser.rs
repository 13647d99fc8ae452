//! The denoiser's architecture: the U-Net of DDPM++ with residual inputs (`SongUNet` in the code of "Elucidating the
//! Design Space of Diffusion-Based Generative Models"), block by block.

use super::{COLOUR_CHANNELS, with_bias};
use serde::Serialize;
use std::collections::BTreeMap;
use viewfuse_nn::checkpoint::{CheckpointError, Sizes, TensorShape};

/// The prefix of its tensors' names.
pub(in crate::genvs) const PREFIX: &str = "denoiser.model";

/// The most blocks of a level.
const MAX_BLOCKS: usize = 64;

/// Groups of the family's group norms: 32, but at least 4 channels each.
pub fn group_count(channels: usize) -> usize {
    (channels / 4).clamp(1, 32)
}

/// A level of the U-Net.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DenoiserLevel {
    /// Its channels.
    pub channels: usize,
    /// Whether it has self-attention: in all blocks of the encoder, in the last block of the decoder.
    pub has_attention: bool,
}

/// Sizes of the denoiser.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Denoiser {
    /// Side of its images, pixels. Each level but the first has half the side of the one before.
    pub image_side: usize,
    /// Channels of the noisy picture and the features behind it.
    pub in_channels: usize,
    /// Channels after the first convolution.
    pub base_channels: usize,
    /// Length of the noise level's embedding: as many cosines as sines.
    pub noise_channels: usize,
    /// Length of the noise level's vector that every block reads.
    pub embedding_channels: usize,
    /// The levels.
    pub levels: Vec<DenoiserLevel>,
    /// Blocks of a level in the encoder. The decoder has one more.
    pub block_count: usize,
    /// What its estimate is relative to.
    pub estimate: Estimate,
}

/// The denoiser's estimate of the picture behind a noisy one `x`, from the network's output `F`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimate {
    /// `c_skip x + c_out F`, as published (Karras et al. 2022, equation 7).
    #[default]
    Published,
    /// `c_skip x + c_out F + (1 - c_skip) C`, with the colours `C` that the first three features show, which are its
    /// difference from white. Where noise hides the picture, `F = 0` gives these colours instead of grey: the network
    /// only learns what they lack. Not published.
    FromColours,
}

/// A 3x3 convolution with bias.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// The prefix of its tensors' names.
    pub name: String,
    /// Channels of its input.
    pub in_channels: usize,
    /// Channels of its output.
    pub out_channels: usize,
    /// Side of its output; of a residual input, the side after the mean of 2x2 pixels.
    pub side: usize,
}

/// Resampling of a block, before its convolutions `conv0` and `skip`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resampling {
    /// Nothing.
    None,
    /// Halves it: the mean of 2x2 pixels.
    Down,
    /// Doubles it: every pixel four times.
    Up,
}

/// A residual block: `norm0`, `conv0`, `affine` of the noise level, `norm1`, `conv1`, `skip` beside them where sizes
/// change, and `norm2`, `qkv`, `proj` where it attends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The prefix of its tensors' names.
    pub name: String,
    /// Channels of its input, those of the skip connection included.
    pub in_channels: usize,
    /// Channels of the skip connection, the last of the input: the latest kept result that is not used yet. 0 without a
    /// skip connection.
    pub joined_channels: usize,
    /// Channels of its output.
    pub out_channels: usize,
    /// Side of its output.
    pub side: usize,
    /// Its resampling.
    pub resampling: Resampling,
    /// Whether every pixel attends to all, with one head.
    pub has_attention: bool,
}

impl Block {
    /// Whether there is a 1x1 convolution `skip` beside it.
    pub fn has_skip(&self) -> bool {
        self.in_channels != self.out_channels || self.resampling != Resampling::None
    }
}

/// A step of the U-Net's encoder. Results are kept for the decoder's skip connections.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DenoiserStep {
    /// The first convolution; its result is kept.
    Convolution(Convolution),
    /// A block; its result is kept.
    Block(Block),
    /// The residual input: a convolution of the last residual input (at first, of the network's own input), then the
    /// mean of 2x2 pixels. The sum of the result and the image so far, divided by the square root of 2, becomes the
    /// image, replaces the last kept result, and is the next residual input.
    Residual(Convolution),
}

/// The metadata key of [`Estimate`]: the name of one that is not the published one.
pub(super) const ESTIMATE: &str = "viewfuse.estimate";
const FROM_COLOURS: &str = "colours";
const AS_PUBLISHED: &str = "published";

impl Estimate {
    fn of(sizes: &Sizes<'_>) -> Result<Estimate, CheckpointError> {
        match sizes.checkpoint().metadata().get(ESTIMATE).map(String::as_str) {
            None | Some(AS_PUBLISHED) => Ok(Estimate::Published),
            Some(FROM_COLOURS) => Ok(Estimate::FromColours),
            Some(other) => Err(sizes.refuse(format!(
                "its metadata says {ESTIMATE} = '{other}'; '{AS_PUBLISHED}' and '{FROM_COLOURS}' are known"
            ))),
        }
    }
}

impl Denoiser {
    /// Sizes in a checkpoint's metadata that its tensors do not determine.
    pub(super) fn metadata(&self) -> BTreeMap<String, String> {
        let name = match self.estimate {
            Estimate::Published => AS_PUBLISHED,
            Estimate::FromColours => FROM_COLOURS,
        };
        BTreeMap::from([(ESTIMATE.to_owned(), name.to_owned())])
    }

    /// Those of the published network.
    pub(super) fn published(in_channels: usize) -> Denoiser {
        Denoiser::with_multipliers([128, in_channels, 128, 4], &[1, 1, 2, 2, 2])
    }

    /// Those with a quarter of the channels, for images of half the side, with three levels.
    pub(super) fn small(in_channels: usize) -> Denoiser {
        Denoiser::with_multipliers([64, in_channels, 32, 2], &[1, 2, 2])
    }

    /// Those with these channels at the first level, twice as many at every further one, and one block a level.
    pub(super) fn narrow(image_side: usize, in_channels: usize, base_channels: usize) -> Denoiser {
        Denoiser::with_multipliers([image_side, in_channels, base_channels, 1], &[1, 2, 4])
    }

    /// Levels of multiples of the first one's channels, and attention where images have 16 pixels on a side.
    fn with_multipliers(
        [image_side, in_channels, base_channels, block_count]: [usize; 4],
        multipliers: &[usize],
    ) -> Denoiser {
        let level = |(level, multiplier): (usize, &usize)| DenoiserLevel {
            channels: base_channels * multiplier,
            has_attention: image_side >> level == 16,
        };
        Denoiser {
            image_side,
            in_channels,
            base_channels,
            noise_channels: base_channels,
            embedding_channels: 4 * base_channels,
            levels: multipliers.iter().enumerate().map(level).collect(),
            block_count,
            estimate: Estimate::Published,
        }
    }

    /// Reads the sizes from the tensors.
    pub(super) fn of(sizes: &Sizes<'_>) -> Result<Denoiser, CheckpointError> {
        let part = format!("{PREFIX}.enc.");
        let side_of = |name: &str| {
            let (side, other) = name.strip_prefix(&part)?.strip_suffix("_conv.weight")?.split_once('x')?;
            side.parse().ok().filter(|_| side == other)
        };
        let image_side = sizes.checkpoint().shapes().keys().find_map(|name| side_of(name));
        let Some(image_side @ 1..=4096) = image_side else {
            return Err(sizes.refuse(format!(
                "the denoiser has no first convolution that tells the side of its images, such as \
                    {part}128x128_conv.weight"
            )));
        };
        let block = |level: usize, block: usize, leaf: &str| {
            format!("{part}{side}x{side}_block{block}.{leaf}.weight", side = image_side >> level)
        };
        let level_count =
            (0..usize::BITS as usize).take_while(|&level| sizes.shape(&block(level, 0, "conv0")).is_some()).count();
        let block_count = sizes.count(|index| block(0, index, "conv0"));
        if level_count == 0 || block_count > MAX_BLOCKS {
            return Err(sizes.refuse(format!(
                "the denoiser has {level_count} levels and {block_count} blocks in the first; at least one of each is \
                 needed, and at most {MAX_BLOCKS} blocks"
            )));
        }
        if image_side % (1 << (level_count - 1)) != 0 {
            return Err(sizes.refuse(format!(
                "the denoiser has {level_count} levels, for which {image_side} pixels cannot be halved often enough"
            )));
        }
        let level = |level| {
            let channels = sizes.size(&block(level, 0, "conv0"), 4, 0)?;
            Ok(DenoiserLevel { channels, has_attention: sizes.shape(&block(level, 0, "qkv")).is_some() })
        };
        let conv = format!("{part}{image_side}x{image_side}_conv.weight");
        let denoiser = Denoiser {
            image_side,
            in_channels: sizes.size(&conv, 4, 1)?,
            base_channels: sizes.size(&conv, 4, 0)?,
            noise_channels: sizes.size(&format!("{PREFIX}.map_layer0.weight"), 2, 1)?,
            embedding_channels: sizes.size(&format!("{PREFIX}.map_layer0.weight"), 2, 0)?,
            levels: (0..level_count).map(level).collect::<Result<_, CheckpointError>>()?,
            block_count,
            estimate: Estimate::of(sizes)?,
        };
        denoiser.check(sizes)?;
        Ok(denoiser)
    }

    /// Rejects impossible sizes.
    fn check(&self, sizes: &Sizes<'_>) -> Result<(), CheckpointError> {
        if !self.noise_channels.is_multiple_of(2) {
            return Err(sizes.refuse(format!(
                "the denoiser takes noise levels as {} numbers, which are not as many cosines as sines",
                self.noise_channels
            )));
        }
        let down = self.down().into_iter().filter_map(|step| match step {
            DenoiserStep::Block(block) => Some(block),
            _ => None,
        });
        for block in down.chain(self.up()) {
            for channels in [block.in_channels, block.out_channels] {
                if channels % group_count(channels) != 0 {
                    return Err(sizes.refuse(format!(
                        "a norm of {} is to take {channels} channels in {} groups of one size",
                        block.name,
                        group_count(channels)
                    )));
                }
            }
        }
        Ok(())
    }

    /// The steps of the encoder, in order.
    pub fn down(&self) -> Vec<DenoiserStep> {
        let mut steps = Vec::new();
        let (mut channels, mut residual_channels) = (self.base_channels, self.in_channels);
        for (index, level) in self.levels.iter().enumerate() {
            let side = self.image_side >> index;
            let name = |what: &str| format!("{PREFIX}.enc.{side}x{side}_{what}");
            let convolution =
                |what: &str, in_channels| Convolution { name: name(what), in_channels, out_channels: channels, side };
            if index == 0 {
                steps.push(DenoiserStep::Convolution(convolution("conv", self.in_channels)));
            } else {
                steps.push(DenoiserStep::Block(Block::new(name("down"), channels, channels, side, Resampling::Down)));
                steps.push(DenoiserStep::Residual(convolution("aux_residual", residual_channels)));
                residual_channels = channels;
            }
            for block in 0..self.block_count {
                let block =
                    Block::new(name(&format!("block{block}")), channels, level.channels, side, Resampling::None);
                steps.push(DenoiserStep::Block(Block { has_attention: level.has_attention, ..block }));
                channels = level.channels;
            }
        }
        steps
    }

    /// The blocks of the decoder, in order.
    pub fn up(&self) -> Vec<Block> {
        let keep = |step| match step {
            DenoiserStep::Convolution(convolution) => Some(convolution.out_channels),
            DenoiserStep::Block(block) => Some(block.out_channels),
            DenoiserStep::Residual(_) => None,
        };
        let mut kept: Vec<usize> = self.down().into_iter().filter_map(keep).collect();
        let mut blocks = Vec::new();
        let mut channels = self.levels.last().map_or(self.base_channels, |level| level.channels);
        for (index, level) in self.levels.iter().enumerate().rev() {
            let side = self.image_side >> index;
            let name = |what: &str| format!("{PREFIX}.dec.{side}x{side}_{what}");
            let same = |what: &str, resampling| Block::new(name(what), channels, channels, side, resampling);
            if index + 1 == self.levels.len() {
                blocks.push(Block { has_attention: true, ..same("in0", Resampling::None) });
                blocks.push(same("in1", Resampling::None));
            } else {
                blocks.push(same("up", Resampling::Up));
            }
            for block in 0..=self.block_count {
                let joined_channels = kept.pop().unwrap_or(0);
                let in_channels = channels + joined_channels;
                let has_attention = level.has_attention && block == self.block_count;
                let block =
                    Block::new(name(&format!("block{block}")), in_channels, level.channels, side, Resampling::None);
                blocks.push(Block { joined_channels, has_attention, ..block });
                channels = level.channels;
            }
        }
        blocks
    }

    /// The norm (its name and channels) and the convolution behind the last block.
    pub fn exit(&self) -> (String, Convolution) {
        let side = self.image_side;
        let name = |what: &str| format!("{PREFIX}.dec.{side}x{side}_{what}");
        let in_channels = self.levels.first().map_or(self.base_channels, |level| level.channels);
        let convolution = Convolution { name: name("aux_conv"), in_channels, out_channels: COLOUR_CHANNELS, side };
        (name("aux_norm"), convolution)
    }

    /// Multiply-adds of the convolutions of a call for pictures of so many pixels.
    pub fn multiply_adds(&self, pixel_count: u64) -> u64 {
        let steps = self.down().into_iter().map(|step| match step {
            DenoiserStep::Convolution(convolution) | DenoiserStep::Residual(convolution) => convolution.multiply_adds(),
            DenoiserStep::Block(block) => block.multiply_adds(),
        });
        let blocks = self.up().into_iter().map(|block| block.multiply_adds());
        let trained = steps.chain(blocks).sum::<u64>() + self.exit().1.multiply_adds();
        trained / (self.image_side as u64).pow(2) * pixel_count
    }

    /// Its tensors, in the order of the data.
    pub(super) fn tensors(&self) -> Vec<TensorShape> {
        let mut tensors = Vec::new();
        let embedding = self.embedding_channels;
        with_bias(&mut tensors, &format!("{PREFIX}.map_layer0"), &[embedding, self.noise_channels]);
        with_bias(&mut tensors, &format!("{PREFIX}.map_layer1"), &[embedding, embedding]);
        for step in self.down() {
            match step {
                DenoiserStep::Convolution(convolution) | DenoiserStep::Residual(convolution) => {
                    convolution.tensors(&mut tensors);
                }
                DenoiserStep::Block(block) => block.tensors(&mut tensors, embedding),
            }
        }
        for block in self.up() {
            block.tensors(&mut tensors, embedding);
        }
        let (norm, convolution) = self.exit();
        with_bias(&mut tensors, &norm, &[convolution.in_channels]);
        convolution.tensors(&mut tensors);
        tensors
    }
}

impl Convolution {
    /// For pictures of the trained size.
    fn multiply_adds(&self) -> u64 {
        (9 * self.in_channels * self.out_channels * self.side.pow(2)) as u64
    }

    fn tensors(&self, tensors: &mut Vec<TensorShape>) {
        with_bias(tensors, &self.name, &[self.out_channels, self.in_channels, 3, 3]);
    }
}

impl Block {
    /// A block without attention and without skip connection.
    fn new(name: String, in_channels: usize, out_channels: usize, side: usize, resampling: Resampling) -> Block {
        Block { name, in_channels, joined_channels: 0, out_channels, side, resampling, has_attention: false }
    }

    /// Those of the convolutions, for pictures of the trained size.
    fn multiply_adds(&self) -> u64 {
        let (from, to) = (self.in_channels, self.out_channels);
        let skip = if self.has_skip() { from * to } else { 0 };
        let attention = if self.has_attention { 4 * to * to } else { 0 };
        ((9 * from * to + 9 * to * to + skip + attention) * self.side.pow(2)) as u64
    }

    fn tensors(&self, tensors: &mut Vec<TensorShape>, embedding: usize) {
        let (from, to) = (self.in_channels, self.out_channels);
        let mut layer = |leaf: &str, shape: &[usize]| with_bias(tensors, &format!("{}.{leaf}", self.name), shape);
        layer("norm0", &[from]);
        layer("conv0", &[to, from, 3, 3]);
        layer("affine", &[to, embedding]);
        layer("norm1", &[to]);
        layer("conv1", &[to, to, 3, 3]);
        if self.has_skip() {
            layer("skip", &[to, from, 1, 1]);
        }
        if self.has_attention {
            layer("norm2", &[to]);
            layer("qkv", &[3 * to, to, 1, 1]);
            layer("proj", &[to, to, 1, 1]);
        }
    }
}
