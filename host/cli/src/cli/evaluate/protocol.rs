//! `viewfuse evaluate --protocol`.

use super::super::terminal::Terminal;
use super::files::{csv_of, json_of};
use super::jobs::Jobs;
use super::tables::{print_published, print_table};
use super::{Arguments, refuse_same_photographs};
use crate::cli::outputs::{keep_folder_apart, keep_others_than};
use crate::cli::printing::{counted, say, warn_of};
use crate::cli::threads::on_threads;
use crate::cli::wrong::wrong;
use anyhow::Context;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use viewfuse_device::choice::Chosen;
use viewfuse_evaluate::EvaluateError;
use viewfuse_evaluate::metrics::masked::PSNR_MASKED;
use viewfuse_evaluate::protocol::{Draws, Job, Plan, Protocol, Published};
use viewfuse_evaluate::run_folder::{Finished, SETTINGS, SceneSettings, Settings, Shard, missing};
use viewfuse_evaluate::summary::{Table, tables};
use viewfuse_field::render::{RenderError, RenderOptions, working_side};
use viewfuse_job::digest::sha256_of;
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_output::record::view_names;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::reduced_size;
use viewfuse_weighting::OpenedChoice;

const PROTOCOLS: &str = "Options of protocols";
const DEFAULT_TARGETS: u16 = 4;
/// The table of all scores, and how it begins.
const SCORES: &str = "scores.csv";
const SCORES_BEGIN: &str = "job,scene,trial,";
/// Options that change no number, or that the settings hold in another form.
const NO_SETTINGS: &str =
    "output shard threads device cache pictures time-limit weights protocol targets json latex verbose";
/// Missing jobs and notes that are told; of more, how many there are.
const NAMED: usize = 8;

#[derive(Args)]
pub(crate) struct ProtocolOptions {
    /// Choose sources and targets by a protocol: random[:sources=N] (3), close[:sources=N,degrees=D] (5 sources,
    /// exactly one within 10 degrees of the target), count[:sources=N+N+...] (2+8+16+32),
    /// fixed[:cars|chairs|pixelnerf-1|pixelnerf-2] (published lists) or fixed:SOURCES:TARGETS, nearest:K (each view, or
    /// each of --targets, from the K nearest others), or a benchmark's views, size and metric: llff:3|6|9,
    /// dtu:3|6|9[,masks=given], blender:8
    #[arg(long, value_name = "PROTOCOL", conflicts_with_all = ["sources", "views"], help_heading = PROTOCOLS)]
    pub(super) protocol: Option<Protocol>,
    /// Draw sources and targets this many times for every scene
    #[arg(long, value_name = "N", default_value_t = 1, requires = "protocol",
        value_parser = clap::value_parser!(u32).range(1..=100_000), help_heading = PROTOCOLS)]
    trials: u32,
    /// Targets of a trial
    #[arg(long, value_name = "N", default_value_t = DEFAULT_TARGETS, requires = "protocol",
        value_parser = clap::value_parser!(u16).range(1..=10_000), help_heading = PROTOCOLS)]
    targets_per_trial: u16,
    /// Do only part INDEX of COUNT, counted from 0: every COUNT-th job
    #[arg(long, value_name = "INDEX/COUNT", requires_all = ["protocol", "output"], help_heading = PROTOCOLS)]
    shard: Option<Shard>,
    /// Keep the pictures of this many jobs, the first ones, for the report
    #[arg(long, value_name = "N", default_value_t = 4, requires = "protocol", help_heading = PROTOCOLS)]
    pictures: usize,
}

