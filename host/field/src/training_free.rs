//! The training-free field, for any scene and on any device.
//!
//! ```text
//! space      near and far bounds, for the planes
//! exposure   gains that equalise the sources' exposure
//! sweep      any sources: planes through the frusta of sources and target
//! hull       sources that show a silhouette: a solid carved by them and by photo-consistency
//! splats     Gaussians that begin with the depths of the hull or the sweep
//! mixed      pictures of the hull or the sweep, and those of Gaussians to mix with them
//! gaussians  the field of Gaussians alone
//! variants   what `pareto` draws
//! ```

mod exposure;
mod gaussians;
pub mod hull;
mod mixed;
mod space;
mod splats;
mod sweep;
mod variants;

use self::mixed::Mixed;
use self::splats::SourceDepths;
use super::gaussians::Recipe;
use super::options::{Given, OpenError, flags};
use super::row::{Origin, Row};
use super::{About, AnyField, AnyOptions, Field, FieldError, Options, Prepared, Setting, SourceSide};
use std::path::{Path, PathBuf};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::Kernel;
use viewfuse_scene::photographs::SourceImages;

pub use gaussians::Gaussians;
pub(crate) use gaussians::ROW as GAUSSIANS;
pub use hull::NoObject;
pub use mixed::Shown;
pub(crate) use sweep::ROW as SWEEP;
pub use sweep::{Cache, Sweep};

/// Depths from the consensus of the photographs, colour by weighted fusion with visibility. Nothing is learned.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingFree {
    /// Settings for sources with silhouettes.
    pub hull: hull::Hull,
    /// Settings for other sources.
    pub sweep: Sweep,
    /// The optimisation of the Gaussians whose pictures may be mixed with these.
    pub recipe: Recipe,
    /// What pictures show.
    pub shown: Shown,
    /// Side of the sources as a share of the pictures', above 0: smaller sources take less time to match.
    pub source_share: f32,
    /// Where what is found of sources without silhouettes is kept.
    pub cache: Option<Cache>,
}

impl Default for TrainingFree {
    /// Sources at the size of the pictures.
    fn default() -> TrainingFree {
        TrainingFree {
            hull: hull::Hull::default(),
            sweep: Sweep::default(),
            recipe: Recipe::default(),
            shown: Shown::default(),
            source_share: 1.0,
            cache: None,
        }
    }
}

impl TrainingFree {
    /// With other settings for sources with silhouettes.
    fn with_hull(&self, hull: hull::Hull) -> TrainingFree {
        TrainingFree { hull, ..self.clone() }
    }

    /// With other settings for sources without.
    fn with(&self, sweep: Sweep) -> TrainingFree {
        TrainingFree { sweep, ..self.clone() }
    }
}

impl Options for TrainingFree {
    fn encodes_alike(&self, other: &TrainingFree) -> bool {
        self.hull.encodes_alike(&other.hull) && self.sweep.encodes_alike(&other.sweep)
    }

    fn settings(&self) -> Vec<Setting> {
        let settings = self.sweep.settings().into_iter().chain(self.shown.setting());
        settings.chain(if self.shown == Shown::Depths { Vec::new() } else { self.recipe.settings() }).collect()
    }

    fn folder(&self) -> Option<&Path> {
        self.cache.as_ref().map(Cache::folder)
    }
}

/// The training-free field's row.
pub(crate) const ROW: Row = Row {
    name: "training-free",
    title: "training-free field",
    heading: "Options of the training-free field",
    origin: Origin::TrainingFree { open },
    flags: FLAGS,
    omissions: &[],
    drawn: variants::drawn,
};

flags! {
    Option<PathBuf>;
    "cache", "FOLDER", parse_folder, Picture, &[],
        "Keep what is found of the sources and what is chosen for them in this folder, and start from what is there: \
         it may be deleted at any time",
        |cache, folder| *cache = Some(folder);
}

fn parse_folder(text: &str) -> Result<PathBuf, String> {
    if text.is_empty() { Err("a folder".to_owned()) } else { Ok(PathBuf::from(text)) }
}

fn open(given: &Given) -> Result<AnyField, OpenError> {
    let cache = taken(given, None).map(|folder| Cache::open(&folder)).transpose()?;
    Ok(AnyField::new(TrainingFree { cache, ..TrainingFree::default() }))
}

/// Those of the sweep, of the hull, and of Gaussians, each in the order of their first use: which of them a scene needs
/// is known when its photographs are read.
const KERNELS: [Kernel; 35] = [
    Kernel::CompareViews,
    Kernel::CensusCost,
    Kernel::RowSums,
    Kernel::WindowCost,
    Kernel::FollowPaths,
    Kernel::JoinPaths,
    Kernel::PickDisparity,
    Kernel::ConfirmDisparities,
    Kernel::PlaneOpacity,
    Kernel::FrontCost,
    Kernel::BlendPlanes,
    Kernel::HullEntry,
    Kernel::MatchCost,
    Kernel::SumRow,
    Kernel::MeanColumn,
    Kernel::PickDepth,
    Kernel::MarchRays,
    Kernel::ProjectParticles,
    Kernel::CountEntries,
    Kernel::SumEntries,
    Kernel::ListEntries,
    Kernel::MarkBins,
    Kernel::SortEntries,
    Kernel::StartTiles,
    Kernel::BlendSplats,
    Kernel::MeasureWindows,
    Kernel::CompareWindows,
    Kernel::ComparePixels,
    Kernel::BlendGradient,
    Kernel::SumShares,
    Kernel::GatherGradients,
    Kernel::StepParticles,
    Kernel::StepHarmonics,
    Kernel::StepGains,
    Kernel::ProjectGaussians,
];

impl Field for TrainingFree {
    fn about(&self) -> About {
        About {
            // Depth needs at least two views.
            least_sources: 2,
            source_side: SourceSide::Share(self.source_share),
            ends_rays: true,
            has_previews: true,
            kernels: &KERNELS,
            ..About::new(ROW.name)
        }
    }

    fn options(&self) -> AnyOptions {
        AnyOptions::new(self.clone())
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        let (fields, cache) = ((&self.hull, &self.sweep), self.cache.as_ref());
        let depths = SourceDepths::prepare(device, fields, cache, sources, progress)?;
        Ok(Box::new(Mixed::new(depths, self)))
    }
}
