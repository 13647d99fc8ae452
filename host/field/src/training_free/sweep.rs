//! Any sources: planes of equal disparity through the frusta of the sources and of the target; the mathematics is in
//! [`viewfuse_kernels::plane_sweep`].
//!
//! ```text
//! matching     costs of the planes in a frustum
//! scratch      memory that is used again
//! kept         what was found of the sources, in a folder between runs
//! search       surface points of a scene whose files do not tell its depths
//! views        the sources on a device, and the lives of what is kept of them
//! sources      the sources' disparities: found, found again by what they say of one another, kept
//! consistency  how far the sources' disparities confirm one another
//! target       what is found of a target's views, and the costs of its planes
//! holes        surfaces that no source shows
//! unseen       parts of a picture that its photograph does not show
//! scalars      the scalars that are chosen for a scene, and the pictures that are mixed
//! efforts      coarser comparisons, from the cheapest to the exact one
//! ```

mod consistency;
mod efforts;
mod holes;
mod kept;
mod matching;
mod scalars;
mod scratch;
mod search;
mod sources;
mod target;
mod unseen;
mod views;

use crate::row::{Origin, Row};
use crate::{About, AnyField, AnyOptions, Field, FieldError, Prepared};
pub use kept::Cache;
use matching::Matching;
use viewfuse_core::camera::Camera;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::disparity::TEMPERATURE;
use viewfuse_scene::photographs::SourceImages;
use views::Views;

/// The settings that serve most scenes.
const DEFAULT: Sweep = Sweep {
    plane_count: 64,
    neighbours: 2,
    match_side: 256,
    near_cost: 0.01,
    front_share: 0.1,
    second_share: 0.0,
    dissent_share: 0.0625,
    consistency_share: 0.5,
    temperature: TEMPERATURE,
};

/// Settings of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Planes of a frustum: a multiple of 16, at most 128.
    pub plane_count: u32,
    /// Most other sources that a source is compared with, those with the greatest weights: run time is linear in the
    /// sources.
    pub neighbours: usize,
    /// Longest side at which views are compared, in pixels. Colours are blended at the size of the pictures.
    pub match_side: u32,
    /// Cost of the nearest plane relative to the farthest one: of equal matches the farther one is chosen.
    pub near_cost: f32,
    /// Cost of a plane that is transparent, or hidden by a nearer one, by the sources' own disparities: the nearer of
    /// two surfaces wins, whichever more sources see.
    pub front_share: f32,
    /// The same for the sources: their disparities are then found a second time, by what the first ones say of one
    /// another; 0 for once.
    pub second_share: f32,
    /// Cost of contradicting the sources' own disparities.
    pub dissent_share: f32,
    /// Share of the confidence of a source's disparity that is its geometric consistency with two others; 0 for none.
    pub consistency_share: f32,
    /// Temperature of the softmax over planes.
    pub temperature: f32,
}

impl Default for Sweep {
    fn default() -> Sweep {
        DEFAULT
    }
}

impl Sweep {
    fn matching<'d, D: Device>(&self, device: &'d D, has_silhouettes: bool) -> Matching<'d, D> {
        let &Sweep { near_cost, dissent_share, front_share, .. } = self;
        Matching { device, has_silhouettes, near_cost, dissent_share, front_share }
    }
}

/// The row of the plane sweep alone.
pub(crate) const ROW: Row = Row {
    name: "plane-sweep",
    title: "plane sweep",
    heading: "Options of the plane sweep",
    origin: Origin::TrainingFree { open: |_| Ok(AnyField::new(Sweep::default())) },
    flags: &[],
    omissions: &[],
    drawn: |_, _, _, _| Vec::new(),
};

impl Field for Sweep {
    /// Sources at the size of the pictures.
    fn about(&self) -> About {
        About { least_sources: 2, has_previews: true, ..About::new(ROW.name) }
    }

    fn options(&self) -> AnyOptions {
        AnyOptions::new(*self)
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        self.prepare_kept(device, sources, None, progress)
    }
}

impl Sweep {
    /// As [`Field::prepare`], with what was found of the sources before.
    pub(super) fn prepare_kept<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        cache: Option<&Cache>,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        if !sources.has_silhouettes {
            let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
            viewfuse_scene::rig::gap_warning(&cameras).iter().for_each(|warning| progress.warn(warning));
        }
        Ok(Box::new(Views::upload(*self, device, sources, cache, progress)?))
    }
}
