//! DISTS: the distance of two pictures in structure and texture.
//!
//! At the picture itself and at each tap of VGG16 (with L2 pools in place of max pools), every channel is compared
//! by its means, `(2 m n + c) / (m^2 + n^2 + c)`, and by its covariance, `(2 cov + c) / (var + var + c)`, `c = 1e-6`.
//! The distance is the sum of 1 minus each, weighted by the published `alpha` and `beta` divided by their sum (Ding,
//! Ma, Wang, Simoncelli: "Image quality assessment: unifying structure and texture similarity", TPAMI 2022;
//! dingkeyan93/DISTS). The trunk computes in `f32`, the rest is `f64`, so that equal pictures have a distance of
//! exactly 0.
//!
//! Pictures are compared at their own size; the published script first reduces pictures whose shorter side is above 256
//! to that, which is left to the caller.

use super::trunk::{Pooling, Trunk, vgg16};
use super::{MetricError, same_size, seen};
use image::RgbImage;
use viewfuse_device::Device;
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse_nn::image::HostImage;

/// ImageNet's means and deviations, of levels in `[0, 1]`.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];
/// Channels of the picture and of all taps.
const CHANNELS: usize = 3 + 64 + 128 + 256 + 512 + 512;
/// Added to numerators and denominators, to keep the quotients finite.
const FLOOR: f64 = 1.0e-6;

/// DISTS with its parameters on a device.
pub struct Dists<D: Device> {
    trunk: Trunk<D>,
    /// Of the means, `[channel]` through the picture and all taps; with the next they sum to 1.
    alpha: Vec<f64>,
    /// Of the covariances.
    beta: Vec<f64>,
}

impl<D: Device> Dists<D> {
    /// From torchvision's `state_dict` of VGG16, and weights: [`super::heads::published_dists`], or a file with `alpha`
    /// and `beta`.
    ///
    /// # Errors
    /// [`MetricError::Checkpoint`] with the tensors that are missing or of another shape; [`MetricError::Device`].
    pub fn new(device: &D, trunk: &Checkpoint, weights: &Checkpoint) -> Result<Dists<D>, MetricError> {
        let expected =
            ["alpha", "beta"].map(|name| TensorShape { name: name.to_owned(), shape: vec![1, CHANNELS, 1, 1] });
        weights.check(&expected, |_| false)?;
        let read = |name: &str| -> Result<Vec<f64>, MetricError> {
            Ok(weights.tensor(name)?.into_iter().map(f64::from).collect())
        };
        let (mut alpha, mut beta) = (read("alpha")?, read("beta")?);
        let sum: f64 = alpha.iter().chain(&beta).sum();
        alpha.iter_mut().chain(&mut beta).for_each(|weight| *weight /= sum);
        let steps = vgg16(Pooling::L2);
        let trunk = Trunk::load(device, trunk, &steps, |name| name.starts_with("classifier."))?;
        Ok(Dists { trunk, alpha, beta })
    }

    /// The distance: 0 for equal pictures, symmetric, rarely above 1.
    ///
    /// # Errors
    /// [`MetricError`] if the sizes differ, or if the device fails.
    pub fn distance(&self, device: &D, prediction: &RgbImage, truth: &RgbImage) -> Result<f64, MetricError> {
        same_size(prediction, truth)?;
        let maps = |picture| -> Result<Vec<HostImage>, MetricError> {
            let plain = seen(picture, |_, level| level / 255.0);
            let scaled = |channel: usize, level: f32| (level / 255.0 - MEAN[channel]) / DEVIATION[channel];
            let mut maps = vec![plain];
            maps.extend(self.trunk.taps(device, &seen(picture, scaled))?);
            Ok(maps)
        };
        let (prediction, truth) = (maps(prediction)?, maps(truth)?);
        let lacking = prediction.iter().zip(&truth).flat_map(|(prediction, truth)| channels_lacking(prediction, truth));
        let weights = self.alpha.iter().zip(&self.beta);
        Ok(lacking.zip(weights).map(|([mean, structure], (alpha, beta))| alpha * mean + beta * structure).sum())
    }
}

/// 1 minus each channel's similarity of means, and of structure.
fn channels_lacking(prediction: &HostImage, truth: &HostImage) -> Vec<[f64; 2]> {
    let count = (truth.height * truth.width) as f64;
    let lacking = |channel: usize| {
        let mean = |map: &HostImage| map.channel(channel).sum::<f64>() / count;
        let (m, n) = (mean(prediction), mean(truth));
        let (mut variances, mut covariance) = (0.0, 0.0);
        for (p, t) in prediction.channel(channel).zip(truth.channel(channel)) {
            let (p, t) = (p - m, t - n);
            variances += p * p + t * t;
            covariance += p * t;
        }
        let means = (2.0 * m * n + FLOOR) / (m * m + n * n + FLOOR);
        let structure = (2.0 * covariance / count + FLOOR) / (variances / count + FLOOR);
        [1.0 - means, 1.0 - structure]
    };
    (0..truth.channels).map(lacking).collect()
}
