//! Sets of pictures as feature vectors of the Inception network that FID is defined with.
//!
//! As pytorch-fid does it (mseitzer/pytorch-fid): a picture, levels in `[0, 1]`, is resized to 299x299 (bilinear
//! between the four nearest pixels at any size, without a blur before downscaling), stretched to `[-1, 1]`, and the
//! 2048 channels at the end are averaged over pixels. The size of a file's last layer determines which of the two
//! Inceptions it holds ([`InceptionKind`]); with torchvision's, `transform_input` is omitted, as pytorch-fid does.

use super::trunk::{InceptionKind, Trunk, inception};
use super::{MetricError, seen};
use image::RgbImage;
use viewfuse_device::Device;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError, Sizes};
use viewfuse_nn::image::HostImage;

/// Side of Inception's input, in pixels.
const SIDE: usize = 299;
/// Features of a picture.
const DIMENSION: usize = 2048;

/// A set of pictures as points: as many numbers each, all finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    dimension: usize,
    values: Vec<f64>,
}

/// Why numbers are not a set of points, or two sets cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetError {
    /// Rows of another length, or none.
    #[error("{count} numbers are no rows of {dimension}")]
    Rows {
        /// How many numbers there are.
        count: usize,
        /// The required number in a row.
        dimension: usize,
    },
    /// A number is infinite or NaN.
    #[error("number {index} of row {row} is not finite")]
    NotFinite {
        /// The picture.
        row: usize,
        /// Which of its numbers.
        index: usize,
    },
    /// Two sets of different networks.
    #[error("points of {0} and of {1} numbers cannot be compared")]
    Dimensions(usize, usize),
    /// One picture has no spread.
    #[error("sets of {0} and {1} pictures cannot be compared; each needs at least 2")]
    Few(usize, usize),
    /// The decomposition of a matrix did not converge.
    #[error("the singular values of the sets' common matrix cannot be computed")]
    NotConverged,
}

impl Features {
    /// Points `[picture][dimension]`, flat.
    ///
    /// # Errors
    /// [`SetError::Rows`], [`SetError::NotFinite`].
    pub fn new(dimension: usize, values: Vec<f64>) -> Result<Features, SetError> {
        if dimension == 0 || !values.len().is_multiple_of(dimension) {
            return Err(SetError::Rows { count: values.len(), dimension });
        }
        match values.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(SetError::NotFinite { row: at / dimension, index: at % dimension }),
            None => Ok(Features { dimension, values }),
        }
    }

    /// How many pictures.
    pub fn count(&self) -> usize {
        self.values.len() / self.dimension
    }

    /// Numbers of a picture.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The numbers of each picture.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.dimension)
    }

    /// The numbers of a picture.
    ///
    /// # Panics
    /// If there is no such picture.
    pub fn row(&self, picture: usize) -> &[f64] {
        &self.values[picture * self.dimension..][..self.dimension]
    }

    /// Whether two sets have a distance.
    ///
    /// # Errors
    /// [`SetError::Dimensions`], [`SetError::Few`].
    pub fn comparable(&self, other: &Features) -> Result<(), SetError> {
        if self.dimension != other.dimension {
            return Err(SetError::Dimensions(self.dimension, other.dimension));
        }
        match self.count().min(other.count()) {
            0 | 1 => Err(SetError::Few(self.count(), other.count())),
            _ => Ok(()),
        }
    }
}

/// Inception v3 with its parameters on a device.
pub struct Inception<D: Device> {
    kind: InceptionKind,
    trunk: Trunk<D>,
}

impl<D: Device> Inception<D> {
    /// From pytorch-fid's or torchvision's `state_dict`.
    ///
    /// # Errors
    /// [`MetricError::Checkpoint`] with the tensors that are missing or of another shape; [`MetricError::Device`].
    pub fn new(device: &D, checkpoint: &Checkpoint) -> Result<Inception<D>, MetricError> {
        let kind = kind_of(checkpoint)?;
        let optional = |name: &str| {
            name.starts_with("fc.") || name.starts_with("AuxLogits.") || name.ends_with(".num_batches_tracked")
        };
        Ok(Inception { kind, trunk: Trunk::load(device, checkpoint, &inception(kind), optional)? })
    }

