//! The options of a render, and the sizes that follow from them.

use super::RenderError;
use crate::budget::Bound;
use crate::{AnyOptions, Mixture, Renderer};
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::{Album, BackgroundChoice, longest_side, reduced_size, scaled_size};
use viewfuse_scene::{Scene, View};

/// The options of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width and height of the pictures; the default is the views' size, at most the field's
    /// [`About::longest_side`](crate::About::longest_side) on a side.
    pub size: Option<[u32; 2]>,
    /// The background of the object.
    pub background: BackgroundChoice,
    /// Sources of least weight are left out while their weights together stay at or below this.
    pub leave_out: f32,
    /// Transmittance of early termination.
    pub early_termination: f32,
    /// The field's options in place of its own.
    pub field: Option<AnyOptions>,
    /// Pictures under several options of the field that are mixed in place of one.
    pub mixture: Option<Mixture>,
    /// A bound on each picture's error or time, which chooses the effort.
    pub bound: Option<Bound>,
    /// Whether frames are only shown: where the field rounds its pictures,
    /// [`Frame::colours`](crate::render::Frame::colours) are not there then.
    pub is_rounded: bool,
}

/// Default of the largest share of the weight that is left out: it bounds the change of a fusion of all
/// views at 1 % of the range of its inputs. Where only some views see a point, the bound is this over their weight: for
/// schemes that give one view nearly everything (cross attention), leaving out 5 % already costs 1 dB where that one
/// view sees nothing.
pub const DEFAULT_LEAVE_OUT: f32 = 0.01;
/// Default transmittance of early termination: 1/256 of the range of a channel.
pub const DEFAULT_EARLY_TERMINATION: f32 = 1.0 / 256.0;

impl Default for RenderOptions {
    fn default() -> RenderOptions {
        RenderOptions {
            size: None,
            background: BackgroundChoice::Auto,
            leave_out: DEFAULT_LEAVE_OUT,
            early_termination: DEFAULT_EARLY_TERMINATION,
            field: None,
            mixture: None,
            bound: None,
            is_rounded: false,
        }
    }
}

/// The longest side of the pictures of a run: of the requested size, or of the largest photograph, at most `longest`
/// (a field's [`About::longest_side`](crate::About::longest_side)).
///
/// # Errors
/// [`RenderError::Shape`] if the requested size would stretch the pictures by more than a pixel.
pub fn working_side(scene: &Scene, options: &RenderOptions, longest: u32) -> Result<u32, RenderError> {
    let Some([width, height]) = options.size else {
        let largest = scene.views.iter().map(|view| longest_side(&view.camera)).max();
        return Ok(largest.unwrap_or(longest).min(longest));
    };
    if let Some(View { camera, .. }) = scene.views.first() {
        camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        if !scene.views.iter().any(|view| keeps_shape(&view.camera, [width, height])) {
            let (view_width, view_height) = (camera.pinhole.width(), camera.pinhole.height());
            let (scene, fitting_height) = (scene.path.display().to_string(), fitting_height(camera, width));
            return Err(RenderError::Shape { scene, width, height, view_width, view_height, fitting_height });
        }
    }
    Ok(width.max(height))
}

/// Width and height of the picture that a render of a scene makes at a camera.
///
/// # Errors
/// As [`working_side`].
pub fn picture_size(
    scene: &Scene,
    options: &RenderOptions,
    longest: u32,
    camera: &Camera,
) -> Result<[u32; 2], RenderError> {
    let side = working_side(scene, options, longest)?;
    Ok(size_at(camera, options.size, side))
}

/// Whether a picture of a size has the shape of a camera's, to a pixel.
fn keeps_shape(camera: &Camera, [width, height]: [u32; 2]) -> bool {
    // Of a narrow picture a width of whole pixels says little: the size to which the views are reduced is right.
    scaled_size(camera, width.max(height)) == (width, height) || fitting_height(camera, width).abs_diff(height) <= 1
}

/// The height that goes with a width.
fn fitting_height(camera: &Camera, width: u32) -> u32 {
    let pinhole = &camera.pinhole;
    (f64::from(pinhole.height()) * f64::from(width) / f64::from(pinhole.width())).round() as u32
}

/// The size of a picture: that of the options at a camera of that shape, otherwise with its longest side `side`.
pub(super) fn size_at(camera: &Camera, size: Option<[u32; 2]>, side: u32) -> [u32; 2] {
    match size {
        Some(size) if keeps_shape(camera, size) => size,
        Some(_) => scaled_size(camera, side).into(),
        None => reduced_size(camera, side).into(),
    }
}

/// The photographs of these views, decoded no larger than a render with these options needs them.
///
/// # Errors
/// [`RenderError`].
pub fn open_album<'a>(
    scene: &'a Scene,
    views: impl IntoIterator<Item = usize>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Album<'a>, RenderError> {
    let about = renderer.about();
    let side = working_side(scene, options, about.longest_side)?;
    let picture = |camera: &Camera| size_at(camera, options.size, side);
    Ok(Album::open_for(scene, views, picture, side.max(about.source_side.of(side)), progress)?)
}
