//! Efforts of the plane sweep: views compared at a smaller size, fewer planes, fewer neighbours of a source.

use super::Sweep;
use super::sources::SourceMaps;
use super::views::{Matched, Views};
use crate::{FieldError, Options, Purpose, Setting, Variant};
use viewfuse_device::Device;
use viewfuse_scene::photographs::SourceImage;

/// Shares of the side at which views are compared and of the planes, and the neighbours of each source, with the error
/// and the work that are typical of them (`host/results/efforts.md`).
const EFFORTS: [(f32, f32, usize, f32, f32); 4] =
    [(0.25, 0.5, 2, 0.055, 0.1), (0.5, 1.0, 1, 0.035, 0.22), (0.75, 1.0, 1, 0.027, 0.4), (1.0, 1.0, 1, 0.024, 0.8)];

/// Most planes, and the longest side at which views are compared, in pictures for a moving camera...
const PREVIEW: (u32, u32) = (32, 80);
/// ... and in pictures that are only compared with one another.
const TRIAL: (u32, u32) = (32, u32::MAX);

impl Sweep {
    /// The efforts for sources of this longest side, the exact one last.
    pub(in crate::training_free) fn efforts(&self, source_side: u32) -> Vec<Variant<Sweep>> {
        let side = source_side.min(self.match_side) as f32;
        let reduced = EFFORTS.map(|(share, planes, neighbours, error, work)| {
            // The whole side is the settings' own: targets may be larger than the sources.
            let match_side = if share < 1.0 { (share * side).round().max(1.0) as u32 } else { self.match_side };
            let plane_count = (self.plane_count as f32 * planes).round() as u32;
            let neighbours = neighbours.min(self.neighbours);
            let label =
                format!("matching at {match_side} pixels, {plane_count} planes, {neighbours} neighbours a source");
            Variant::new(label, Sweep { plane_count, match_side, neighbours, ..*self }, error, work)
        });
        reduced.into_iter().chain([Variant::exact(*self)]).collect()
    }

    /// With less resolution.
    pub(in crate::training_free) fn reduced(self, purpose: Purpose) -> Sweep {
        let (planes, side) = if purpose == Purpose::Preview { PREVIEW } else { TRIAL };
        Sweep { plane_count: self.plane_count.min(planes), match_side: self.match_side.min(side), ..self }
    }
}

impl Options for Sweep {
    /// Where both find the same disparities of the sources, each from the costs of its own planes.
    fn encodes_alike(&self, other: &Sweep) -> bool {
        self.finds_of() == other.finds_of() && self.near_cost == other.near_cost
    }

    fn settings(&self) -> Vec<Setting> {
        self.stated(&[])
    }
}

impl Sweep {
    /// What the size of what is found of the sources depends on.
    fn finds_of(&self) -> (u32, u32, usize) {
        (self.plane_count, self.match_side, self.neighbours)
    }
}

impl<D: Device> Views<'_, D> {
    /// Goes on with other settings. What is found of the sources is dropped where it has another size.
    pub(super) fn go_on_with(&mut self, settings: Sweep) -> Result<(), FieldError> {
        let before = std::mem::replace(&mut self.settings, settings);
        if before.consistency_share != settings.consistency_share {
            self.targets = [None, None];
        }
        if before.finds_of() == settings.finds_of() {
            return Ok(());
        }
        let (device, relevance) = (self.scene.device, std::mem::take(&mut self.maps.relevance));
        self.targets = [None, None];
        if before.match_side != settings.match_side {
            let images = self.scene.small.iter().map(|image| image.reduced(settings.match_side));
            let images: Vec<SourceImage> = images.collect::<Result<_, _>>().map_err(FieldError::unsuitable)?;
            self.matched = Matched::upload(device, &images)?;
        }
        self.maps = SourceMaps::new(device, &self.matched, relevance)?;
        Ok(())
    }
}
