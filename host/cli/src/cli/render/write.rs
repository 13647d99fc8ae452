//! The pictures of a render, in a folder with their record and videos.

use super::Arguments;
use super::identity::run_identity;
use super::prepare::Prepared;
use super::summary::print;
use crate::cli::printing::say;
use crate::cli::terminal::Terminal;
use crate::cli::threads::on_threads;
use viewfuse_field::auto::{self, Chosen};
use viewfuse_field::render::Frame;
use viewfuse_job::progress::Part;
use viewfuse_output::record::RunRecord;
use viewfuse_output::run::{Circumstances, RunWriter};
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::Weighting;

pub(super) fn to_folder(arguments: &Arguments, mut prepared: Prepared, progress: Terminal) -> anyhow::Result<()> {
    let before = prepared.weighting.clone().unwrap_or_else(Weighting::default_scheme);
    let label = prepared.folder.display().to_string();
    let mut writer = RunWriter::new(&arguments.output, &prepared.scene, label, &prepared.job, &before);
    writer.lock()?;
    writer.outputs = arguments.outputs.outputs();
    writer.make_videos(&prepared.videos, prepared.rate);
    writer.earlier = std::mem::take(&mut prepared.earlier);
    if let Some(settings) = &prepared.settings {
        let finished = writer.resume(&run_identity(settings, &prepared.job.targets)?)?;
        prepared.job.targets.retain(|target| !finished.contains(&target.name));
    }
    let written = || written(arguments, &prepared, writer, &progress);
    let (record, videos) = on_threads(arguments.picture.threads, written)??;
    drop(progress);
    print(&record, &arguments.output)?;
    videos.iter().try_for_each(say)?;
    Ok(())
}

/// The record of a run whose pictures and videos are written, and the names of the videos.
fn written(
    arguments: &Arguments,
    prepared: &Prepared,
    mut writer: RunWriter,
    progress: &Terminal,
) -> anyhow::Result<(RunRecord, Vec<String>)> {
    let renderer = prepared.field.on(&prepared.device.device);
    // Of videos only their end is left after the last frame.
    let frames = prepared.job.targets.len().max(1);
    let parts = frames + prepared.videos.len();
    let part = Part::begin(progress, "", 0..frames, parts);
    let write = |sources: &SourceImages, frame: Frame, chosen: Option<&Chosen>| {
        chosen.into_iter().for_each(|chosen| writer.set_chosen(chosen));
        anyhow::Ok(writer.write(sources, frame)?)
    };
    let run = prepared.run(renderer.as_ref(), &part);
    let (finished, _) = auto::render(&run, prepared.weighting.as_ref(), write)?;
    let videos = writer.finish_videos(&Part::begin(progress, "", frames..parts, parts))?;
    let videos = videos.iter().map(|path| path.display().to_string()).collect();
    progress.told().into_iter().for_each(|warning| writer.warn(warning));
    let circumstances = Circumstances {
        program: env!("CARGO_PKG_VERSION"),
        device_reason: prepared.device.reason.clone(),
        model: arguments.model.network.label(),
        exact: arguments.model.exact,
        settings: prepared.settings.clone(),
        seed: arguments.seed,
        open_time: prepared.open_time,
        total_time: prepared.start.elapsed(),
    };
    Ok((writer.finish(renderer.as_ref(), &prepared.options, finished, circumstances)?, videos))
}
