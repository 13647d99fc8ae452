//! The training-free field, for any scene and on any device.
//!
//! ```text
//! hull     sources that show a silhouette: a solid carved by them and by photo-consistency
//! sweep    any sources: planes through the frusta of sources and target
//! space    near and far bounds, for the planes
//! exposure gains that equalise the sources' exposure
//! ```

mod exposure;
pub mod hull;
mod space;
mod sweep;

use super::{About, Encoding, Field, FieldError, Prepared, SourceSide};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

pub use hull::{NoObject, find_object};
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
    /// Use the plane sweep also for sources with silhouettes.
    pub always_sweep: bool,
}

impl Default for TrainingFree {
    /// Sources at the size of the pictures.
    fn default() -> TrainingFree {
        TrainingFree { hull: hull::Hull::default(), sweep: Sweep::default(), source_share: 1.0, always_sweep: false }
    }
}

impl Field for TrainingFree {
    fn about(&self) -> About {
        About {
            // Depth needs at least two views.
            least_sources: 2,
            source_side: SourceSide::Share(self.source_share),
            encoding: Encoding::EachWeighting,
            ends_rays: true,
            ..About::new("training-free")
        }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        if sources.has_silhouettes && !self.always_sweep {
            Ok(Box::new(self.hull.views(device, sources, progress)?))
        } else {
            Ok(Box::new(self.sweep.views(device, sources, progress)?))
        }
    }
}
