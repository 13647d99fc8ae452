//! The four trunks, with the names that torchvision's `state_dict`s give their tensors.
//!
//! Sources: torchvision's `alexnet`, `vgg16`, `squeezenet1_1`, `inception_v3`; the taps are those of LPIPS
//! (richzhang/PerceptualSimilarity, `pretrained_networks.py`), of DISTS (dingkeyan93/DISTS, `DISTS_pt.py`) and of
//! pytorch-fid (mseitzer/pytorch-fid, `inception.py`).

use super::{Convolution, Step};
use viewfuse_nn::pool::MaxPool;

type Steps = Vec<Step<Convolution>>;

/// How VGG16 halves its images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pooling {
    /// As torchvision does, and LPIPS.
    Max,
    /// As DISTS does.
    L2,
}

/// Which Inception v3 it is: the files have the same names, and the networks pool differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InceptionKind {
    /// The one that FID is defined with, `pt_inception-2015-12-05` of pytorch-fid: average pools do not count the
    /// border, the last block has a max pool instead, and it has 1008 classes.
    Fid,
    /// Torchvision's, of 1000 classes: average pools count zeros outside of the image. Distances differ from those of
    /// published tables.
    Torchvision,
}

const POOL_3: MaxPool = MaxPool { size: 3, stride: 2, padding: 0, ceil_mode: false };
const POOL_2: MaxPool = MaxPool { size: 2, stride: 2, padding: 0, ceil_mode: false };

fn convolve(name: impl Into<String>, channels: usize, side: usize, stride: usize, padding: usize) -> Step<Convolution> {
    Step::Convolve(Convolution::square(name, channels, side, stride, padding))
}

/// AlexNet, tapped after each of its five convolutions: 64, 192, 384, 256 and 256 channels.
pub fn alexnet() -> Steps {
    vec![
        convolve("features.0", 64, 11, 4, 2),
        Step::Tap,
        Step::MaxPool(POOL_3),
        convolve("features.3", 192, 5, 1, 2),
        Step::Tap,
        Step::MaxPool(POOL_3),
        convolve("features.6", 384, 3, 1, 1),
        Step::Tap,
        convolve("features.8", 256, 3, 1, 1),
        Step::Tap,
        convolve("features.10", 256, 3, 1, 1),
        Step::Tap,
    ]
}

/// VGG16, tapped before each halving and at the end: 64, 128, 256, 512 and 512 channels.
pub fn vgg16(pooling: Pooling) -> Steps {
    const STAGES: [(usize, &[usize]); 5] =
        [(64, &[0, 2]), (128, &[5, 7]), (256, &[10, 12, 14]), (512, &[17, 19, 21]), (512, &[24, 26, 28])];
    let mut steps = Vec::new();
    for (channels, places) in STAGES {
        if !steps.is_empty() {
            steps.push(match pooling {
                Pooling::Max => Step::MaxPool(POOL_2),
                Pooling::L2 => Step::L2Pool,
            });
        }
        steps.extend(places.iter().map(|place| convolve(format!("features.{place}"), channels, 3, 1, 1)));
        steps.push(Step::Tap);
    }
    steps
}

/// SqueezeNet 1.1, tapped seven times: 64, 128, 256, 384, 384, 512 and 512 channels.
pub fn squeezenet() -> Steps {
    let halve = || Step::MaxPool(MaxPool { ceil_mode: true, ..POOL_3 });
    let fire = |place: usize, narrow: usize, wide: usize| {
        let name = |leaf: &str| format!("features.{place}.{leaf}");
        let expand = [convolve(name("expand1x1"), wide, 1, 1, 0), convolve(name("expand3x3"), wide, 3, 1, 1)]
            .map(|step| vec![step]);
        [convolve(name("squeeze"), narrow, 1, 1, 0), Step::Concatenate(expand.into())]
    };
    let mut steps = vec![convolve("features.0", 64, 3, 2, 0), Step::Tap, halve()];
    steps.extend(fire(3, 16, 64).into_iter().chain(fire(4, 16, 64)));
    steps.extend([Step::Tap, halve()]);
    steps.extend(fire(6, 32, 128).into_iter().chain(fire(7, 32, 128)));
    steps.extend([Step::Tap, halve()]);
    for (place, narrow, wide) in [(9, 48, 192), (10, 48, 192), (11, 64, 256), (12, 64, 256)] {
        steps.extend(fire(place, narrow, wide));
        steps.push(Step::Tap);
    }
    steps
}

