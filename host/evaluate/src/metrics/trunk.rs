//! Trunks: the published image networks whose features metrics compare, as trees of steps.
//!
//! A trunk is data ([`Step`]): which layers follow one another, which are concatenated, and where the metric taps it.
//! The same tree lists the tensors that a `state_dict` must have, is read from a checkpoint, and runs on any device
//! ([`Trunk`]).

mod architectures;
mod run;

pub use architectures::{InceptionKind, Pooling, alexnet, inception, squeezenet, vgg16};
pub use run::Trunk;

use viewfuse_nn::checkpoint::TensorShape;
use viewfuse_nn::pool::MaxPool;

/// A convolution with bias, followed by a ReLU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// Its name in a `state_dict`.
    pub name: String,
    /// Whether it is torchvision's `BasicConv2d`: `conv.weight` and a batch norm `bn` in place of `weight` and `bias`.
    pub has_batch_norm: bool,
    /// Output channels.
    pub channels: usize,
    /// Rows and columns of the window.
    pub window: [usize; 2],
    /// Pixels from one window to the next.
    pub stride: usize,
    /// Zeros above and below the image, and left and right of it.
    pub padding: [usize; 2],
}

impl Convolution {
    /// A square window.
    pub fn square(name: impl Into<String>, channels: usize, side: usize, stride: usize, padding: usize) -> Convolution {
        Convolution {
            name: name.into(),
            has_batch_norm: false,
            channels,
            window: [side; 2],
            stride,
            padding: [padding; 2],
        }
    }

    /// Its tensors, for an input of this many channels.
    fn tensors(&self, in_channels: usize) -> Vec<TensorShape> {
        let [rows, columns] = self.window;
        let kernel = vec![self.channels, in_channels, rows, columns];
        let tensor = |leaf: &str, shape| TensorShape { name: format!("{}.{leaf}", self.name), shape };
        if !self.has_batch_norm {
            return vec![tensor("weight", kernel), tensor("bias", vec![self.channels])];
        }
        let norms = ["bn.weight", "bn.bias", "bn.running_mean", "bn.running_var"];
        let norms = norms.map(|leaf| tensor(leaf, vec![self.channels]));
        [tensor("conv.weight", kernel)].into_iter().chain(norms).collect()
    }
}

/// A step of a trunk. `C` is a convolution, or one with its parameters on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step<C> {
    /// A convolution.
    Convolve(C),
    /// A max pool.
    MaxPool(MaxPool),
    /// The mean of every window of 3x3 around a pixel.
    AveragePool {
        /// Whether zeros outside of the image count (PyTorch's `count_include_pad`).
        count_include_pad: bool,
    },
    /// DISTS' L2 pool: the square root of the squares, blurred with `[1, 2, 1] / 4` in both directions, at every second
    /// pixel.
    L2Pool,
    /// Branches on the same image, their outputs concatenated by channels.
    Concatenate(Vec<Vec<Step<C>>>),
    /// A tap: the metric uses the image at this step.
    Tap,
}

/// Every tensor of the steps, in the order of the data, and the number of output channels.
pub fn tensors(steps: &[Step<Convolution>], in_channels: usize) -> (Vec<TensorShape>, usize) {
    let (mut all, mut channels) = (Vec::new(), in_channels);
    for step in steps {
        match step {
            Step::Convolve(convolution) => {
                all.extend(convolution.tensors(channels));
                channels = convolution.channels;
            }
            Step::Concatenate(branches) => {
                let branches = branches.iter().map(|branch| tensors(branch, channels));
                let (shapes, counts): (Vec<_>, Vec<_>) = branches.unzip();
                all.extend(shapes.into_iter().flatten());
                channels = counts.iter().sum();
            }
            Step::MaxPool(_) | Step::AveragePool { .. } | Step::L2Pool | Step::Tap => {}
        }
    }
    (all, channels)
}
