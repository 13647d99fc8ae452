//! A field from sources to a picture, and what it left out on the way.

use std::sync::Arc;
use viewfuse::device::Device;
use viewfuse::field::render::{RenderOptions, Stage};
use viewfuse::field::{Field, FieldError, LeftOut, On, Record, Rendered};
use viewfuse::job::progress::Progress;
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::sources::SourceWeights;
use viewfuse_core::camera::Camera;

/// One target on a device, from sources that nothing is known of, and the field's record of it.
///
/// # Errors
/// The field's.
pub fn picture<D: Device + Sync, F: Field + Sync>(
    device: &D,
    field: &F,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
    early_termination: f32,
    progress: &dyn Progress,
) -> Result<(Rendered, Record), FieldError> {
    let renderer = On { device, field };
    let options = RenderOptions::default();
    let mut stage = Stage::of_sources(Arc::new(sources.clone()), &renderer, &options, progress)?;
    stage.weigh_by(&[], progress)?;
    let picture = stage.picture(target, weights, early_termination, progress)?;
    Ok((picture, stage.record()))
}

/// What a record says of something that may be left out.
///
/// # Panics
/// If it says nothing.
#[track_caller]
pub fn line(record: &Record, what: &str) -> LeftOut {
    *record.left_out.iter().find(|line| line.what == what).unwrap_or_else(|| panic!("no line '{what}'"))
}
