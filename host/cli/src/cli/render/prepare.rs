//! What a render needs before its first picture: everything that can be refused is refused here.

use super::Arguments;
use super::identity::settings;
use crate::cli::outputs::{keep_folder_apart, refuse_file};
use crate::cli::printing::warn_of;
use crate::cli::terminal::Terminal;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use viewfuse_device::choice::Chosen;
use viewfuse_field::render::{RenderOptions, RenderRun, picture_size};
use viewfuse_field::{AnyField, Renderer};
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::Progress;
use viewfuse_output::folder::{Planned, check_folder};
use viewfuse_output::rate::FrameRate;
use viewfuse_output::record::{FrameRecord, RECORD, view_names};
use viewfuse_output::video::VideoFormat;
use viewfuse_scene::Scene;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::{FewShot, Selection, Target};
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
    /// The formats in which the pictures are written as a video.
    pub(super) videos: Vec<VideoFormat>,
    pub(super) device: Chosen,
    /// See [`settings`].
    pub(super) settings: Option<String>,
    /// Frames of an earlier run that it adds to.
    pub(super) earlier: Vec<FrameRecord>,
}

/// Refuses targets whose pictures are no frames of one video.
fn check_sizes(scene: &Scene, options: &RenderOptions, longest: u32, targets: &[Target]) -> anyhow::Result<()> {
    let mut first = None;
    for Target { name, camera, .. } in targets {
        let size = picture_size(scene, options, longest, camera)?;
        let (first_name, first) = *first.get_or_insert((name, size));
        anyhow::ensure!(
            size == first,
            "the frames of a video have one size: that of {first_name} has {}x{} pixels, that of {name} {}x{}; name \
             targets of one size",
            first[0],
            first[1],
            size[0],
            size[1]
        );
    }
    Ok(())
}

impl Prepared {
    /// `values` are all options and their values.
    pub(super) fn open(arguments: &Arguments, values: &BTreeMap<String, String>) -> anyhow::Result<Prepared> {
        let start = Instant::now();
        match arguments.is_stream() {
            true => arguments.outputs.check_stream()?,
            false => refuse_file(&arguments.output)?,
        }
        let weighting = arguments.weighting()?;
        // Finding poses takes minutes: what can be refused without them is.
        let device = arguments.device.open()?;
        let (folder, scene) = arguments.pose.open(&arguments.scene, &arguments.picture.masks)?;
        if !arguments.is_stream() {
            keep_folder_apart([&scene], &arguments.output)?;
        }
        warn_of(&scene);
        let open_time = start.elapsed();
        let field = arguments.field(&scene)?;
        let about = field.about();
        arguments.outputs.check(&about)?;
        let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.path.choice());
        let selection = Selection { may_share: arguments.gaussians.is_some(), ..selection };
        let job = selection.resolve(&scene, about.least_sources)?;
        let options =
            arguments.omissions.omitting(arguments.picture.to_render_options(), arguments.model.exact, &about)?;
        let options = arguments.bound.bounded(
            options,
            &about,
            arguments.model.says_omissions() || !arguments.sequence.is_empty(),
        );
        let options = RenderOptions { is_rounded: !arguments.outputs.outputs().alpha, ..options };
        let is_moving = arguments.is_stream() || !arguments.outputs.video.is_empty();
        let rate = arguments.outputs.rate(job.frames_per_second.filter(|_| is_moving))?;
        if is_moving {
            check_sizes(&scene, &options, about.longest_side, &job.targets)?;
        }
        let videos = arguments.outputs.video_formats(&arguments.output);
        let (mut identity, mut earlier) = (None, Vec::new());
        if !arguments.is_stream() {
            check_writable(&arguments.output.join(RECORD))?;
            // Frames that follow from one another are neither continued nor added to.
            if arguments.sequence.is_empty() {
                let files = arguments.files().chain(weighting.as_ref().and_then(Weighting::file));
                let files: Vec<&Path> = files.collect();
                identity = Some(settings(values, &device.device.name(), &scene, &job.sources, &files)?);
            }
            let planned = Planned {
                targets: &job.targets,
                sources: &view_names(&scene, &job.sources),
                videos: &videos,
                settings: identity.as_deref(),
                frame: &scene.frame,
                replaces: arguments.outputs.replace,
            };
            earlier = check_folder(&arguments.output, &planned)?;
        }
        let settings = identity;
        Ok(Prepared {
            start,
            weighting,
            folder,
            scene,
            open_time,
            job,
            field,
            options,
            rate,
            videos,
            device,
            settings,
            earlier,
        })
    }

    /// The run of the whole job.
    pub(super) fn run<'a>(&'a self, renderer: &'a dyn Renderer, progress: &'a dyn Progress) -> RenderRun<'a> {
        RenderRun { scene: &self.scene, job: &self.job, renderer, options: &self.options, progress }
    }

    /// Says where an orbit ends, and warns if cameras without a photograph leave what the sources show. Not with a
    /// network, which is there to guess what they do not.
    pub(super) fn warn_of_leaving(&self, arguments: &Arguments, progress: &Terminal) {
        let cameras = self.job.source_cameras(&self.scene);
        progress.aside(|| arguments.path.tell_arc(&cameras));
        let new = self.job.targets.iter().filter(|target| target.truth.is_none());
        let pictures = new.map(|target| (target.name.as_str(), &target.camera));
        let is_learned = arguments.model.network.label().is_some();
        let warning = if is_learned { None } else { Coverage::of(&cameras).warning(pictures) };
        warning.iter().for_each(|warning| progress.warn(warning));
    }
}
