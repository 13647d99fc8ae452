//! Metrics of pictures: directly from pixels, and with the features of published networks.
//!
//! ```text
//! similarity       SSIM with a Gaussian window
//! trunk            the networks' layers, on any device
//! heads            the few weights that were fitted to human judgement
//! lpips, dists     distance of two pictures
//! features         a set of pictures as Inception's features
//! frechet, kernel  distance of two sets: FID, KID
//! convention       how published tables compute their scores
//! masked           PSNR and SSIM of the object alone
//! interval         means over scenes with confidence intervals
//! ```
//!
//! PSNR and SSIM with a uniform window are in [`viewfuse_core::metrics`]. The networks' weights are not part of this
//! project: the user supplies the `state_dict`s that torchvision and pytorch-fid publish. [`Metrics`] is the interface
//! that the commands use.

pub mod convention;
pub mod dists;
pub mod features;
#[cfg(feature = "fid")]
pub mod frechet;
pub mod heads;
pub mod interval;
#[cfg(feature = "fid")]
pub mod kernel;
pub mod lpips;
pub mod masked;
pub mod similarity;
pub mod trunk;

use convention::Convention;
use dists::Dists;
use features::{Features, Inception};
use image::{GrayImage, RgbImage};
use lpips::Lpips;
use viewfuse_device::{Device, DeviceError};
use viewfuse_field::finite::NotFinite;
use viewfuse_field::scores::{corrected_psnr_of_seen, psnr_of_seen, shows_anything, ssim_of_seen, with_truth_unseen};
use viewfuse_nn::checkpoint::CheckpointError;
use viewfuse_nn::image::HostImage;

/// Why pictures could not be scored.
#[derive(Debug, thiserror::Error)]
pub enum MetricError {
    /// A network's parameters cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A picture is too small for a network.
    #[error("a picture of {width}x{height} is too small for a metric's network")]
    Small {
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
    },
    /// Two pictures to compare have different sizes.
    #[error("a picture of {}x{} cannot be compared with one of \
        {}x{}", prediction[0], prediction[1], truth[0], truth[1])]
    Sizes {
        /// Width and height of the prediction.
        prediction: [u32; 2],
        /// Width and height of the truth.
        truth: [u32; 2],
    },
    /// A network produced a value that is NaN or infinite.
    #[error(transparent)]
    NotFinite(#[from] NotFinite),
    /// The device failed.
    #[error("the device failed")]
    Device(#[from] DeviceError),
}

/// A score of a picture, by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Scored {
    /// `psnr`, `ssim`, `psnr-corrected`, `lpips-alex`, `lpips-vgg`, `lpips-squeeze` or `dists`.
    pub name: &'static str,
    /// PSNR in decibels, infinite for equal pictures; the others have no unit.
    pub value: f64,
    /// Whether more is better.
    pub more_is_better: bool,
}

/// The requested metrics, their networks on a device.
pub struct Metrics<'a, D: Device> {
    /// The device.
    pub device: &'a D,
    /// The convention of the scores.
    pub convention: Convention,
    /// LPIPS by any number of trunks.
    pub lpips: Vec<Lpips<D>>,
    /// DISTS.
    pub dists: Option<Dists<D>>,
    /// The network of FID and KID.
    pub inception: Option<Inception<D>>,
}

/// Scores pictures, on any device.
pub trait Scorer {
    /// Scores a prediction: PSNR, SSIM if the pictures are at least 7x7, PSNR of corrected colours, and the metrics of
    /// the loaded networks, in the order of [`Scored::name`]'s list.
    ///
    /// `seen` is 0 where the photograph shows nothing; without it all pixels are scored, and of no pixels there are no
    /// scores. PSNR and SSIM leave unseen pixels out ([`viewfuse_field::scores`]); networks see the truth's pixels there
    /// in both pictures.
    ///
    /// # Errors
    /// [`MetricError`].
    fn score(
        &self,
        prediction: &RgbImage,
        truth: &RgbImage,
        seen: Option<&GrayImage>,
    ) -> Result<Vec<Scored>, MetricError>;
}

impl<D: Device> Scorer for Metrics<'_, D> {
    fn score(
        &self,
        prediction: &RgbImage,
        truth: &RgbImage,
        seen: Option<&GrayImage>,
    ) -> Result<Vec<Scored>, MetricError> {
        same_size(prediction, truth)?;
        seen.map_or(Ok(()), |seen| equal(seen.dimensions(), truth.dimensions()))?;
        let (shown, shown_truth) = (self.convention.shown(prediction), self.convention.shown(truth));
        let mut scores = Vec::new();
        if !shows_anything(seen) {
            return Ok(scores);
        }
        let value = psnr_of_seen(&shown, &shown_truth, seen);
        scores.push(Scored { name: "psnr", value, more_is_better: true });
        if let Some(value) = ssim_of_seen(&shown, &shown_truth, seen) {
            scores.push(Scored { name: "ssim", value, more_is_better: true });
        }
        let value = corrected_psnr_of_seen(&shown, &shown_truth, seen);
        scores.push(Scored { name: crate::PSNR_CORRECTED, value, more_is_better: true });
        let shown = with_truth_unseen(&shown, truth, seen);
        // Networks see the prediction as it was saved and the photograph as it is.
        for lpips in &self.lpips {
            let value = lpips.distance(self.device, &shown, truth)?;
            scores.push(Scored { name: lpips.kind().metric(), value, more_is_better: false });
        }
        if let Some(dists) = &self.dists {
            let value = dists.distance(self.device, &shown, truth)?;
            scores.push(Scored { name: "dists", value, more_is_better: false });
        }
        Ok(scores)
    }
}

impl<'a, D: Device> Metrics<'a, D> {
    /// PSNR and SSIM of the pictures as they are.
    pub fn plain(device: &'a D) -> Metrics<'a, D> {
        Metrics { device, convention: Convention::Plain, lpips: Vec::new(), dists: None, inception: None }
    }

    /// Inception's features of photographs, or of predictions as [`Convention::shown`] has them; `None` without that
    /// network.
    ///
    /// # Errors
    /// [`MetricError`].
    pub fn features<'p>(
        &self,
        pictures: impl IntoIterator<Item = &'p RgbImage>,
    ) -> Result<Option<Features>, MetricError> {
        self.inception.as_ref().map(|inception| inception.features(self.device, pictures)).transpose()
    }
}

/// Only pictures of one size can be compared.
fn same_size(prediction: &RgbImage, truth: &RgbImage) -> Result<(), MetricError> {
    equal(prediction.dimensions(), truth.dimensions())
}

fn equal(prediction: (u32, u32), truth: (u32, u32)) -> Result<(), MetricError> {
    match prediction == truth {
        true => Ok(()),
        false => Err(MetricError::Sizes { prediction: prediction.into(), truth: truth.into() }),
    }
}

/// A picture as a network takes it: each channel's 8-bit level by its function.
fn seen(picture: &RgbImage, value: impl Fn(usize, f32) -> f32) -> HostImage {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let values = picture.as_raw().iter().enumerate().map(|(at, level)| value(at % 3, f32::from(*level))).collect();
    HostImage { height, width, channels: 3, values }
}
