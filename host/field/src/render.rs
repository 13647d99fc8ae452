//! The render loop, from a scene to pictures.
//!
//! ```text
//! options   the options, and the sizes that follow from them
//! stage     sources on a device, from which targets are rendered
//! frame     the result
//! seen      how many photographs show what it shows
//! compared  the weights of fields that compare views
//! most_views  the weight of sources that are more than a field uses
//! error     errors
//! ```

mod compared;
mod error;
mod frame;
mod most_views;
mod options;
mod seen;
mod stage;

pub use error::RenderError;
pub use frame::{Frame, Truth};
pub use options::{
    DEFAULT_EARLY_TERMINATION, DEFAULT_LEAVE_OUT, RenderOptions, open_album, picture_size, working_side,
};
pub use seen::Seen;
pub(crate) use stage::SceneSources;
pub use stage::{Stage, StageCosts};

use crate::{Record, Renderer};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_job::text::listed;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::Weighting;

/// A run of the render loop: what it reads, and what renders.
#[derive(Clone, Copy)]
pub struct RenderRun<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The sources and the targets.
    pub job: &'a FewShot,
    /// The field, on its device.
    pub renderer: &'a dyn Renderer,
    /// Size, background, and what is omitted.
    pub options: &'a RenderOptions,
    /// Reports, and whether the run is to stop.
    pub progress: &'a dyn Progress,
}

/// The summary of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// The times of the stages that the frames share.
    pub costs: StageCosts,
    /// The record of the field's work.
    pub record: Record,
}

/// Renders every target view of a run and passes each frame to `deliver` as soon as it is done.
///
/// # Errors
/// [`RenderError`]; those of `deliver` pass through.
pub fn render<X: From<RenderError>>(
    run: &RenderRun<'_>,
    weighting: &Weighting,
    mut deliver: impl FnMut(&SourceImages, Frame) -> Result<(), X>,
) -> Result<Finished, X> {
    let given = |_: &mut Stage<'_>| Ok((weighting.clone(), ()));
    let deliver = |images: &SourceImages, frame: Frame, (): &()| deliver(images, frame);
    Ok(render_chosen(run, given, deliver)?.0)
}

/// The render loop. `choose` sees the prepared sources and returns the weighting with what `deliver` gets beside each
/// frame.
pub(crate) fn render_chosen<C, X: From<RenderError>>(
    run: &RenderRun<'_>,
    choose: impl FnOnce(&mut Stage<'_>) -> Result<(Weighting, C), RenderError>,
    mut deliver: impl FnMut(&SourceImages, Frame, &C) -> Result<(), X>,
) -> Result<(Finished, C), X> {
    let RenderRun { scene, job, renderer, options, progress } = *run;
    let truths = job.targets.iter().filter_map(|target| target.truth);
    let shown = job.sources.iter().copied().chain(truths);
    let (count, stage_count) = (job.targets.len(), 3 + job.targets.len());
    progress.stage("reading the sources", 0..1, stage_count);
    let away = viewfuse_scene::few_shot::away_warning(scene, job);
    job.warning.iter().chain(&away).for_each(|warning| progress.warn(warning));
    let album = open_album(scene, shown, renderer, options, progress)?;
    let mut stage = Stage::prepare(scene, &album, &job.sources, renderer, options, progress)?;
    other_sizes(&stage, job, options)?.iter().for_each(|warning| progress.warn(warning));
    progress.stage("choosing the scheme", 1..2, stage_count);
    let (weighting, chosen) = choose(&mut stage)?;
    progress.stage("encoding the sources", 2..3, stage_count);
    stage.weigh(&weighting, progress)?;
    for (index, target) in job.targets.iter().enumerate() {
        progress.stage(&format!("view {} of {count}", index + 1), 3 + index..4 + index, stage_count);
        let frame = stage.frame(&weighting, target, progress)?;
        deliver(&stage.images, frame, &chosen)?;
    }
    Ok((Finished { costs: stage.costs, record: stage.record() }, chosen))
}

/// What is said of targets whose pictures do not get the size that was asked for, because they have another shape.
fn other_sizes(stage: &Stage<'_>, job: &FewShot, options: &RenderOptions) -> Result<Option<String>, RenderError> {
    let Some([width, height]) = options.size else { return Ok(None) };
    let mut other = Vec::new();
    for target in &job.targets {
        let [own_width, own_height] = stage.size_at(&target.camera)?;
        if [own_width, own_height] != [width, height] {
            other.push(format!("'{}' {own_width}x{own_height}", target.name));
        }
    }
    Ok((!other.is_empty()).then(|| {
        let (count, all, shown) = (other.len(), job.targets.len(), listed(&other, 3));
        format!("{count} of {all} targets have another shape than {width}x{height}, and keep it: {shown}")
    }))
}

/// As [`render`] without progress reports: returns the frames of all target views, which stay in memory.
///
/// # Errors
/// [`RenderError`].
pub fn render_all(
    scene: &Scene,
    job: &FewShot,
    weighting: &Weighting,
    renderer: &dyn Renderer,
    options: &RenderOptions,
) -> Result<Vec<Frame>, RenderError> {
    let mut frames = Vec::with_capacity(job.targets.len());
    let run = RenderRun { scene, job, renderer, options, progress: &Silent };
    render(&run, weighting, |_sources, frame| {
        frames.push(frame);
        Ok::<(), RenderError>(())
    })?;
    Ok(frames)
}
