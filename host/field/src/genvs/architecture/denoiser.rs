//! From features and noise to a picture: the U-Net of DDPM++ with residual inputs (`SongUNet` in the code of "Elucidating
//! the Design Space of Diffusion-Based Generative Models"), step by step.

use super::{COLOUR_CHANNELS, with_bias};
use viewfuse_nn::checkpoint::{CheckpointError, Sizes, TensorShape};

/// What the names of its tensors begin with.
pub(in crate::genvs) const PREFIX: &str = "denoiser.model";

/// Most blocks of a level.
const MOST_BLOCKS: usize = 64;

/// Groups in which the group norms of the family take channels: 32, but no fewer than 4 channels each.
pub fn group_count(channels: usize) -> usize {
    (channels / 4).clamp(1, 32)
}

/// A level of the U-Net.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DenoiserLevel {
    /// Its channels.
    pub channels: usize,
    /// Whether its blocks attend to the whole image: all on the way down, the last on the way up.
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
    /// Numbers that the noise level is embedded in: as many cosines as sines.
    pub noise_channels: usize,
    /// Numbers that every block takes of the noise level.
    pub embedding_channels: usize,
    /// The levels.
    pub levels: Vec<DenoiserLevel>,
    /// Blocks of a level on the way down. On the way up there is one more.
    pub block_count: usize,
}

/// A 3x3 convolution with bias.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// What its tensors' names begin with.
    pub name: String,
    /// Channels that it takes.
    pub in_channels: usize,
    /// Channels that it makes.
    pub out_channels: usize,
    /// Side of the image that it makes; of a residual input, side of what is made of that.
    pub side: usize,
}

/// What a block does to the side of an image, in front of its convolutions `conv0` and `skip`.
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
    /// What its tensors' names begin with.
    pub name: String,
    /// Channels that it takes, those that are joined included.
    pub in_channels: usize,
    /// Channels of these, the last, that come from the way down: the newest of what was kept and not used yet. 0 where
    /// nothing is joined.
    pub joined_channels: usize,
    /// Channels that it makes.
    pub out_channels: usize,
    /// Side of the image that it makes.
    pub side: usize,
    /// What it does to the side.
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

/// A step on the way down. Results are kept for the way up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DenoiserStep {
    /// The first; its result is kept.
    Convolution(Convolution),
    /// A block; its result is kept.
    Block(Block),
    /// The residual input: a convolution of the last residual input (the first time, of the network's own input), of which
    /// the mean of 2x2 pixels is taken then. Sum of it and the image so far, divided by the square root of 2, it becomes
    /// the image, replaces what was kept last, and is the next residual input.
    Residual(Convolution),
}

impl Denoiser {
    /// Of the published network.
    pub(super) fn published(in_channels: usize) -> Denoiser {
        Denoiser::with_multipliers([128, in_channels, 128, 4], &[1, 1, 2, 2, 2])
    }

    /// With a quarter of the channels, for images of half the side, of three levels.
    pub(super) fn small(in_channels: usize) -> Denoiser {
        Denoiser::with_multipliers([64, in_channels, 32, 2], &[1, 2, 2])
    }

    /// With these channels at the first level, twice as many at every further one, and a block a level.
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
        }
    }

    /// Reads the sizes off the tensors.
    pub(super) fn of(sizes: &Sizes<'_>) -> Result<Denoiser, CheckpointError> {
        let part = format!("{PREFIX}.enc.");
        let side_of = |name: &str| {
            let (side, other) = name.strip_prefix(&part)?.strip_suffix("_conv.weight")?.split_once('x')?;
            side.parse().ok().filter(|_| side == other)
        };
        let image_side = sizes.checkpoint().shapes().keys().find_map(|name| side_of(name));
        let Some(image_side @ 1..=4096) = image_side else {
            return Err(sizes.refuse(format!(
                "the denoiser has no first convolution that tells the side of its images, such as {part}128x128_conv.weight"
            )));
        };
        let block = |level: usize, block: usize, leaf: &str| {
            format!("{part}{side}x{side}_block{block}.{leaf}.weight", side = image_side >> level)
        };
        let level_count =
            (0..usize::BITS as usize).take_while(|&level| sizes.shape(&block(level, 0, "conv0")).is_some()).count();
        let block_count = sizes.count(|index| block(0, index, "conv0"));
        if level_count == 0 || block_count > MOST_BLOCKS {
            return Err(sizes.refuse(format!(
                "the denoiser has {level_count} levels and {block_count} blocks in the first; at least one of each is \
                 needed, and at most {MOST_BLOCKS} blocks"
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
        };
        denoiser.check(sizes)?;
        Ok(denoiser)
    }

    /// Refuses sizes that no network can have.
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

    /// The steps on the way down, in order.
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

    /// The blocks on the way up, in order.
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
    fn tensors(&self, tensors: &mut Vec<TensorShape>) {
        with_bias(tensors, &self.name, &[self.out_channels, self.in_channels, 3, 3]);
    }
}

impl Block {
    /// Without attention, and nothing joined.
    fn new(name: String, in_channels: usize, out_channels: usize, side: usize, resampling: Resampling) -> Block {
        Block { name, in_channels, joined_channels: 0, out_channels, side, resampling, has_attention: false }
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