pub(super) fn run(
    arguments: &Arguments,
    protocol: &Protocol,
    weightings: &[OpenedChoice],
    mut options: BTreeMap<String, String>,
) -> anyhow::Result<ExitCode> {
    let protocol = &with_targets(protocol, arguments.targets.as_deref())?;
    let ProtocolOptions { trials, targets_per_trial, .. } = arguments.protocol;
    let drawn = [("--trials", trials != 1), ("--targets-per-trial", targets_per_trial != DEFAULT_TARGETS)];
    if let Some((option, _)) = drawn.iter().find(|(_, is_given)| *is_given && !protocol.draws()) {
        return Err(wrong(format_args!(
            "{option}: the protocol {protocol} draws nothing: it has one trial, of its views"
        )));
    }
    let folder = arguments.output.as_deref();
    folder.map_or(Ok(()), |folder| check_writable(&folder.join(SETTINGS)))?;
    let field = arguments.model.open(arguments.seed, None)?;
    let about = field.about();
    let render_options =
        arguments.omissions.omitting(arguments.picture.to_render_options(), arguments.model.exact, &about)?;
    let render_options = arguments.bound.bounded(render_options, &about, arguments.model.says_omissions());
    let scenes: Vec<Scene> =
        arguments.paths()?.iter().map(|path| arguments.picture.masks.open(path)).collect::<Result<_, _>>()?;
    refuse_same_photographs(&scenes)?;
    scenes.iter().for_each(warn_of);
    folder.map_or(Ok(()), |folder| keep_folder_apart(&scenes, folder))?;
    folder.map_or(Ok(()), |folder| keep_others_than(&folder.join(SCORES), SCORES_BEGIN))?;
    let draws = Draws {
        seed: arguments.seed,
        trial_count: arguments.protocol.trials,
        target_count: arguments.protocol.targets_per_trial.into(),
    };
    let plan = protocol.plan(&scenes, draws, about.least_sources)?;
    let (scene_options, sizes) = options_of(&scenes, protocol, &render_options, about.longest_side)?;
    options.retain(|option, _| !NO_SETTINGS.split(' ').any(|known| known == option));
    let files = digests(arguments, weightings)?;
    let settings = Settings {
        viewfuse: env!("CARGO_PKG_VERSION").to_owned(),
        protocol: protocol.to_string(),
        schemes: weightings.iter().map(OpenedChoice::to_string).collect(),
        field: about.name.to_owned(),
        metric: protocol.metric_words().to_owned(),
        options,
        files,
        job_count: plan.jobs.len(),
        notes: plan.notes.clone(),
        scenes: scenes.iter().zip(&sizes).map(|(scene, size)| SceneSettings::of(scene, *size)).collect(),
    };
    let Chosen { device, reason } = arguments.device.open()?;
    let shard = arguments.protocol.shard.unwrap_or(Shard::ALL);

    let progress = Terminal::new("evaluating");
    let work = Jobs {
        path: folder,
        settings: &settings,
        protocol,
        scenes: &scenes,
        plan: &plan,
        shard,
        picture_count: arguments.protocol.pictures,
        weightings,
        options: &scene_options,
        metrics: &arguments.metrics,
        progress: &progress,
    };
    let (finished, done) = on_threads(arguments.picture.threads, || work.run(&device, &field))??;
    drop(progress);
    let missing = missing(plan.jobs.len(), &finished);
    if missing.is_empty() && finished.values().all(|job| job.scores.is_empty()) {
        let scenes: Vec<String> = scenes.iter().map(Scene::name).collect();
        return Err(EvaluateError::NothingCounts(scenes.join(", ")).into());
    }
    let results = match missing.is_empty() {
        true => tables(finished.values(), protocol.has_table_a_count()),
        false => Vec::new(),
    };
    if let (Some(folder), true) = (folder, missing.is_empty()) {
        write_scores(folder, &finished)?;
    }
    let outcome = Outcome { protocol, scenes: &scenes, sizes: &sizes, plan: &plan, results: &results };
    if arguments.json {
        let json = outcome.json(&settings, &device.name(), &missing)?;
        say(format_args!("{json:#}"))?;
        return Ok(ExitCode::SUCCESS);
    }
    if arguments.latex {
        results.iter().try_for_each(|table| say(table.latex(&outcome.title(table))))?;
        return Ok(ExitCode::SUCCESS);
    }
    outcome.print(arguments.verbose)?;
    if let Some(folder) = folder {
        print_done(shard, [done, finished.len(), plan.jobs.len()], folder)?;
    }
    print_missing(&missing)?;
    say(format_args!("device: {}, {reason}", device.name()))?;
    Ok(ExitCode::SUCCESS)
}

