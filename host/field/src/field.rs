//! The traits of a field: [`Field`] states its requirements and takes source views to a device; [`Prepared`] encodes views
//! and renders. A [`Stage`](crate::render::Stage) calls both: it alone decides when a view is encoded.
//!
//! What is left out for speed is an [`Effort`]: what it leaves out, its share of the exact picture's time, its typical
//! error. Its parts are [`Omission`](crate::Omission)s, which have names of their own, and what the render loop leaves out
//! of any field's work: sources of least weight and samples behind surfaces
//! ([`RenderOptions`](crate::render::RenderOptions)). A [`Bound`](crate::budget::Bound) chooses among the efforts that a
//! field lists; trials and previews have efforts of their own. A [`Tunable`] is none: it leaves nothing out, and is chosen
//! for a scene because pictures become better.

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

    /// A cheaper form of the field, for pictures while a camera moves; `None` where its pictures are made smaller instead.
    fn preview(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Whether a picture takes milliseconds once the sources are prepared, because the scene is there and is only drawn: a
    /// moving camera then gets larger pictures, and more of them.
    fn is_live(&self) -> bool {
        false
    }
}

/// Source views on a device, with their encodings so far. What not every field can do is a capability: a value that is
/// there or not.
pub trait Prepared {
    /// Which views are encoded.
    fn encoding(&self) -> Encoding {
        Encoding::Used
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

    /// The record of its work so far; the stage counts encoded views.
    fn record(&self) -> Record {
        Record::default()
    }

    /// Views are encoded for a weighting, if a view's encoding depends on how relevant the others are to it.
    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        None
    }

    /// Several efforts, if the field can render in more than one way.
    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        None
    }

    /// Scalars that can be chosen for a scene.
    fn tuned(&mut self) -> Option<&mut dyn Tuned> {
        None
    }

    /// What is known of where the surfaces are.
    fn geometry(&self) -> Option<&dyn Geometry> {
        None
    }
}

/// Views whose encodings depend on the weighting: they are encoded again for each.
pub trait Weighted {
    /// Begins a weighting. `relevance[view]` are the weights of all sources for source `view` as a target, its own 0.
    ///
    /// # Errors
    /// [`FieldError`].
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError>;
}

/// The efforts with which a field can render.
pub trait Efforts {
    /// The efforts, the cheapest first, the exact one last: what a bound on the error or on the time chooses from. The
    /// same for the life of the prepared views.
    fn list(&self) -> Vec<Effort>;

    /// Renders what follows with an effort of the list, by index.
    ///
    /// # Errors
    /// [`FieldError`].
    fn set(&mut self, effort: usize) -> Result<Encodings, FieldError>;

    /// Whether an effort goes on from where a cheaper one ended: both together take the time of the dearer one. The same for the
    /// life of the prepared views.
    fn goes_on(&self) -> bool {
        false
    }

    /// Renders what follows with the effort of trials: pictures that are only compared with one another, and may have less
    /// resolution where that changes the comparison little. Before views are encoded.
    fn set_trial(&mut self) {}

    /// How the error of a picture is found; the same kind for the life of the prepared views.
    fn check(&mut self) -> Check<'_> {
        Check::Comparison
    }
}

/// How the error of a picture of an effort is found.
pub enum Check<'a> {
    /// By pixels of the exact picture: pixels are independent of one another.
    Pixels(&'a mut dyn ExactPixels),
    /// By the field's own steps: the root mean square difference of the last picture from the exact one, colours from 0
    /// to 1.
    Steps(f32),
    /// By comparing pictures of two efforts.
    Comparison,
}

/// Pixels of the exact picture, alone.
pub trait ExactPixels {
    /// Colours and opacities of some pixels of a target, row-major indices: what [`Prepared::render`] would give with the
    /// last of [`Efforts::list`]. All [`Request::views`] are encoded.
    ///
    /// # Errors
    /// [`FieldError`].
    fn exact_pixels(
        &mut self,
        request: &Request<'_>,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError>;
}

/// Scalars that can be chosen for a scene.
pub trait Tuned {
    /// The scalars, for these sources.
    fn tunables(&self) -> &'static [Tunable];

    /// Sets scalars for the views and targets that follow; those that are not named take their defaults. Encoded views stay
    /// as they are. Names that are none of [`Tuned::tunables`] are ignored.
    fn tune(&mut self, settings: &[Setting]);

    /// Settings whose pictures are worth mixing where these were chosen; none by default.
    fn parts(&mut self, _chosen: &[Setting]) -> Vec<Vec<Setting>> {
        Vec::new()
    }
}

/// Where the surfaces are.
pub trait Geometry {
    /// What is known before views are encoded; nothing by default.
    fn surfaces(&self) -> Surfaces {
        Surfaces::default()
    }

    /// The depth map of each source view that is encoded, under the current weighting. For point clouds.
    ///
    /// # Errors
    /// [`FieldError`].
    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError>;
}

/// An effort: how a field renders, between the cheapest picture and the exact one.
#[derive(Clone, Debug, PartialEq)]
pub struct Effort {
    /// What it leaves out, or what it keeps, in a few words.
    pub name: String,
    /// The root mean square difference of its pictures from the exact ones that is typical of it, colours from 0 to 1: where
    /// a search begins. 0 for the exact one.
    pub typical_error: f32,
    /// Its share of the exact one's time, likewise.
    pub typical_share: f32,
}

impl Effort {
    /// An effort that leaves something out.
    pub fn new(name: impl Into<String>, typical_error: f32, typical_share: f32) -> Effort {
        Effort { name: name.into(), typical_error, typical_share }
    }

    /// The one that leaves nothing out.
    pub fn exact() -> Effort {
        Effort { name: "exact".to_owned(), typical_error: 0.0, typical_share: 1.0 }
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

/// A view does not show what lies behind its own surface by more than this share of the depth.
const MAX_BEHIND: f32 = 0.05;
/// Confidence from which on a view's surface hides something.
const MIN_CONFIDENCE: f32 = 0.5;

impl DepthMap {
    /// Whether the view shows a point, world coordinates: it lies in the image, and not behind a surface that can be relied on. Maps without
    /// confidences are taken to be sure.
    pub(crate) fn shows(&self, point: Vec3) -> bool {
        let there = self.camera.project(point);
        let hides = |at: usize| {
            self.confidences.get(at).is_none_or(|confidence| *confidence > MIN_CONFIDENCE)
                && self
                    .depths
                    .get(at)
                    .is_some_and(|surface| *surface > 0.0 && there.depth > surface * (1.0 + MAX_BEHIND))
        };
        there.in_image && !hides(self.camera.texel_at(there.x, there.y))
    }
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
    /// As `Used`, and where something may be left out, only so many views of greatest weight contribute to a picture: views of less
    /// weight add more errors than they show. Views of equal weight stay together.
    Greatest(usize),
}

/// A picture to render.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The camera, of the picture's size.
    pub camera: &'a Camera,
    /// The weights of all sources; they sum to 1.
    pub weights: &'a SourceWeights,
    /// The contributing views, in ascending order: all with [`Encoding::All`], otherwise those with a weight.
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