    /// Which of the two it is.
    pub fn kind(&self) -> InceptionKind {
        self.kind
    }

    /// The features of pictures of any sizes; an empty set for no pictures.
    ///
    /// # Errors
    /// [`MetricError::NotFinite`]; [`MetricError::Device`].
    pub fn features<'a>(
        &self,
        device: &D,
        pictures: impl IntoIterator<Item = &'a RgbImage>,
    ) -> Result<Features, MetricError> {
        let mut values = Vec::new();
        for picture in pictures {
            let resized = resized(&seen(picture, |_, level| level / 255.0), SIDE);
            let stretched = resized.values.iter().map(|value| 2.0 * value - 1.0).collect();
            for map in self.trunk.taps(device, &HostImage { values: stretched, ..resized })? {
                let count = (map.height * map.width) as f64;
                values.extend((0..map.channels).map(|channel| map.channel(channel).sum::<f64>() / count));
            }
        }
        Ok(Features { dimension: DIMENSION, values })
    }
}

/// The number of classes of the last layer distinguishes the two.
fn kind_of(checkpoint: &Checkpoint) -> Result<InceptionKind, CheckpointError> {
    let sizes = Sizes::new(checkpoint, "Inception v3");
    match sizes.size("fc.weight", 2, 0)? {
        1008 => Ok(InceptionKind::Fid),
        1000 => Ok(InceptionKind::Torchvision),
        count => Err(sizes.refuse(format!(
            "fc.weight has {count} classes; the network of FID has 1008, torchvision's 1000, and which of them it is \
             decides how it pools"
        ))),
    }
}

/// A square image, bilinear between the four nearest pixels, with the outer edges of both aligned (PyTorch's
/// `interpolate` without `align_corners`).
fn resized(image: &HostImage, side: usize) -> HostImage {
    let along = |length: usize| -> Vec<(usize, usize, f32)> {
        let scale = length as f64 / side as f64;
        let place = |index: usize| {
            let at = ((index as f64 + 0.5) * scale - 0.5).max(0.0);
            let first = (at as usize).min(length - 1);
            (first, (first + 1).min(length - 1), (at - first as f64) as f32)
        };
        (0..side).map(place).collect()
    };
    let (rows, columns) = (along(image.height), along(image.width));
    let mut values = Vec::with_capacity(side * side * image.channels);
    for &(top, bottom, share_y) in &rows {
        for &(left, right, share_x) in &columns {
            let corners = [(top, left), (top, right), (bottom, left), (bottom, right)].map(|(y, x)| image.pixel(y, x));
            values.extend((0..image.channels).map(|channel| {
                let [a, b, c, d] = corners.map(|corner| corner[channel]);
                let (upper, lower) = (a + (b - a) * share_x, c + (d - c) * share_x);
                upper + (lower - upper) * share_y
            }));
        }
    }
    HostImage { height: side, width: side, channels: image.channels, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resizing_keeps_outer_edges() {
        let image = HostImage { height: 1, width: 2, channels: 1, values: vec![0.0, 1.0] };
        // Four pixels over two: centres at -1/4, 1/4, 3/4 and 5/4 of the distance between the two.
        let wide = resized(&image, 4);
        assert_eq!(wide.values[..4], [0.0, 0.25, 0.75, 1.0]);
        assert_eq!(wide.values[12..], wide.values[..4]);
        assert_eq!(resized(&wide, 2).values, [0.125, 0.875, 0.125, 0.875]);
    }

    #[test]
    fn rows_are_whole_and_finite() {
        assert_eq!(Features::new(3, vec![0.0; 4]), Err(SetError::Rows { count: 4, dimension: 3 }));
        assert_eq!(Features::new(0, Vec::new()), Err(SetError::Rows { count: 0, dimension: 0 }));
        let values = vec![0.0, 1.0, 2.0, f64::NAN];
        assert_eq!(Features::new(2, values), Err(SetError::NotFinite { row: 1, index: 1 }));
    }
}
