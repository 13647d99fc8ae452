//! A view's volume of features. Its rows are computed when a target's rays first reach them, or all at once and then
//! kept in half precision (f16).

use super::encoder::Encoder;
use super::ray_sampling::RaySampling;
use std::ops::Range;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::half_precision::{fetch_f16, word_count};
use viewfuse_core::rays::RayPoint;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_kernels::genvs::VolumeBlock;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::scratch::Scratch;

/// A view's encoding.
pub(super) struct Volume<D: Device> {
    /// Rows, columns, and a pixel's `[depth][feature]`.
    pub(super) size: Size,
    nodes: Nodes<D>,
    /// Computed rows.
    filled: Range<u32>,
}

/// Features `[row][column][depth][feature]`.
enum Nodes<D: Device> {
    /// In `f32`.
    Whole {
        /// The last layer's input.
        deep: Image<D>,
        image: Image<D>,
    },
    /// All of them in half precision (f16), two in a word.
    F16(D::Buffer<u32>),
}

impl<D: Device> Volume<D> {
    /// Encodes an image up to the last layer.
    pub(super) fn encode(
        device: &D,
        encoder: &Encoder<D>,
        values: &[f32],
        size: Size,
    ) -> Result<Volume<D>, DeviceError> {
        // Its own scratch buffers, which are not kept beside the volumes.
        let mut scratch = Scratch::new(device);
        let deep = encoder.encode(&mut scratch, values, size)?;
        let size = encoder.volume_size(size);
        // Rows that no target's rays reach are never written.
        let image = Image::zeros(device, size)?;
        Ok(Volume { size, nodes: Nodes::Whole { deep, image }, filled: 0..0 })
    }

    /// The number of rows.
    pub(super) fn row_count(&self) -> u32 {
        self.size.height
    }

    /// The number of features of all its nodes.
    fn number_count(&self) -> u32 {
        self.size.pixel_count() * self.size.channels
    }

    /// Bytes that its features take.
    pub(super) fn byte_count(&self) -> u64 {
        let numbers = self.number_count();
        u64::from(if matches!(self.nodes, Nodes::F16(_)) { word_count(numbers) } else { numbers }) * 4
    }

    /// Computes missing rows. Returns how many.
    pub(super) fn fill(&mut self, device: &D, encoder: &Encoder<D>, rows: Range<u32>) -> Result<u32, DeviceError> {
        let filled = self.filled.clone();
        let Nodes::Whole { deep, image } = &mut self.nodes else { return Ok(0) };
        if rows.is_empty() {
            return Ok(0);
        }
        let all = match filled.is_empty() {
            true => rows,
            false => filled.start.min(rows.start)..filled.end.max(rows.end),
        };
        let missing = match filled.is_empty() {
            true => [all.clone(), 0..0],
            false => [all.start..filled.start, filled.end..all.end],
        };
        for rows in missing.iter().filter(|rows| !rows.is_empty()) {
            encoder.fill_rows(device, deep, rows.clone(), image)?;
        }
        self.filled = all;
        Ok(missing.iter().map(|rows| rows.len() as u32).sum())
    }

    /// The computed rows, in an image; `None` once they are packed.
    pub(super) fn image(&self) -> Option<&Image<D>> {
        match &self.nodes {
            Nodes::Whole { image, .. } => Some(image),
            Nodes::F16(_) => None,
        }
    }

    /// Packs the volume, all of whose rows are computed, into half precision (f16), and drops the last layer's input.
    pub(super) fn pack(&mut self, device: &D) -> Result<(), DeviceError> {
        let Nodes::Whole { image, .. } = &self.nodes else { return Ok(()) };
        let number_count = self.number_count();
        let mut words = device.zeros(word_count(number_count) as usize)?;
        device.pack_f16(&number_count, &image.values, &mut words)?;
        self.nodes = Nodes::F16(words);
        Ok(())
    }

    /// Interpolates every feature at points, by [`VolumeBlock`].
    pub(super) fn gather(
        &self,
        device: &D,
        block: &VolumeBlock,
        views: &D::Buffer<CameraBlock>,
        points: &D::Buffer<RayPoint>,
        gathered: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        match &self.nodes {
            Nodes::Whole { image, .. } => device.gather_volume(block, views, points, &image.values, gathered),
            Nodes::F16(words) => device.gather_volume_f16(block, views, points, words, gathered),
        }
    }

    /// Its features as `f32`.
    pub(super) fn values(&self, device: &D) -> Result<Vec<f32>, DeviceError> {
        match &self.nodes {
            Nodes::Whole { image, .. } => device.download(&image.values),
            Nodes::F16(words) => {
                let words = device.download(words)?;
                let number_count = self.number_count();
                Ok((0..number_count as usize).map(|index| fetch_f16(&words[..], index)).collect())
            }
        }
    }

    /// The rows that rays of a target can reach: the projections of the corners of the target's frustum, and one node
    /// beyond. All rows if a corner is not in front of the view.
    pub(super) fn rows_seen(&self, view: &CameraBlock, target: &CameraBlock, ray_sampling: &RaySampling) -> Range<u32> {
        let (width, height) = (target.width as f32, target.height as f32);
        let mut seen = f32::MAX..-f32::MAX;
        let [near, far] = ray_sampling.near_far;
        let astray = ray_sampling.jitter * 0.5 * (far - near) / (ray_sampling.sample_count - 1) as f32;
        for depth in [near - astray, far + astray] {
            for (x, y) in [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)] {
                let point: Vec3 = target.centre_world() + target.towards(x, y) * depth;
                let at = view.project(point);
                if !at.in_front {
                    return 0..self.row_count();
                }
                seen = seen.start.min(at.y)..seen.end.max(at.y);
            }
        }
        // Nodes lie at halves of the image's rows: a look-up reads one before and one behind, and one more is for
        // rounding.
        let scale = self.row_count() as f32 / view.height as f32;
        let (first, last) = (seen.start * scale - 2.0, seen.end * scale + 3.0);
        // Saturating: outside there are no rows.
        (first as u32).min(self.row_count())..(last as u32).min(self.row_count())
    }
}
