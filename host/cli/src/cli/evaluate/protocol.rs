//! `viewfuse evaluate --protocol`.

use super::super::terminal::Terminal;
use super::Arguments;
use super::tables::{csv_of, print_table};
use crate::cli::metrics_options::MetricOptions;
use crate::cli::{on_threads, say};
use anyhow::Context;
use clap::Args;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_evaluate::Evaluator;
use viewfuse_evaluate::gallery::Gallery;
use viewfuse_evaluate::protocol::{Draws, Job, Plan, Protocol};
use viewfuse_evaluate::run_folder::{
    Finished, FolderError, RunFolder, SETTINGS, SceneSettings, Settings, Shard, missing,
};
use viewfuse_evaluate::summary::tables;
use viewfuse_field::AnyField;
use viewfuse_field::render::RenderOptions;
use viewfuse_job::digest::sha256_of;
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::Album;
use viewfuse_weighting::Weighting;

const PROTOCOLS: &str = "Options of protocols";
/// Options that change no number, or that the settings have in another form.
const NO_SETTINGS: [&str; 7] = ["output", "shard", "threads", "pictures", "time-limit", "weights", "protocol"];
/// The most missing jobs and notes in a message.
const NAMED: usize = 8;

#[derive(Args)]
pub(crate) struct ProtocolOptions {
    /// Choose sources and targets by a protocol: random[:sources=N] (3), close[:sources=N,degrees=D] (5 sources,
    /// exactly one within 10 degrees of the target), count[:sources=N+N+...] (2+8+16+32),
    /// fixed[:cars|chairs|pixelnerf-1|pixelnerf-2] (published lists) or fixed:SOURCES:TARGETS
    #[arg(long, value_name = "PROTOCOL", requires = "output", conflicts_with_all = ["targets", "sources", "views"], help_heading = PROTOCOLS)]
    pub(super) protocol: Option<Protocol>,
    /// Number of trials: draws of sources and targets for every scene
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000), help_heading = PROTOCOLS)]
    trials: u32,
    /// Targets of a trial
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=10_000), help_heading = PROTOCOLS)]
    targets_per_trial: u16,
    /// Run only part INDEX of COUNT, counted from 0: every COUNT-th job
    #[arg(long, value_name = "INDEX/COUNT", requires = "protocol", help_heading = PROTOCOLS)]
    shard: Option<Shard>,
    /// Keep the pictures of the first N jobs for the report
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = PROTOCOLS)]
    pictures: usize,
}

pub(super) fn run(
    arguments: &Arguments,
    protocol: &Protocol,
    folder: &Path,
    weightings: &[Weighting],
    mut options: BTreeMap<String, String>,
) -> anyhow::Result<ExitCode> {
    check_writable(&folder.join(SETTINGS))?;
    let field = arguments.model.open(arguments.seed, None)?;
    let render_options = arguments.picture.to_render_options(arguments.model.exact, &field.about())?;
    let scenes: Vec<Scene> = arguments.paths()?.iter().map(Scene::open).collect::<Result<_, _>>()?;
    let draws = Draws {
        seed: arguments.seed,
        trial_count: arguments.protocol.trials,
        target_count: arguments.protocol.targets_per_trial.into(),
    };
    let plan = protocol.plan(&scenes, draws, field.about().least_sources)?;
    NO_SETTINGS.iter().for_each(|option| {
        options.remove(*option);
    });
    let mut files = BTreeMap::new();
    let networks = arguments.model.file().into_iter().chain(arguments.metrics.files());
    for path in networks.chain(weightings.iter().filter_map(Weighting::file)) {
        let digest = sha256_of(path).with_context(|| path.display().to_string())?;
        files.insert(path.display().to_string(), digest);
    }
    let settings = Settings {
        viewfuse: env!("CARGO_PKG_VERSION").to_owned(),
        protocol: protocol.to_string(),
        schemes: weightings.iter().map(Weighting::to_string).collect(),
        field: field.about().name.to_owned(),
        options,
        files,
        job_count: plan.jobs.len(),
        notes: plan.notes.clone(),
        scenes: scenes.iter().map(SceneSettings::of).collect(),
    };
    let Chosen { device, reason } = arguments.device.open()?;
    let shard = arguments.protocol.shard.unwrap_or(Shard::ALL);

    let progress = Terminal::new("evaluating");
    let work = Jobs {
        path: folder,
        settings: &settings,
        scenes: &scenes,
        plan: &plan,
        shard,
        picture_count: arguments.protocol.pictures,
        weightings,
        options: &render_options,
        metrics: &arguments.metrics,
        progress: &progress,
    };
    let (folder, done) = on_threads(arguments.picture.threads, || work.run(&device, &field))??;
    drop(progress);
    plan.notes.iter().take(NAMED).try_for_each(|note| say(format_args!("note: {note}")))?;
    if plan.notes.len() > NAMED {
        say(format_args!("and {} more notes, all in {SETTINGS}", plan.notes.len() - NAMED))?;
    }
    let finished = folder.finished()?;
    let missing = missing(plan.jobs.len(), &finished);
    if missing.is_empty() {
        let by_count = matches!(protocol, Protocol::Count { .. });
        for table in tables(finished.values(), by_count) {
            print_table(&protocol.to_string(), &table)?;
        }
        let first = |job: &Finished| vec![job.job.to_string(), job.scene_name.clone(), job.trial.to_string()];
        let lines = finished.values().flat_map(|job| job.scores.iter().map(move |score| (first(job), score)));
        let csv = csv_of(&["job", "scene", "trial"], &lines.collect::<Vec<_>>())?;
        write_whole(&folder.path().join("scores.csv"), &csv)?;
    }
    let (there, all) = (finished.len(), plan.jobs.len());
    let part = if shard == Shard::ALL { String::new() } else { format!("shard {shard}: ") };
    say(format_args!("{part}{done} jobs done; {there} of {all} are in {}", folder.path().display()))?;
    if !missing.is_empty() {
        let named: Vec<String> = missing.iter().take(NAMED).map(usize::to_string).collect();
        let more = missing.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        say(format_args!("missing: {}{more}; the tables are printed after the last of them", named.join(", ")))?;
    }
    say(format_args!("device: {}, {reason}", device.name()))?;
    Ok(ExitCode::SUCCESS)
}