/// The digests of the files that a run's figures depend on, by path.
fn digests(arguments: &Arguments, weightings: &[OpenedChoice]) -> anyhow::Result<BTreeMap<String, String>> {
    let networks = arguments.model.network.file().into_iter().chain(arguments.metrics.files());
    let files = networks.chain(weightings.iter().filter_map(OpenedChoice::file));
    let digest =
        |path: &Path| Ok((path.display().to_string(), sha256_of(path).with_context(|| path.display().to_string())?));
    files.map(digest).collect()
}

/// Says how many jobs this process did, how many are in the folder, and how many there are.
fn print_done(shard: Shard, [done, there, all]: [usize; 3], folder: &Path) -> anyhow::Result<()> {
    let part = if shard == Shard::ALL { String::new() } else { format!("shard {shard}: ") };
    let done = counted(done, "job");
    Ok(say(format_args!("{part}{done} done; {there} of {all} are in {}", folder.display()))?)
}

/// Says which jobs are missing, if any are.
fn print_missing(missing: &[usize]) -> anyhow::Result<()> {
    if missing.is_empty() {
        return Ok(());
    }
    let named: Vec<String> = missing.iter().take(NAMED).map(usize::to_string).collect();
    let more = missing.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    Ok(say(format_args!("missing: {}{more}; the tables come with the last of them", named.join(", ")))?)
}

/// The protocol with the targets that were given beside it.
fn with_targets(protocol: &Protocol, targets: Option<&str>) -> anyhow::Result<Protocol> {
    match (protocol, targets) {
        (protocol, None) => Ok(protocol.clone()),
        (Protocol::Nearest { sources, targets: None }, Some(targets)) => {
            Ok(Protocol::Nearest { sources: *sources, targets: Some(targets.to_owned()) })
        }
        _ => Err(wrong(format_args!(
            "--targets cannot be used with --protocol {protocol}, which chooses its targets; with nearest:K it can"
        ))),
    }
}

/// The options of each scene, and width and height of its pictures.
fn options_of(
    scenes: &[Scene],
    protocol: &Protocol,
    options: &RenderOptions,
    longest: u32,
) -> Result<(Vec<RenderOptions>, Vec<[u32; 2]>), RenderError> {
    let of_scene = |scene: &Scene| {
        let size = options.size.or_else(|| protocol.picture_size(scene, longest));
        let options = RenderOptions { size, ..options.clone() };
        let size = size_of(scene, &options, longest)?;
        Ok((options, size))
    };
    let both: Vec<_> = scenes.iter().map(of_scene).collect::<Result<_, RenderError>>()?;
    Ok(both.into_iter().unzip())
}

/// Width and height of the pictures at a scene's first view.
fn size_of(scene: &Scene, options: &RenderOptions, longest: u32) -> Result<[u32; 2], RenderError> {
    let side = working_side(scene, options, longest)?;
    let first = || scene.views.first().map_or([0, 0], |view| reduced_size(&view.camera, side).into());
    Ok(options.size.unwrap_or_else(first))
}

/// Every score as CSV in the folder.
fn write_scores(folder: &Path, finished: &BTreeMap<usize, Finished>) -> anyhow::Result<()> {
    let first = |job: &Finished| vec![job.job.to_string(), job.scene_name.clone(), job.trial.to_string()];
    let lines = finished.values().flat_map(|job| job.scores.iter().map(move |score| (first(job), score)));
    let csv = csv_of(&["job", "scene", "trial"], &lines.collect::<Vec<_>>())?;
    Ok(write_whole(&folder.join(SCORES), &csv)?)
}

