//! The traits of a field: [`Field`] states its requirements and takes source views to a device; [`Prepared`] encodes
//! views and renders. A [`Stage`](crate::render::Stage) calls both: it alone decides when a view is encoded.
//!
//! A field renders in more than one way by values of its own options: a [`Variant`] is one of
//! them. Its efforts are what a [`Bound`](crate::budget::Bound) chooses from; its candidates are tried on held-out
//! sources, and its parts mixed, because pictures become better. What the render loop omits of any field's work,
//! sources of least weight and samples behind surfaces, is in [`RenderOptions`](crate::render::RenderOptions).

use super::error::FieldError;
use super::record::Record;
use super::variant::{AnyOptions, Variant};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::Kernel;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// Default limit of a picture's longest side.
pub const LONGEST_DEFAULT_SIDE: u32 = 512;

/// Renders target views from source views, on any device.
pub trait Field {
    /// Its requirements and properties.
    fn about(&self) -> About;

    /// Its options.
    fn options(&self) -> AnyOptions {
        AnyOptions::new(())
    }

    /// Takes the photographs, and its parameters if it has any, to a device. Nothing is encoded yet.
    ///
    /// # Errors
    /// [`FieldError`].
    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError>;
}

/// A picture that is begun; it is waited for when it is called.
pub type Drawing<'a> = Box<dyn FnOnce() -> Result<Rendered, FieldError> + 'a>;

/// Source views on a device, with their encodings so far. What not every field can do is a capability: a value that is
/// there or not.
pub trait Prepared<'a> {
    /// Which views are encoded.
    fn encoding(&self) -> Encoding {
        Encoding::Used
    }

    /// What is behind everything that it renders, red, green, blue in `[0, 1]`; `None` for the sources' own background.
    fn background(&self) -> Option<[f32; 3]> {
        None
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

    /// Goes on towards a picture: waits for what the last call asked for, if it did, and asks the device for what it will
    /// wait for next. Returns whether there is nothing more to ask for before it is drawn; otherwise this is called
    /// again. What pictures of several prepared sources asked for is waited for together.
    ///
    /// # Errors
    /// [`FieldError`].
    fn advance(&mut self, _request: &Request<'_>, _progress: &dyn Progress) -> Result<bool, FieldError> {
        Ok(true)
    }

    /// As [`Prepared::render`], begun: several pictures can be waited for together.
    ///
    /// # Errors
    /// [`FieldError`].
    fn draw(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Drawing<'a>, FieldError> {
        let rendered = self.render(request, progress)?;
        Ok(Box::new(move || Ok(rendered)))
    }

    /// As [`Prepared::render`], rounded where the picture is made, so that less of it comes from a device; `None` from
    /// fields that do not.
    ///
    /// # Errors
    /// [`FieldError`].
    fn render_rounded(
        &mut self,
        _request: &Request<'_>,
        _progress: &dyn Progress,
    ) -> Result<Option<Rounded>, FieldError> {
        Ok(None)
    }

    /// The record of its work so far; the stage counts encoded views.
    fn record(&self) -> Record {
        Record::default()
    }

    /// Whether a view's encoding depends on how relevant the others are to it: views are encoded again for each
    /// weighting.
    fn is_weighted(&self) -> bool {
        false
    }

    /// Begins a weighting, for views that depend on it. `relevance[view]` are the weights of all sources for source
    /// `view` as a target, its own 0.
    ///
    /// # Errors
    /// [`FieldError`].
    fn weigh(&mut self, _relevance: &[SourceWeights]) -> Result<(), FieldError> {
        Ok(())
    }

    /// Renders what follows under these options; those of another field change nothing. Views are encoded again where
    /// [`Options::encodes_alike`](crate::variant::Options::encodes_alike) says that they have to be.
    ///
    /// # Errors
    /// [`FieldError`].
    fn set(&mut self, _options: &AnyOptions) -> Result<(), FieldError> {
        Ok(())
    }

    /// The efforts of these options, the cheapest first, the exact one last: what a bound on the error or on the time
    /// chooses from. None for a field with one way to render. Labels, errors and times are the same for the life of the
    /// prepared views. `pixel_count` are about the pixels of a picture: what takes a while to be tried on a device is
    /// listed where pictures are work enough for it.
    fn efforts(&self, _options: &AnyOptions, _pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        Vec::new()
    }

    /// How the error of a picture is found.
    fn check(&self) -> Check {
        Check::Comparison
    }

    /// For [`Check::Pixels`]: colours and opacities of some pixels of a target, row-major indices, as
    /// [`Prepared::render`] would give them with the exact effort. All [`Request::views`] are encoded.
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

    /// As [`Prepared::exact_pixels`] under the options that are set, where nothing is interpolated between pixels: what
    /// these omit of a ray shows before a whole picture is rendered. Nothing from fields that cannot.
    ///
    /// # Errors
    /// [`FieldError`].
    fn pixels(
        &mut self,
        _request: &Request<'_>,
        _pixels: &[u32],
        _progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        Ok(Vec::new())
    }

    /// For [`Check::Steps`]: the root mean square difference of the last picture from the exact one, colours from 0 to
    /// 1.
    fn error(&self) -> f32 {
        f32::INFINITY
    }

    /// These options with less resolution, for a purpose.
    fn reduced(&self, options: &AnyOptions, _purpose: Purpose) -> AnyOptions {
        options.clone()
    }

    /// What a step of the search for a scene's options tries in place of those chosen so far; nothing after the last
    /// step. What is tried may encode views otherwise: a trial keeps the encodings that are there.
    fn candidates(&self, _chosen: &AnyOptions, _step: usize) -> Vec<AnyOptions> {
        Vec::new()
    }

    /// What is worth mixing where these options were chosen: of each mixture the options of its pictures. A mixture of
    /// one picture is that picture.
    fn mixtures(&self, _chosen: &AnyOptions) -> Vec<Variant<Vec<AnyOptions>>> {
        Vec::new()
    }

    /// What is known of where the surfaces are.
    fn geometry(&self) -> Option<&dyn Geometry> {
        None
    }
}