/// Inception v3 up to its 2048 channels of 8x8 pixels (of pictures of 299x299), tapped at the end. The auxiliary
/// classifier and the last layer are not part of it.
pub fn inception(kind: InceptionKind) -> Steps {
    let stem =
        |name: &str, channels, side, stride, padding| basic(name.to_owned(), channels, [side; 2], stride, [padding; 2]);
    let mut steps = vec![
        stem("Conv2d_1a_3x3", 32, 3, 2, 0),
        stem("Conv2d_2a_3x3", 32, 3, 1, 0),
        stem("Conv2d_2b_3x3", 64, 3, 1, 1),
        Step::MaxPool(POOL_3),
        stem("Conv2d_3b_1x1", 80, 1, 1, 0),
        stem("Conv2d_4a_3x3", 192, 3, 1, 0),
        Step::MaxPool(POOL_3),
    ];
    let average_pool = || Step::AveragePool { count_include_pad: kind == InceptionKind::Torchvision };
    steps.extend([("Mixed_5b", 32), ("Mixed_5c", 64), ("Mixed_5d", 64)].map(|(name, pooled)| {
        let block = Block(name);
        Step::Concatenate(vec![
            vec![block.one("branch1x1", 64)],
            vec![block.one("branch5x5_1", 48), block.same("branch5x5_2", 64, [5, 5])],
            block.double(96, 1),
            vec![average_pool(), block.one("branch_pool", pooled)],
        ])
    }));
    let block = Block("Mixed_6a");
    steps.push(Step::Concatenate(vec![
        vec![block.halve("branch3x3", 384)],
        block.double(96, 2),
        vec![Step::MaxPool(POOL_3)],
    ]));
    steps.extend([("Mixed_6b", 128), ("Mixed_6c", 160), ("Mixed_6d", 160), ("Mixed_6e", 192)].map(|(name, narrow)| {
        let block = Block(name);
        Step::Concatenate(vec![
            vec![block.one("branch1x1", 192)],
            vec![
                block.one("branch7x7_1", narrow),
                block.same("branch7x7_2", narrow, [1, 7]),
                block.same("branch7x7_3", 192, [7, 1]),
            ],
            vec![
                block.one("branch7x7dbl_1", narrow),
                block.same("branch7x7dbl_2", narrow, [7, 1]),
                block.same("branch7x7dbl_3", narrow, [1, 7]),
                block.same("branch7x7dbl_4", narrow, [7, 1]),
                block.same("branch7x7dbl_5", 192, [1, 7]),
            ],
            vec![average_pool(), block.one("branch_pool", 192)],
        ])
    }));
    let block = Block("Mixed_7a");
    steps.push(Step::Concatenate(vec![
        vec![block.one("branch3x3_1", 192), block.halve("branch3x3_2", 320)],
        vec![
            block.one("branch7x7x3_1", 192),
            block.same("branch7x7x3_2", 192, [1, 7]),
            block.same("branch7x7x3_3", 192, [7, 1]),
            block.halve("branch7x7x3_4", 192),
        ],
        vec![Step::MaxPool(POOL_3)],
    ]));
    let max_pool = Step::MaxPool(MaxPool { size: 3, stride: 1, padding: 1, ceil_mode: false });
    let last = if kind == InceptionKind::Fid { max_pool } else { average_pool() };
    steps.extend([("Mixed_7b", average_pool()), ("Mixed_7c", last)].map(|(name, pool)| {
        let block = Block(name);
        let split = |first: &str, second: &str| {
            Step::Concatenate(vec![vec![block.same(first, 384, [1, 3])], vec![block.same(second, 384, [3, 1])]])
        };
        Step::Concatenate(vec![
            vec![block.one("branch1x1", 320)],
            vec![block.one("branch3x3_1", 384), split("branch3x3_2a", "branch3x3_2b")],
            vec![
                block.one("branch3x3dbl_1", 448),
                block.same("branch3x3dbl_2", 384, [3, 3]),
                split("branch3x3dbl_3a", "branch3x3dbl_3b"),
            ],
            vec![pool, block.one("branch_pool", 192)],
        ])
    }));
    steps.push(Step::Tap);
    steps
}

/// Torchvision's `BasicConv2d`.
fn basic(name: String, channels: usize, window: [usize; 2], stride: usize, padding: [usize; 2]) -> Step<Convolution> {
    Step::Convolve(Convolution { name, has_batch_norm: true, channels, window, stride, padding })
}

/// A block of Inception, by its name.
struct Block(&'static str);

impl Block {
    /// Windows of one pixel.
    fn one(&self, name: &str, channels: usize) -> Step<Convolution> {
        self.same(name, channels, [1, 1])
    }

    /// The output has the size of the input.
    fn same(&self, name: &str, channels: usize, window: [usize; 2]) -> Step<Convolution> {
        basic(format!("{}.{name}", self.0), channels, window, 1, window.map(|side| side / 2))
    }

    /// Every second window of 3x3 inside of the image.
    fn halve(&self, name: &str, channels: usize) -> Step<Convolution> {
        basic(format!("{}.{name}", self.0), channels, [3, 3], 2, [0, 0])
    }

    /// The branch of two convolutions of 3x3, the second at every `stride`-th pixel.
    fn double(&self, channels: usize, stride: usize) -> Vec<Step<Convolution>> {
        let last = match stride {
            1 => self.same("branch3x3dbl_3", channels, [3, 3]),
            _ => self.halve("branch3x3dbl_3", channels),
        };
        vec![self.one("branch3x3dbl_1", 64), self.same("branch3x3dbl_2", 96, [3, 3]), last]
    }
}