/// The jobs of a shard that are not finished.
struct Jobs<'a> {
    path: &'a Path,
    settings: &'a Settings,
    scenes: &'a [Scene],
    plan: &'a Plan,
    shard: Shard,
    picture_count: usize,
    weightings: &'a [Weighting],
    options: &'a RenderOptions,
    metrics: &'a MetricOptions,
    progress: &'a dyn Progress,
}

impl Jobs<'_> {
    /// Returns the folder, and how many were done.
    fn run(&self, device: &AnyDevice, field: &AnyField) -> anyhow::Result<(RunFolder, usize)> {
        let Jobs { path, settings, scenes, plan, shard, weightings, options, metrics, progress, .. } = *self;
        let (renderer, scorer) = (field.on(device), metrics.on(device)?);
        // Only after all arguments are checked: a folder keeps its settings.
        let folder = RunFolder::begin(path, settings.clone())?;
        let mut journal = folder.journal(shard)?;
        let finished = folder.finished()?;
        for (number, done) in &finished {
            self.check(*number, done)?;
        }
        let (renderer, scorer) = (renderer.as_ref(), scorer.as_ref());
        let evaluator = Evaluator { weightings, renderer, options, scorer, progress };
        let mut count = 0;
        for (number, job) in plan.jobs.iter().enumerate() {
            if !shard.does(number) || finished.contains_key(&number) {
                continue;
            }
            progress.check()?;
            let scene = &scenes[job.scene];
            let sources = names(scene, &job.sources);
            let album = Album::open(scene, job.sources.iter().chain(&job.targets).copied(), progress)?;
            let mut gallery = Gallery::default();
            let first = job.targets.first().map_or("", |&target| &scene.views[target].name);
            let scores =
                evaluator.score(scene, &album, &job.sources, &job.targets, |weighting, frame, values, images| {
                    if number < self.picture_count && frame.target.name == first {
                        gallery.add(weighting, frame, values, images);
                    }
                })?;
            // Before the line that says that the job is done: it is not done again.
            gallery.write(folder.path(), number, &scene.name(), first, &sources)?;
            let (trial, device) = (job.trial, device.name());
            journal.add(&Finished {
                job: number,
                scene: job.scene,
                scene_name: scene.name(),
                trial,
                device,
                sources,
                scores,
            })?;
            count += 1;
        }
        Ok((folder, count))
    }
}

impl Jobs<'_> {
    /// A finished job must be the one that would be done now.
    fn check(&self, number: usize, done: &Finished) -> Result<(), FolderError> {
        let same = |job: &Job| done.scene == job.scene && done.sources == names(&self.scenes[job.scene], &job.sources);
        match self.plan.jobs.get(number) {
            Some(job) if same(job) => Ok(()),
            _ => Err(FolderError::OtherJob { path: self.path.to_path_buf(), job: number }),
        }
    }
}

fn names(scene: &Scene, views: &[usize]) -> Vec<String> {
    views.iter().map(|&view| scene.views[view].name.clone()).collect()
}