/// What there is to tell.
struct Outcome<'a> {
    protocol: &'a Protocol,
    scenes: &'a [Scene],
    sizes: &'a [[u32; 2]],
    plan: &'a Plan,
    /// Empty until every job is there.
    results: &'a [Table],
}

impl Outcome<'_> {
    fn title(&self, results: &Table) -> String {
        let sources: Vec<String> = results.source_counts.iter().map(usize::to_string).collect();
        let (scenes, pictures) = (counted(results.scene_count, "scene"), counted(results.target_count, "picture"));
        format!("{}, sources: {}; {scenes}, {pictures} of each scheme", self.protocol, sources.join(", "))
    }

    /// What others published, of the scenes that have jobs.
    fn published(&self) -> Option<Published> {
        let taken = |scene: &usize| self.plan.jobs.iter().any(|job| job.scene == *scene);
        let taken: Vec<usize> = (0..self.scenes.len()).filter(taken).collect();
        let scenes: Vec<String> = taken.iter().map(|&scene| self.scenes[scene].name()).collect();
        let sizes: Vec<[u32; 2]> = taken.iter().map(|&scene| self.sizes[scene]).collect();
        let has_masked = self.results.iter().flat_map(|table| &table.metrics).any(|metric| metric.name == PSNR_MASKED);
        let targets: Vec<usize> = taken
            .iter()
            .map(|scene| self.plan.jobs.iter().filter(|job| job.scene == *scene).map(|job| job.targets.len()).sum())
            .collect();
        Published::of(self.protocol, &scenes, &sizes, &targets, has_masked).filter(|_| !self.results.is_empty())
    }

    /// All of it for other programs.
    fn json(&self, settings: &Settings, device: &str, missing: &[usize]) -> anyhow::Result<serde_json::Value> {
        Ok(json!({
            "settings": settings,
            "device": device,
            "jobs": self.plan.jobs.iter().map(|job| self.job(job)).collect::<Vec<_>>(),
            "tables": self.json_tables()?,
            "published": self.published(),
            "missing": missing,
        }))
    }

    fn job(&self, job: &Job) -> serde_json::Value {
        let scene = &self.scenes[job.scene];
        json!({
            "scene": scene.name(),
            "trial": job.trial,
            "sources": view_names(scene, &job.sources),
            "targets": view_names(scene, &job.targets),
        })
    }

    fn json_tables(&self) -> anyhow::Result<Vec<serde_json::Value>> {
        self.results.iter().map(|table| json_of(&self.title(table), table)).collect()
    }

    fn print(&self, is_verbose: bool) -> anyhow::Result<()> {
        let notes = &self.plan.notes;
        notes.iter().take(NAMED).try_for_each(|note| say(format_args!("note: {note}")))?;
        if notes.len() > NAMED {
            say(format_args!("and {} more notes", notes.len() - NAMED))?;
        }
        if !self.protocol.draws() && !self.results.is_empty() {
            self.print_views()?;
        }
        for table in self.results {
            print_table(&self.title(table), table, is_verbose)?;
        }
        match self.published() {
            Some(published) => Ok(print_published(&published)?),
            None => Ok(()),
        }
    }

    /// Which views were taken, and the metric, where that is no matter of chance.
    fn print_views(&self) -> anyhow::Result<()> {
        for job in self.plan.jobs.iter().take(NAMED) {
            let (scene, [width, height]) = (&self.scenes[job.scene], self.sizes[job.scene]);
            let [sources, targets] = [&job.sources, &job.targets].map(|views| view_names(scene, views).join(", "));
            say(format_args!("{}, {width}x{height}: targets {targets} from {sources}", scene.name()))?;
        }
        if self.plan.jobs.len() > NAMED {
            say(format_args!("and {} more", self.plan.jobs.len() - NAMED))?;
        }
        Ok(say(format_args!("metric: {}\n", self.protocol.metric_words()))?)
    }
}
