//! A view's volume of features, whose rows are computed when a target first looks at them.

use super::encoder::Encoder;
use super::feature_image::Looking;
use super::image::{Image, Scratch, Size};
use crate::device::Device;
use std::ops::Range;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;

/// What is known of a view.
pub(super) struct Volume<D: Device> {
    /// What the last layer makes rows of.
    deep: Image<D>,
    /// `[row][column][depth][feature]`.
    pub(super) image: Image<D>,
    /// Rows that are there already.
    filled: Range<u32>,
}

impl<D: Device> Volume<D> {
    /// Encodes an image up to the last layer.
    ///
    /// # Errors
    /// If the device is lost or has no room.
    pub(super) fn encode(device: &D, encoder: &Encoder<D>, values: &[f32], size: Size) -> Result<Volume<D>, D::Error> {
        // Its own: what an encoding needs in between is not kept beside the volumes.
        let mut scratch = Scratch::new(device);
        let deep = encoder.encode(device, &mut scratch, values, size)?;
        // Rows that no target looks at are never written.
        let image = Scratch::new(device).image(encoder.volume_size(size))?;
        Ok(Volume { deep, image, filled: 0..0 })
    }

    /// How many rows it has.
    pub(super) fn row_count(&self) -> u32 {
        self.image.size.height
    }

    /// Computes rows that are not there yet. Returns how many.
    ///
    /// # Errors
    /// If the device is lost.
    pub(super) fn fill(&mut self, device: &D, encoder: &Encoder<D>, rows: Range<u32>) -> Result<u32, D::Error> {
        let filled = self.filled.clone();
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
            encoder.fill_rows(device, &self.deep, rows.clone(), &mut self.image)?;
        }
        self.filled = all;
        Ok(missing.iter().map(|rows| rows.len() as u32).sum())
    }

    /// The rows that rays of a target can reach: the projections of the corners of what they go through, and a node
    /// beyond. All of them where a corner is not in front of the view.
    pub(super) fn rows_seen(&self, view: &CameraBlock, target: &CameraBlock, looking: &Looking) -> Range<u32> {
        let (width, height) = (target.width as f32, target.height as f32);
        let mut seen = f32::MAX..-f32::MAX;
        let [near, far] = looking.near_far;
        let astray = looking.jitter * 0.5 * (far - near) / (looking.sample_count - 1) as f32;
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
        // Nodes lie at halves of the image's rows: a look-up reads one before and one behind, and one more is for rounding.
        let scale = self.row_count() as f32 / view.height as f32;
        let (first, last) = (seen.start * scale - 2.0, seen.end * scale + 3.0);
        // Saturating: what lies outside has no rows.
        (first as u32).min(self.row_count())..(last as u32).min(self.row_count())
    }
}
