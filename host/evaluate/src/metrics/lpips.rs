//! LPIPS: the distance of two pictures in a network's features.
//!
//! At each tap of the trunk, every pixel's channels are scaled to length 1; the squares of the differences, weighted by
//! the head, are added up over channels and averaged over pixels; the taps are added up. Version 0.1 of the published
//! code (Zhang, Isola, Efros, Shechtman, Wang: "The unreasonable effectiveness of deep features as a perceptual
//! metric", CVPR 2018; richzhang/PerceptualSimilarity), not its spatial variant. The trunk computes in `f32`, the rest
//! is `f64`.

use super::trunk::{Convolution, Pooling, Step, Trunk, alexnet, squeezenet, vgg16};
use super::{MetricError, same_size, seen};
use image::RgbImage;
use viewfuse_device::Device;
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse_nn::image::HostImage;

/// Shift and divisor of pictures with levels in `[-1, 1]`.
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Added to lengths.
const FLOOR: f64 = 1.0e-10;

/// The network whose features LPIPS compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LpipsTrunk {
    /// AlexNet, the published default for scores.
    Alex,
    /// VGG16.
    Vgg,
    /// SqueezeNet 1.1.
    Squeeze,
}

viewfuse_job::named! {
    pub LpipsTrunk: "a network of LPIPS" {
        Alex => "alex",
        Vgg => "vgg",
        Squeeze => "squeeze",
    }
}

impl LpipsTrunk {
    /// Name of the score.
    pub fn metric(self) -> &'static str {
        match self {
            LpipsTrunk::Alex => "lpips-alex",
            LpipsTrunk::Vgg => "lpips-vgg",
            LpipsTrunk::Squeeze => "lpips-squeeze",
        }
    }

    /// Its layers.
    pub fn steps(self) -> Vec<Step<Convolution>> {
        match self {
            LpipsTrunk::Alex => alexnet(),
            LpipsTrunk::Vgg => vgg16(Pooling::Max),
            LpipsTrunk::Squeeze => squeezenet(),
        }
    }

    /// Channels at each tap.
    fn channels(self) -> &'static [usize] {
        match self {
            LpipsTrunk::Alex => &[64, 192, 384, 256, 256],
            LpipsTrunk::Vgg => &[64, 128, 256, 512, 512],
            LpipsTrunk::Squeeze => &[64, 128, 256, 384, 384, 512, 512],
        }
    }
}

/// LPIPS with its parameters on a device.
pub struct Lpips<D: Device> {
    kind: LpipsTrunk,
    trunk: Trunk<D>,
    /// `[tap][channel]`.
    heads: Vec<Vec<f32>>,
}

impl<D: Device> Lpips<D> {
    /// From torchvision's `state_dict` of the network, and heads: [`super::heads::published_lpips`], or a file with
    /// `lin0.model.1.weight` and so on.
    ///
    /// # Errors
    /// [`MetricError::Checkpoint`] with the tensors that are missing or of another shape; [`MetricError::Device`].
    pub fn new(device: &D, kind: LpipsTrunk, trunk: &Checkpoint, heads: &Checkpoint) -> Result<Lpips<D>, MetricError> {
        let shape = |(tap, channels): (usize, &usize)| TensorShape {
            name: format!("lin{tap}.model.1.weight"),
            shape: vec![1, *channels, 1, 1],
        };
        let expected: Vec<TensorShape> = kind.channels().iter().enumerate().map(shape).collect();
        // A saved LPIPS module contains the trunk, and the heads twice.
        heads.check(&expected, |name| {
            ["lins.", "net.", "scaling_layer."].iter().any(|prefix| name.starts_with(prefix))
        })?;
        let heads = expected.iter().map(|tensor| heads.tensor(&tensor.name)).collect::<Result<_, _>>()?;
        let trunk = Trunk::load(device, trunk, &kind.steps(), |name| name.starts_with("classifier."))?;
        Ok(Lpips { kind, trunk, heads })
    }

    /// The network.
    pub fn kind(&self) -> LpipsTrunk {
        self.kind
    }

    /// The distance: 0 for equal pictures, symmetric, about 1 for unrelated pictures.
    ///
    /// # Errors
    /// [`MetricError`] if the sizes differ or are too small for the network, or if the device fails.
    pub fn distance(&self, device: &D, prediction: &RgbImage, truth: &RgbImage) -> Result<f64, MetricError> {
        same_size(prediction, truth)?;
        let taps = |picture| {
            let scaled = |channel: usize, level: f32| (level / 127.5 - 1.0 - SHIFT[channel]) / SCALE[channel];
            self.trunk.taps(device, &seen(picture, scaled))
        };
        let (prediction, truth) = (taps(prediction)?, taps(truth)?);
        Ok(prediction.iter().zip(&truth).zip(&self.heads).map(|((p, t), head)| tap_distance(p, t, head)).sum())
    }
}

/// The contribution of one tap.
fn tap_distance(prediction: &HostImage, truth: &HostImage, head: &[f32]) -> f64 {
    let length = |pixel: &[f32]| pixel.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt() + FLOOR;
    let distance = |(prediction, truth): (&[f32], &[f32])| -> f64 {
        let (prediction_length, truth_length) = (length(prediction), length(truth));
        let channels = prediction.iter().zip(truth).zip(head);
        channels
            .map(|((p, t), weight)| {
                f64::from(*weight) * (f64::from(*p) / prediction_length - f64::from(*t) / truth_length).powi(2)
            })
            .sum()
    };
    prediction.pixels().zip(truth.pixels()).map(distance).sum::<f64>() / (truth.height * truth.width) as f64
}
