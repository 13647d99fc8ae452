//! The record of a picture, for the page to save beside it: the keys are those of `run.json`, without those that only a
//! whole run has.

use crate::Viewed;
use serde::Serialize;
use viewfuse_field::auto::Chosen;
use viewfuse_field::render::Frame;
use viewfuse_output::record::{BackgroundRecord, ChosenRecord, DepthUnits, FrameRecord, background_record, view_names};
use viewfuse_scene::coverage::Coverage;

/// What the page writes as `run.json`.
#[derive(Debug, Serialize)]
pub(crate) struct PictureRecord {
    viewfuse: &'static str,
    scene: String,
    device: String,
    field: &'static str,
    weighting: String,
    chosen: Option<ChosenRecord>,
    size: [u32; 2],
    background: BackgroundRecord,
    leave_out: f32,
    early_termination: f32,
    sources: Vec<String>,
    depth_units: DepthUnits,
    frames: [FrameRecord; 1],
}

impl PictureRecord {
    /// Of a full picture. `background` is the one that was used.
    pub(crate) fn of(
        frame: &Frame,
        viewed: &Viewed<'_>,
        coverage: &Coverage,
        device: &str,
        weighting: String,
        chosen: Option<&Chosen>,
        background: [f32; 3],
    ) -> PictureRecord {
        let Viewed { scene, sources, field, options, .. } = *viewed;
        let sources = view_names(scene, sources);
        PictureRecord {
            viewfuse: env!("CARGO_PKG_VERSION"),
            scene: scene.path.display().to_string(),
            device: device.to_owned(),
            field: field.about().name,
            weighting,
            chosen: chosen.cloned().map(ChosenRecord::from),
            size: [frame.picture.width(), frame.picture.height()],
            background: background_record(options, background),
            leave_out: options.leave_out,
            early_termination: options.early_termination,
            depth_units: DepthUnits::ALL,
            frames: [FrameRecord::of(frame, &sources, coverage, &scene.frame).expecting(chosen, frame)],
            sources,
        }
    }
}
