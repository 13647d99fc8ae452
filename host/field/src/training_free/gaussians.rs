//! The field of Gaussians alone: a scene of its own, from the depths of the sweep or of the hull.

use super::hull::Hull;
use super::sweep::Sweep;
use super::with_gaussians::WithGaussians;
use crate::gaussians::Recipe;
use crate::row::{Origin, Row};
use crate::{About, AnyField, Field, FieldError, Prepared};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

/// Pictures of Gaussians that are optimised for the sources. Nothing is learned but the scene itself.
#[derive(Clone, Debug, Default)]
pub struct Gaussians {
    /// The depths of sources with silhouettes, which the Gaussians begin with.
    pub hull: Hull,
    /// The depths of other sources.
    pub sweep: Sweep,
    /// The optimisation.
    pub recipe: Recipe,
}

/// The row of the Gaussians.
pub(crate) const ROW: Row = Row {
    name: "gaussians",
    title: "field of Gaussians",
    heading: "Options of the field of Gaussians",
    origin: Origin::TrainingFree { open: |_| Ok(AnyField::new(Gaussians::default())) },
    flags: &[],
    omissions: &[],
    presets: |_, _, _| Vec::new(),
};

impl Field for Gaussians {
    /// Sources at the size of the pictures.
    fn about(&self) -> About {
        About { least_sources: 2, ..About::new(ROW.name) }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        let depths: Box<dyn Prepared + 'a> = match sources.has_silhouettes {
            true => Box::new(self.hull.views(device, sources, progress)?),
            false => self.sweep.prepare_kept(device, sources, None, progress)?,
        };
        Ok(Box::new(WithGaussians::new(device, depths, sources, self.recipe, true)))
    }
}
