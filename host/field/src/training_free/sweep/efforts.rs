//! Efforts of the plane sweep: views compared at a smaller size, fewer planes, fewer neighbours of a source.

use super::Sweep;
use super::sources::SourceMaps;
use super::views::{Matched, Views};
use crate::{Effort, Efforts, Encodings, FieldError};
use viewfuse_device::Device;
use viewfuse_scene::photographs::{SourceImage, longest_side};

/// Most planes of a frustum in pictures that are only compared with one another.
const TRIAL_PLANES: u32 = 32;

/// Shares of the side at which views are compared and of the planes, and the neighbours of each source, with the error
/// and the work that are typical of them (`host/results/front_to_back.md`, "Efforts").
const EFFORTS: [(f32, f32, usize, f32, f32); 4] =
    [(0.25, 0.5, 2, 0.055, 0.1), (0.5, 1.0, 1, 0.035, 0.22), (0.75, 1.0, 1, 0.027, 0.4), (1.0, 1.0, 1, 0.024, 0.8)];

/// Most planes, and the longest side at which views are compared, in pictures for a moving camera.
const PREVIEW: (u32, u32) = (32, 80);

impl Sweep {
    /// Cheaper settings, for a moving camera.
    pub(in crate::training_free) fn cheaper(self) -> Sweep {
        let (planes, side) = PREVIEW;
        Sweep { plane_count: self.plane_count.min(planes), match_side: self.match_side.min(side), ..self }
    }
}

impl<D: Device> Views<'_, D> {
    /// The settings with shares of the side at which the sources are compared and of the planes, and with at most so
    /// many neighbours.
    fn at(&self, share: f32, planes: f32, neighbours: usize) -> Sweep {
        let side = self.scene.small.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let reduced = (share * side as f32).round().max(1.0) as u32;
        // The whole side is the settings' own: targets may be larger than the sources.
        let match_side = if share < 1.0 { reduced } else { self.scene.defaults.match_side };
        let plane_count = (self.scene.defaults.plane_count as f32 * planes).round() as u32;
        Sweep { plane_count, match_side, neighbours: neighbours.min(self.scene.defaults.neighbours), ..self.settings }
    }
}

impl<D: Device> Efforts for Views<'_, D> {
    fn list(&self) -> Vec<Effort> {
        let named = |(share, planes, neighbours, error, work): (f32, f32, usize, f32, f32)| {
            let Sweep { plane_count, match_side, neighbours, .. } = self.at(share, planes, neighbours);
            let name =
                format!("matching at {match_side} pixels, {plane_count} planes, {neighbours} neighbours a source");
            Effort::new(name, error, work)
        };
        EFFORTS.into_iter().map(named).chain([Effort::exact()]).collect()
    }

    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError> {
        let settings = match EFFORTS.get(effort) {
            Some((share, planes, neighbours, ..)) => self.at(*share, *planes, *neighbours),
            None => self.at(1.0, 1.0, self.scene.defaults.neighbours),
        };
        if settings == self.settings {
            return Ok(Encodings::Kept);
        }
        self.settings = settings;
        let images = self.scene.small.iter().map(|image| image.reduced(settings.match_side));
        let images: Vec<SourceImage> = images.collect::<Result<_, _>>().map_err(FieldError::unsuitable)?;
        let device = self.scene.device;
        let relevance = std::mem::take(&mut self.maps.relevance);
        self.target = None;
        self.matched = Matched::upload(device, &images)?;
        self.maps = SourceMaps::new(device, &self.matched, relevance)?;
        Ok(Encodings::Dropped)
    }

    fn set_trial(&mut self) {
        self.settings.plane_count = self.settings.plane_count.min(TRIAL_PLANES);
    }
}
