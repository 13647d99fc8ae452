//! What makes a picture coarse beside reduced options of the field: smaller sources.

use std::sync::Arc;
use viewfuse_field::render::{RenderError, RenderOptions, Stage};
use viewfuse_field::{Purpose, Renderer, Surfaces};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::{Album, SourceImages};

/// Longest side of the sources in the search for the depth range, in pixels.
const RANGE_SIDE: u32 = 48;
/// Largest share of the weight that is left out, unless the person leaves out more.
const LEAVE_OUT: f32 = 0.2;

/// The options of coarse pictures.
pub(crate) fn options(options: &RenderOptions) -> RenderOptions {
    RenderOptions { leave_out: options.leave_out.max(LEAVE_OUT), bound: None, ..options.clone() }
}

/// The sources with a longest side of at most `side` pixels.
///
/// # Errors
/// [`RenderError::Unsuitable`] if a focal length becomes too short.
pub(crate) fn reduced(images: &SourceImages, side: u32, scene: &Scene) -> Result<SourceImages, RenderError> {
    let unsuitable = |error: viewfuse_core::camera::PinholeError| RenderError::Unsuitable {
        scene: scene.path.display().to_string(),
        reason: error.into(),
    };
    let small: Result<Vec<_>, _> = images.images.iter().map(|image| image.reduced(side)).collect();
    Ok(SourceImages {
        images: small.map_err(unsuitable)?,
        points: images.points.clone(),
        warnings: images.warnings.clone(),
        ..*images
    })
}

/// Takes small sources to the device for coarse pictures. Where the scene's files do not state the depth range, it is
/// searched on even smaller ones: the first picture must not wait for more.
pub(crate) fn stage<'a>(
    scene: &'a Scene,
    album: &'a Album<'a>,
    sources: &[usize],
    mut images: SourceImages,
    renderer: &'a dyn Renderer,
    options: &'a RenderOptions,
    progress: &dyn Progress,
) -> Result<Stage<'a>, RenderError> {
    if images.near_far.is_none() && !images.has_silhouettes {
        let tiny = Arc::new(reduced(&images, RANGE_SIDE, scene)?);
        let scout = Stage::of_images(scene, album, sources, tiny, renderer, options, progress)?;
        let Surfaces { points, near_far } = scout.surfaces();
        (images.points, images.near_far) = (points, near_far);
    }
    let mut stage = Stage::of_images(scene, album, sources, Arc::new(images), renderer, options, progress)?;
    stage.reduce(Purpose::Preview)?;
    Ok(stage)
}
