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

use super::{About, Field, FieldError, Prepared, SourceSide};
use viewfuse_core::camera::Camera;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::rig::Rig;

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
}

impl Default for TrainingFree {
    /// Sources at the size of the pictures.
    fn default() -> TrainingFree {
        TrainingFree { hull: hull::Hull::default(), sweep: Sweep::default(), source_share: 1.0 }
    }
}

/// Angle between neighbouring views, seen from what they look at, beyond which depths are no longer found in whole
/// photographs.
const MAX_GAP_DEGREES: f32 = 15.0;

/// A warning if neighbouring views are too far apart to find depths in whole photographs. `cameras` are the sources'.
pub fn gap_warning(cameras: &[Camera]) -> Option<String> {
    let gap = Rig::of(cameras).median_gap(cameras).filter(|gap| *gap > MAX_GAP_DEGREES)?;
    Some(format!(
        "a view and the one nearest to it are {gap:.0} degrees apart (median): depths in whole photographs are found \
         reliably up to about {MAX_GAP_DEGREES:.0} degrees; take photographs between them"
    ))
}

impl Field for TrainingFree {
    fn about(&self) -> About {
        About {
            // Depth needs at least two views.
            least_sources: 2,
            source_side: SourceSide::Share(self.source_share),
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
        if sources.has_silhouettes {
            Ok(Box::new(self.hull.views(device, sources, progress)?))
        } else {
            self.sweep.prepare(device, sources, progress)
        }
    }
}
