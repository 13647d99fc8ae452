//! The training-free field, for any scene and on any device.
//!
//! ```text
//! hull     sources that show a silhouette: a solid carved by them and by photo-consistency
//! sweep    any sources: planes through the frusta of sources and target
//! space    near and far bounds, for the planes
//! exposure gains that equalise the sources' exposure
//! presets  settings to compare
//! ```

mod exposure;
pub mod hull;
mod presets;
mod space;
mod sweep;

use super::row::{Origin, Row};
use super::{About, AnyField, Field, FieldError, Prepared, SourceSide};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

pub use hull::NoObject;
pub use sweep::Sweep;

/// Depths from the consensus of the photographs, colour by weighted fusion with visibility. Nothing is learned.
#[derive(Clone, Copy, Debug)]
pub struct TrainingFree {
    /// Settings for sources with silhouettes.
    pub hull: hull::Hull,
    /// Settings for other sources.
    pub sweep: Sweep,
    /// Side of the sources as a share of the pictures', above 0: smaller sources take less time to match.
    pub source_share: f32,
}

impl Default for TrainingFree {
    /// Sources at the size of the pictures.
    fn default() -> TrainingFree {
        TrainingFree { hull: hull::Hull::default(), sweep: Sweep::default(), source_share: 1.0 }
    }
}

/// The training-free field's row.
pub(crate) const ROW: Row = Row {
    name: "training-free",
    title: "training-free field",
    heading: "Options of the training-free field",
    origin: Origin::TrainingFree { open: |_| Ok(AnyField::new(TrainingFree::default())) },
    flags: &[],
    omissions: &[],
    presets: presets::of,
};

impl Field for TrainingFree {
    fn about(&self) -> About {
        About {
            // Depth needs at least two views.
            least_sources: 2,
            source_side: SourceSide::Share(self.source_share),
            ends_rays: true,
            ..About::new(ROW.name)
        }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        if sources.has_silhouettes {
            Ok(Box::new(self.hull.views(device, sources, progress)?))
        } else {
            self.sweep.prepare(device, sources, progress)
        }
    }

    fn preview(&self) -> Option<TrainingFree> {
        Some(TrainingFree { sweep: self.sweep.preview(), ..*self })
    }
}
