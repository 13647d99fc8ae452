//! The traits of a field: [`Field`] states its requirements and takes source views to a device; [`Prepared`] encodes views
//! and renders. [`Session`](crate::session::Session) calls both: it alone decides when a view is encoded.

use super::error::FieldError;
use super::record::Record;
use serde::Serialize;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// Default limit of a picture's longest side.
pub const LONGEST_DEFAULT_SIDE: u32 = 512;

/// Renders target views from source views, on any device.
pub trait Field {
    /// Its requirements and properties, with its settings.
    fn about(&self) -> About;

    /// Takes the photographs, and its parameters if it has any, to a device. Nothing is encoded yet.
    ///
    /// # Errors
    /// [`FieldError`].
    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError>;
}

/// Source views on a device, with their encodings so far.
pub trait Prepared {
    /// Which views are encoded.
    fn encoding(&self) -> Encoding {
        Encoding::Used
    }

    /// Whether a view's encoding depends on how relevant the others are to it: views are then encoded again for each
    /// weighting, after [`Prepared::weigh`].
    fn depends_on_weighting(&self) -> bool {
        false
    }

    /// Begins a weighting. `relevance[view]` are the weights of all sources for source `view` as a target, its own 0. Called
    /// only if [`Prepared::depends_on_weighting`].
    ///
    /// # Errors
    /// [`FieldError`].
    fn weigh(&mut self, _relevance: &[SourceWeights]) -> Result<(), FieldError> {
        Ok(())
    }

    /// Encodes a source view, which is not encoded yet.
    ///
    /// # Errors
    /// [`FieldError`].
    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError>;

    /// Renders a target. All [`Request::views`] are encoded.
    ///
    /// # Errors
    /// [`FieldError`].
    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError>;

    /// The scalars that can be chosen for a scene, for these sources; none by default.
    fn tunables(&self) -> &'static [Tunable] {
        &[]
    }

    /// Sets scalars for the views and targets that follow; those that are not named take their defaults. Encoded views stay
    /// as they are. Names that are none of [`Prepared::tunables`] are ignored.
    fn tune(&mut self, _settings: &[Setting]) {}

    /// What follows is only compared with one another: the field may work with less resolution where that changes the
    /// comparison little.
    fn simplify(&mut self) {}

    /// The ways in which the field can render, the cheapest first, the exact one last: what a bound on the error or on the
    /// time chooses from. Empty for a field with one way.
    fn efforts(&self) -> Vec<Effort> {
        Vec::new()
    }

    /// Renders what follows with one of [`Prepared::efforts`], by index; others are ignored.
    ///
    /// # Errors
    /// [`FieldError`].
    fn set_effort(&mut self, _effort: usize) -> Result<Encodings, FieldError> {
        Ok(Encodings::Kept)
    }

    /// Whether the field can tell the error of a picture of an effort from its own steps, by [`Prepared::estimated_error`].
    fn estimates_errors(&self) -> bool {
        false
    }

    /// The root mean square difference of the last picture from the exact one, colours from 0 to 1. Called only if
    /// [`Prepared::estimates_errors`], after [`Prepared::set_effort`].
    fn estimated_error(&self) -> f32 {
        f32::INFINITY
    }

    /// Whether the field can render pixels alone, by [`Prepared::exact_pixels`], because they are independent of one another.
    fn renders_pixels(&self) -> bool {
        false
    }

    /// Colours and opacities of some pixels of a target, row-major indices: what [`Prepared::render`] would give with the last of
    /// [`Prepared::efforts`]. Called only if [`Prepared::renders_pixels`]; all [`Request::views`] are encoded.
    ///
    /// # Errors
    /// [`FieldError`].
    fn exact_pixels(
        &mut self,
        _request: &Request<'_>,
        _pixels: &[u32],
        _progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        Ok(Vec::new())
    }

    /// What is known of where the surfaces are; nothing by default.
    fn surfaces(&self) -> Surfaces {
        Surfaces::default()
    }

    /// The depth map of each source view that is encoded, under the current weighting; empty by default, for fields without
    /// maps of sources. For point clouds.
    ///
    /// # Errors
    /// [`FieldError`].
    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        Ok(Vec::new())
    }

    /// The record of its work so far; the session counts encoded views.
    fn record(&self) -> Record {
        Record::default()
    }
}

