//! What a render needs before its first picture: everything that can be refused is refused here.

use super::Arguments;
use crate::cli::outputs::{keep_folder_apart, refuse_file};
use crate::cli::printing::warn_of;
use crate::cli::terminal::Terminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use viewfuse_device::choice::Chosen;
use viewfuse_field::render::{RenderOptions, RenderRun};
use viewfuse_field::{AnyField, Renderer};
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::Progress;
use viewfuse_output::folder::check_folder;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::record::RECORD;
use viewfuse_scene::Scene;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_weighting::Weighting;

/// The inputs of a run, opened and checked.
pub(super) struct Prepared {
    /// When the command began.
    pub(super) start: Instant,
    /// `None` where the scene is to decide.
    pub(super) weighting: Option<Weighting>,
    /// Where the scene was opened.
    pub(super) folder: PathBuf,
    pub(super) scene: Scene,
    /// How long it took to open.
    pub(super) open_time: Duration,
    pub(super) job: FewShot,
    pub(super) field: AnyField,
    pub(super) options: RenderOptions,
    /// Of a video.
    pub(super) rate: FrameRate,
    pub(super) device: Chosen,
}

impl Prepared {
    pub(super) fn open(arguments: &Arguments) -> anyhow::Result<Prepared> {
        let start = Instant::now();
        if !arguments.is_stream() {
            refuse_file(&arguments.output)?;
        }
        let weighting = arguments.weighting()?;
        let (folder, scene) = arguments.pose.open(&arguments.scene, &arguments.picture.masks)?;
        warn_of(&scene);
        if !arguments.is_stream() {
            keep_folder_apart([&scene], &arguments.output)?;
        }
        let open_time = start.elapsed();
        let field = arguments.field(&scene)?;
        let about = field.about();
        let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.path.choice());
        let job = selection.resolve(&scene, about.least_sources)?;
        let options = arguments.picture.to_render_options(arguments.model.exact, &about)?;
        let options = arguments.bound.bounded(
            options,
            &about,
            arguments.model.says_omissions() || !arguments.sequence.is_empty(),
        );
        let rate = arguments.outputs.rate(job.frames_per_second);
        if !arguments.is_stream() {
            check_writable(&arguments.output.join(RECORD))?;
            check_folder(&arguments.output, &job.targets, &arguments.outputs.video, arguments.outputs.replace)?;
        }
        let device = arguments.device.open()?;
        Ok(Prepared { start, weighting, folder, scene, open_time, job, field, options, rate, device })
    }

    /// The run of the whole job.
    pub(super) fn run<'a>(&'a self, renderer: &'a dyn Renderer, progress: &'a dyn Progress) -> RenderRun<'a> {
        RenderRun { scene: &self.scene, job: &self.job, renderer, options: &self.options, progress }
    }

    /// Says where an orbit ends, and warns if cameras without a photograph leave what the sources show. Not with a
    /// network, which is there to guess what they do not.
    pub(super) fn leaving(&self, arguments: &Arguments, progress: &Terminal) -> Option<String> {
        let cameras = self.job.source_cameras(&self.scene);
        progress.aside(|| arguments.path.tell_arc(&cameras));
        let new = self.job.targets.iter().filter(|target| target.truth.is_none());
        let pictures = new.map(|target| (target.name.as_str(), &target.camera));
        let is_learned = arguments.model.label().is_some();
        let warning = if is_learned { None } else { Coverage::of(&cameras).warning(pictures) };
        warning.iter().for_each(|warning| progress.warn(warning));
        warning
    }
}
