//! `viewfuse evaluate`.
//!
//! ```text
//! protocol   with --protocol: jobs, a folder that can be continued, shards
//! tables     means on the terminal, every score as CSV
//! ```

mod protocol;
mod tables;

use super::metrics_options::MetricOptions;
use super::model::ModelOptions;
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::terminal::Terminal;
use super::weighting::{many_help, open_all, or_every_scheme};
use super::{on_threads, say};
use clap::Args;
use protocol::ProtocolOptions;
use std::collections::{BTreeMap, HashSet};
use std::path::PathBuf;
use std::process::ExitCode;
use tables::{csv_of, print_means};
use viewfuse_device::choice::Chosen;
use viewfuse_evaluate::{Evaluator, Score, means};
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_scene::Scene;
use viewfuse_scene::dataset::{Dataset, DatasetError, Split};
use viewfuse_weighting::WeightingSpec;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse evaluate dino/ --targets 1,4,7,10,13,16 --size 160x120\n      each of six views from all others, every scheme\n  \
    viewfuse evaluate cars/*/ --sources all/3 --weights mean --weights error:alpha=1 -o cars.csv\n      the other views from every third, two schemes\n  \
    viewfuse evaluate cars/*/ --protocol random --trials 3 -o runs/random\n      the paper's first table, with pictures for a report\n  \
    viewfuse evaluate cars/*/ --protocol count --shard 2/8 -o runs/count\n      the third of eight parts; the folder is shared, or copied together afterwards\n\n\
    With --protocol, the same command continues a folder after an interruption, and prints the tables once every job of \
    all shards is done. Intervals are of 95 % over the scenes; differences from mean are taken scene by scene.")]
pub(crate) struct Arguments {
    /// One or more scenes; with --split data sets
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Use the scenes of a data set for train, val or test
    #[arg(long, value_name = "SPLIT")]
    split: Option<Split>,
    /// Views to render and compare, as for --sources [default: all views, each held out in turn; with --sources all others]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = many_help())]
    weights: Vec<WeightingSpec>,
    #[command(flatten)]
    protocol: ProtocolOptions,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    model: ModelOptions,
    #[command(flatten)]
    metrics: MetricOptions,
    /// Seed of every random draw: of protocols, and of networks
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
    /// Write every score to this CSV file; with --protocol the folder of the evaluation
    #[arg(short, long, value_name = "PATH")]
    output: Option<PathBuf>,
}

impl Arguments {
    /// The paths of the scenes.
    fn paths(&self) -> Result<Vec<PathBuf>, DatasetError> {
        let Some(split) = self.split else { return Ok(self.scenes.clone()) };
        let sets: Vec<Dataset> = self.scenes.iter().map(|path| Dataset::open(path, split)).collect::<Result<_, _>>()?;
        Ok(sets.into_iter().flat_map(|set| set.scenes).collect())
    }
}

/// `values` are all options and their values as on the command line.
pub(crate) fn run(arguments: &Arguments, values: BTreeMap<String, String>) -> anyhow::Result<ExitCode> {
    arguments.metrics.refuse_sets()?;
    let mut specs = or_every_scheme(&arguments.weights)?;
    if arguments.protocol.protocol.is_some() {
        // Once in a table is enough.
        let mut seen = HashSet::new();
        specs.retain(|spec| seen.insert(spec.to_string()));
    }
    let weightings = open_all(&specs)?;
    if let (Some(protocol), Some(folder)) = (&arguments.protocol.protocol, &arguments.output) {
        return protocol::run(arguments, protocol, folder, &weightings, values);
    }
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), None);
    arguments.output.as_deref().map_or(Ok(()), check_writable)?;
    let field = arguments.model.open(arguments.seed, None)?;
    let options = arguments.picture.to_render_options(arguments.model.exact, &field.about())?;
    let Chosen { device, reason } = arguments.device.open()?;
    let mut all: Vec<Score> = Vec::new();
    let mut scene_of: Vec<String> = Vec::new();
    // All are opened before the first is computed: a wrong path shows at once.
    let paths = arguments.paths()?;
    let scenes: Vec<Scene> = paths.iter().map(Scene::open).collect::<Result<_, _>>()?;
    for (path, scene) in paths.iter().zip(&scenes) {
        let progress = Terminal::new("evaluating");
        let score = || -> anyhow::Result<Vec<Score>> {
            let (renderer, scorer) = (field.on(&device), arguments.metrics.on(&device)?);
            let evaluator = Evaluator {
                weightings: &weightings,
                renderer: renderer.as_ref(),
                options: &options,
                scorer: scorer.as_ref(),
                progress: &progress,
            };
            Ok(evaluator.score_all(scene, &selection)?)
        };
        let scores = on_threads(arguments.picture.threads, score)??;
        drop(progress);
        print_means(&path.display().to_string(), &means(&scores))?;
        scene_of.extend(scores.iter().map(|_| path.display().to_string()));
        all.extend(scores);
    }
    if paths.len() > 1 {
        print_means(&format!("all {} scenes", paths.len()), &means(&all))?;
    }
    say(format_args!("device: {}, {reason}", device.name()))?;
    if let Some(path) = &arguments.output {
        let lines: Vec<_> = scene_of.into_iter().map(|scene| vec![scene]).zip(&all).collect();
        write_whole(path, &csv_of(&["scene"], &lines)?)?;
        say(format_args!("{}", path.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}