/// A way in which a field can render.
#[derive(Clone, Debug, PartialEq)]
pub struct Effort {
    /// What it does, in a few words.
    pub name: String,
    /// The root mean square difference of its pictures from the exact ones that is typical of it, colours from 0 to 1: where
    /// a search begins. 0 for the exact one.
    pub typical_error: f32,
    /// Its work as a share of the exact one's, likewise.
    pub typical_work: f32,
}

impl Effort {
    /// An effort that leaves something out.
    pub fn new(name: impl Into<String>, typical_error: f32, typical_work: f32) -> Effort {
        Effort { name: name.into(), typical_error, typical_work }
    }

    /// The one that leaves nothing out.
    pub fn exact() -> Effort {
        Effort { name: "exact".to_owned(), typical_error: 0.0, typical_work: 1.0 }
    }
}

/// Whether the encodings of views serve another effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encodings {
    /// They do.
    Kept,
    /// Views must be encoded again.
    Dropped,
}

/// A scalar of a field that can be chosen for a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tunable {
    /// Its name.
    pub name: &'static str,
    /// Its default.
    pub default: f32,
    /// Other values that are worth a trial.
    pub others: &'static [f32],
}

/// A value of a [`Tunable`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// The scalar's name.
    pub name: &'static str,
    /// Its value.
    pub value: f32,
}

/// What is known of where the surfaces of a scene are, in the form of [`SourceImages`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surfaces {
    /// Points on surfaces, in world coordinates.
    pub points: Vec<Vec3>,
    /// Nearest and farthest depth in any view.
    pub near_far: Option<[f32; 2]>,
}

/// A source view's depths.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// The camera, of the map's size; its first texel is 0.
    pub camera: CameraBlock,
    /// Depths along the principal axis in world units, 0 where there is no surface; row-major.
    pub depths: Vec<f32>,
    /// How far each depth can be relied on, in `[0, 1]`; empty for fields that do not tell.
    pub confidences: Vec<f32>,
}

/// Requirements and properties of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct About {
    /// Its name in the run record.
    pub name: &'static str,
    /// The fewest sources that it can use.
    pub least_sources: usize,
    /// The size of the source photographs.
    pub source_side: SourceSide,
    /// The default limit of its pictures' longest side.
    pub longest_side: u32,
    /// Whether it supports early termination of rays ([`Request::early_termination`]).
    pub ends_rays: bool,
}

impl About {
    /// A field of this name that uses any number of sources at the pictures' size and has no early termination.
    pub const fn new(name: &'static str) -> About {
        About {
            name,
            least_sources: 1,
            source_side: SourceSide::Share(1.0),
            longest_side: LONGEST_DEFAULT_SIDE,
            ends_rays: false,
        }
    }
}

/// Longest side of a field's source photographs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SourceSide {
    /// This many pixels, independent of the pictures.
    Pixels(u32),
    /// This share of the pictures' longest side.
    Share(f32),
}

impl SourceSide {
    /// In pixels, for pictures of this longest side; at least 1.
    pub fn of(self, picture_side: u32) -> u32 {
        match self {
            SourceSide::Pixels(side) => side,
            SourceSide::Share(share) => ((picture_side as f32 * share).round() as u32).max(1),
        }
    }
}

/// Which source views are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// All, before the first target: all of them contribute to each picture.
    All,
    /// Each when a target first gives it a weight. Views without a weight do not contribute to a picture.
    Used,
}

/// A picture to render.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The camera, of the picture's size.
    pub camera: &'a Camera,
    /// The weights of all sources; they sum to 1.
    pub weights: &'a SourceWeights,
    /// The contributing views, in ascending order: with [`Encoding::Used`] those with a weight, otherwise all.
    pub views: &'a [usize],
    /// Early termination: the transmittance below which samples are left out; no channel changes by more than that.
    pub early_termination: f32,
}

impl Request<'_> {
    /// The weights of the contributing views, in their order.
    pub fn view_weights(&self) -> Vec<f32> {
        self.views.iter().map(|view| self.weights.get(*view as u32)).collect()
    }
}

/// A rendered target view, values not yet rounded. Row-major, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Red, green, blue in `[0, 1]` and opacity.
    pub colours: Vec<[f32; 4]>,
    /// Depth along the principal axis in world units, 0 where there is no surface; empty for fields without depths.
    pub depths: Vec<f32>,
    /// How far each pixel can be relied on, in `[0, 1]`; empty for fields that do not tell.
    pub confidences: Vec<f32>,
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
}
