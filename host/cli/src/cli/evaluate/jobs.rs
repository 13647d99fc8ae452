//! The jobs of a protocol, one after the other, with or without a folder that keeps them.

use crate::cli::metrics_options::MetricOptions;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use viewfuse_device::choice::AnyDevice;
use viewfuse_evaluate::gallery::Gallery;
use viewfuse_evaluate::protocol::{Job, Plan, Protocol};
use viewfuse_evaluate::run_folder::{Finished, FolderError, RunFolder, Settings, Shard};
use viewfuse_evaluate::{Evaluator, Subject};
use viewfuse_field::AnyField;
use viewfuse_field::render::{RenderOptions, open_album};
use viewfuse_job::progress::{Part, Progress};
use viewfuse_output::record::view_names;
use viewfuse_scene::{Scene, SceneError};
use viewfuse_weighting::OpenedChoice;

/// The jobs of a shard that are not finished.
pub(super) struct Jobs<'a> {
    /// Where finished jobs are kept, if anywhere.
    pub(super) path: Option<&'a Path>,
    pub(super) settings: &'a Settings,
    pub(super) protocol: &'a Protocol,
    /// As they were opened, with masks.
    pub(super) scenes: &'a [Scene],
    pub(super) plan: &'a Plan,
    pub(super) shard: Shard,
    pub(super) picture_count: usize,
    pub(super) weightings: &'a [OpenedChoice],
    /// One a scene.
    pub(super) options: &'a [RenderOptions],
    pub(super) metrics: &'a MetricOptions,
    pub(super) progress: &'a dyn Progress,
}

/// A scene under a protocol.
struct Shown {
    /// What fields may see of it.
    scene: Scene,
    /// That by whose masks pictures are scored, if they are.
    masked: Option<Scene>,
}

impl Jobs<'_> {
    /// Returns all finished jobs by number, those of other shards included, and how many were done here.
    pub(super) fn run(
        &self,
        device: &AnyDevice,
        field: &AnyField,
    ) -> anyhow::Result<(BTreeMap<usize, Finished>, usize)> {
        let Jobs { scenes, plan, shard, weightings, metrics, progress, .. } = *self;
        let (renderer, scorer) = (field.on(device), metrics.on(device)?);
        // Only now, that nothing which a person gave can be wrong: a folder keeps its settings.
        let folder = self.path.map(|path| RunFolder::begin(path, self.settings.clone())).transpose()?;
        let mut journal = folder.as_ref().map(|folder| folder.journal(shard)).transpose()?;
        let mut finished = folder.as_ref().map_or_else(|| Ok(BTreeMap::new()), RunFolder::finished)?;
        let settings = self.settings.digest();
        for (number, done) in &finished {
            self.check(*number, done)?;
        }
        // From when they are first needed: photographs are read for them.
        let mut shown: BTreeMap<usize, Shown> = BTreeMap::new();
        let (renderer, scorer) = (renderer.as_ref(), scorer.as_ref());
        let is_open = |number: &usize| shard.does(*number) && !finished.contains_key(number);
        let open: Vec<usize> = (0..plan.jobs.len()).filter(is_open).collect();
        for (index, &number) in open.iter().enumerate() {
            let job = &plan.jobs[number];
            progress.check()?;
            let options = &self.options[job.scene];
            let name = format!("job {} of {}, {}", index + 1, open.len(), scenes[job.scene].name());
            let progress = &Part::begin(progress, name, index..index + 1, open.len());
            if let Entry::Vacant(place) = shown.entry(job.scene) {
                place.insert(self.shown(&scenes[job.scene])?);
            }
            let Shown { scene, masked } = &shown[&job.scene];
            let sources = view_names(scene, &job.sources);
            let views = job.sources.iter().chain(&job.targets).copied();
            progress.stage("reading photographs", 0..1, 10);
            let album = open_album(scene, views, renderer, options, progress)?;
            let progress = &Part::begin(progress, "", 1..10, 10);
            let evaluator = Evaluator { weightings, renderer, options, scorer, progress };
            let mut gallery = Gallery::default();
            let first = job.targets.first().map_or("", |&target| &scene.views[target].name);
            let scores = evaluator.score(
                Subject { scene, album: &album, masked: masked.as_ref() },
                &job.sources,
                &job.targets,
                |scheme, frame, values, images| {
                    if folder.is_some() && number < self.picture_count && frame.target.name == first {
                        gallery.add(scheme, frame, values, images);
                    }
                },
            )?;
            let done = Finished {
                job: number,
                scene: job.scene,
                scene_name: scene.name(),
                trial: job.trial,
                device: device.name(),
                settings: settings.clone(),
                sources,
                scores,
            };
            if let (Some(folder), Some(journal)) = (&folder, &mut journal) {
                // Before the line that says that the job is done: it is not done again.
                gallery.write(folder.path(), &done, first)?;
                journal.add(&done)?;
            }
            finished.insert(number, done);
        }
        // Other shards may have added some.
        Ok((folder.map_or(Ok(finished), |folder| folder.finished())?, open.len()))
    }

    fn shown(&self, scene: &Scene) -> Result<Shown, SceneError> {
        let masked = self.protocol.is_masked().then(|| scene.with_silhouettes()).transpose()?;
        let scene = if self.protocol.hides_masks() { scene.without_silhouettes()? } else { scene.clone() };
        Ok(Shown { scene, masked })
    }

    /// A finished job must be the one that would be done now.
    fn check(&self, number: usize, done: &Finished) -> Result<(), FolderError> {
        let path = || self.path.unwrap_or(Path::new("")).to_path_buf();
        let same =
            |job: &Job| done.scene == job.scene && done.sources == view_names(&self.scenes[job.scene], &job.sources);
        match self.plan.jobs.get(number) {
            Some(job) if same(job) => Ok(()),
            _ => Err(FolderError::OtherJob { path: path(), job: number }),
        }
    }
}
