//! What a field is: [`Field`] says what it wants, and takes source views to a device; [`Prepared`] encodes views and
//! renders. [`Session`](crate::session::Session) drives both: it alone decides when a view is encoded.

use super::error::FieldError;
use super::record::Record;
use viewfuse_core::camera::Camera;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// Longest side of a picture whose size nobody asked for.
pub const LONGEST_DEFAULT_SIDE: u32 = 512;

/// What makes a target's picture from source views, on any device.
pub trait Field {
    /// What it wants and how it works, with its settings.
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

/// Source views on a device, with what a field knows of them so far.
pub trait Prepared {
    /// Begins a weighting. `relevance[view]` are the weights of all sources for source `view` as a target, its own 0. Only
    /// fields that encode under [`Encoding::EachWeighting`] have anything to do.
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

    /// What it did and left out so far; encoded views are counted by the session.
    fn record(&self) -> Record {
        Record::default()
    }
}

/// What a field wants, and how it works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct About {
    /// What the run record calls it.
    pub name: &'static str,
    /// The least number of sources it can work with.
    pub least_sources: usize,
    /// How large it wants the sources.
    pub source_side: SourceSide,
    /// The longest side of its pictures where nobody asks for a size.
    pub longest_side: u32,
    /// When a view is encoded.
    pub encoding: Encoding,
    /// Whether its rays end where little light still passes ([`Request::early_termination`]); otherwise they go on to the end.
    pub ends_rays: bool,
}

impl About {
    /// A field of this name that takes any number of sources as large as the pictures, encodes them when they are first
    /// used, and whose rays go on to the end.
    pub const fn new(name: &'static str) -> About {
        About {
            name,
            least_sources: 1,
            source_side: SourceSide::Share(1.0),
            longest_side: LONGEST_DEFAULT_SIDE,
            encoding: Encoding::WhenUsed,
            ends_rays: false,
        }
    }
}

/// Longest side of the sources that a field wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SourceSide {
    /// So many pixels, whatever the pictures are.
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

/// When a source view is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// All views, and anew under each weighting: what is known of a view depends on how relevant the others are to it.
    EachWeighting,
    /// All views, once, before the first target.
    AllFirst,
    /// Once, when a target first gives the view a weight. The others take no part in a picture.
    WhenUsed,
}

/// A picture to be rendered.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The camera, of the picture's size.
    pub camera: &'a Camera,
    /// The weights of all sources; they sum to 1.
    pub weights: &'a SourceWeights,
    /// The views that take part, in ascending order: under [`Encoding::WhenUsed`] those with a weight, otherwise all.
    pub views: &'a [usize],
    /// Transmittance at which a ray may end early: no channel changes by more than that.
    pub early_termination: f32,
}

impl Request<'_> {
    /// The weights of the views that take part, in their order.
    pub fn view_weights(&self) -> Vec<f32> {
        self.views.iter().map(|view| self.weights.get(*view as u32)).collect()
    }
}

/// A rendered target, values not yet rounded. Row-major, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Red, green, blue in `[0, 1]` and opacity.
    pub colours: Vec<[f32; 4]>,
    /// Depth along the principal axis in world units, 0 where nothing is met; empty for fields that know no depth.
    pub depths: Vec<f32>,
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
}