/// How the error of a picture of an effort is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// By [`Prepared::exact_pixels`]: pixels are independent of one another.
    Pixels,
    /// By the field's own steps: [`Prepared::error`].
    Steps,
    /// By comparing pictures of two efforts.
    Comparison,
}

/// For what pictures have less resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// They are only compared with one another, where that changes the comparison little.
    Trial,
    /// A camera moves; for fields that say so ([`About::has_previews`]).
    Preview,
}

/// Where the surfaces are.
pub trait Geometry {
    /// What is known before views are encoded; nothing by default.
    fn surfaces(&self) -> Surfaces {
        Surfaces::default()
    }

    /// Asks the device for what [`Geometry::source_depths`] has to wait for; returns whether that is there.
    ///
    /// # Errors
    /// [`FieldError`].
    fn ask_for_depths(&self) -> Result<bool, FieldError> {
        Ok(true)
    }

    /// The depth map of each source view that is encoded, under the current weighting. For point clouds.
    ///
    /// # Errors
    /// [`FieldError`].
    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError>;
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
    /// Whether the view shows a point, world coordinates: it lies in the image, and not behind a surface that can be
    /// relied on. Maps without confidences are taken to be sure.
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
    /// Whether its options can be reduced while a camera moves; otherwise its pictures are made smaller.
    pub has_previews: bool,
    /// The kernels that its pictures usually need, in the order of their first use: a device compiles them while files
    /// are read.
    pub kernels: &'static [Kernel],
    /// Whether a picture takes milliseconds once the sources are prepared, because the scene is there and is only
    /// drawn: a moving camera then gets larger pictures, and more of them.
    pub is_live: bool,
    /// Whether it draws all that there is: a pixel without a surface may show nothing of a scene whose photographs have
    /// no silhouettes, and counts among what no photograph shows where the camera looks past all of them.
    pub draws_all: bool,
    /// Whether its pictures come with depths and an opacity; otherwise they are pictures alone, and opaque.
    pub has_surfaces: bool,
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
            has_previews: false,
            kernels: &[],
            is_live: false,
            draws_all: false,
            has_surfaces: true,
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
    /// As `Used`, and where something may be left out, only so many views of greatest weight contribute to a picture:
    /// views of less weight add more errors than they show. Views of equal weight stay together. The field compares
    /// views to find depth: where fewer than four have a weight, the next ones get a small one.
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

/// A rendered target view, as it is shown. Row-major, one entry a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounded {
    /// Red, green, blue and confidence in 255ths.
    pub pixels: Vec<[u8; 4]>,
    /// Depth along the principal axis in world units, 0 where there is no surface.
    pub depths: Vec<f32>,
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
}
