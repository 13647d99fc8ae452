//! `viewfuse evaluate`.
//!
//! ```text
//! protocol   with --protocol: a folder that can be gone on with, shards, the tables
//! jobs       what a protocol is made of, one after the other
//! tables     means on the terminal
//! files      every score as CSV, tables as JSON
//! ```

mod files;
mod jobs;
mod protocol;
mod tables;

use super::metrics_options::MetricOptions;
use super::model::ModelOptions;
use super::options::{BoundOptions, DeviceOptions, OmissionOptions, PictureOptions, SourceOptions};
use super::outputs::{keep_file_apart, keep_others_than, refuse_extension};
use super::printing::{counted, say, warn_of};
use super::terminal::Terminal;
use super::threads::on_threads;
use super::weighting::{many_choices_help, or_every_scheme};
use super::wrong::wrong;
use clap::Args;
use files::{csv_of, json_of};
use protocol::ProtocolOptions;
use serde_json::json;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs::canonicalize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tables::print_table;
use viewfuse_device::choice::Chosen;
use viewfuse_evaluate::baseline::Baseline;
use viewfuse_evaluate::summary::{Observation, Table, table};
use viewfuse_evaluate::{Evaluator, Score, check_selection};
use viewfuse_field::render::working_side;
use viewfuse_job::files::{check_writable, write_whole};
use viewfuse_job::progress::Part;
use viewfuse_scene::Scene;
use viewfuse_scene::dataset::{Dataset, DatasetError, Split};
use viewfuse_weighting::{OpenedChoice, WeightingChoice};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse evaluate dino/ --targets '#1,#4,#7,#10,#13' --size 160x120\n      each of five views from all others, every \
    scheme\n  viewfuse evaluate cars/*/ --sources all/3 --weights mean --weights error:alpha=1 -o cars.csv\n      the \
    other views from every third, two schemes\n  viewfuse evaluate fern/ --protocol llff:3\n      as few-shot papers \
    do on LLFF, with their figures beside\n  viewfuse evaluate scene/ --protocol nearest:4 --targets 2,5 --json\n      \
    two views, each from the four nearest others\n  viewfuse evaluate cars/*/ --protocol random --trials 3 -o \
    runs/random\n      the paper's first table, with pictures for a report\n  viewfuse evaluate cars/*/ --protocol \
    count --shard 2/8 -o runs/count\n      the third of eight parts; the folder is shared, or copied together \
    afterwards\n\n\
    With --protocol and --output, the same command again goes on with a folder after a kill, and prints the tables \
    once every job is there, whichever shards did them. Intervals are of 95 % over the scenes, or over the views of \
    one scene; differences of rows are taken scene by scene, or view by view. The first rows need no field: a copy of \
    the nearest source, that copy warped by the homography of a plane at the scene's depth, and the mean of the four \
    nearest so warped.")]
pub(crate) struct Arguments {
    /// One or more scenes; with --split data sets
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Take the scenes of a data set: those for train, val or test
    #[arg(long, value_name = "SPLIT")]
    split: Option<Split>,
    /// Views to render and compare, as for --sources [default: all views, each held out in turn; with --sources all
    /// others]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = many_choices_help())]
    weights: Vec<WeightingChoice>,
    #[command(flatten)]
    protocol: ProtocolOptions,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    omissions: OmissionOptions,
    #[command(flatten)]
    bound: BoundOptions,
    #[command(flatten)]
    model: ModelOptions,
    #[command(flatten)]
    metrics: MetricOptions,
    /// Seed of every random number: of a protocol's draws, and of networks
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
    /// Tell the differences from the baselines with their intervals
    #[arg(short, long)]
    verbose: bool,
    /// Print the tables as JSON
    #[arg(long)]
    json: bool,
    /// Print the tables as LaTeX, for the package booktabs
    #[arg(long, conflicts_with = "json")]
    latex: bool,
    /// Write every single score to this CSV file; with --protocol the folder of the evaluation
    #[arg(short, long, value_name = "PATH")]
    output: Option<PathBuf>,
}

impl Arguments {
    /// Where the scenes are. None of them twice: it would count as two in means and intervals.
    fn paths(&self) -> anyhow::Result<Vec<PathBuf>> {
        let paths = match self.split {
            None => self.scenes.clone(),
            Some(split) => {
                let sets = self.scenes.iter().map(|path| Dataset::open(path, split));
                let sets: Vec<Dataset> = sets.collect::<Result<_, DatasetError>>()?;
                sets.into_iter().flat_map(|set| set.scenes).collect()
            }
        };
        let mut seen = HashSet::new();
        match paths.iter().find(|path| !seen.insert(canonicalize(path).unwrap_or_else(|_| path.to_path_buf()))) {
            Some(path) => Err(wrong(format_args!("{}: the scene is given twice", path.display()))),
            None => Ok(paths),
        }
    }
}

/// Refuses schemes whose rows would have the name of another row.
fn refuse_equal_rows(choices: &[WeightingChoice]) -> anyhow::Result<()> {
    let mut seen: HashSet<String> = Baseline::ALL.iter().map(|baseline| baseline.name().to_owned()).collect();
    match choices.iter().map(WeightingChoice::to_string).find(|name| !seen.insert(name.clone())) {
        Some(name) => Err(wrong(format_args!("--weights: two rows of the table would be called '{name}'"))),
        None => Ok(()),
    }
}

/// `values` are all options and their values as a person would write them.
pub(crate) fn run(arguments: &Arguments, values: BTreeMap<String, String>) -> anyhow::Result<ExitCode> {
    arguments.metrics.refuse_sets()?;
    let mut choices: Vec<WeightingChoice> = Vec::new();
    for choice in or_every_scheme(&arguments.weights)? {
        // Once in a table is enough.
        if !choices.contains(&choice) {
            choices.push(choice);
        }
    }
    refuse_equal_rows(&choices)?;
    let weightings: Vec<OpenedChoice> = choices.iter().map(WeightingChoice::open).collect::<Result<_, _>>()?;
    if let Some(protocol) = &arguments.protocol.protocol {
        return protocol::run(arguments, protocol, &weightings, values);
    }
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), None);
    arguments.output.as_deref().map_or(Ok(()), check_writable)?;
    let field = arguments.model.open(arguments.seed, None)?;
    let about = field.about();
    let options = arguments.omissions.omitting(arguments.picture.to_render_options(), arguments.model.exact, &about)?;
    let options = arguments.bound.bounded(options, &about, arguments.model.says_omissions());
    let Chosen { device, reason } = arguments.device.open()?;
    // All are opened before the first is computed: a wrong path shows at once.
    let paths = arguments.paths()?;
    let scenes: Vec<Scene> = paths.iter().map(|path| arguments.picture.masks.open(path)).collect::<Result<_, _>>()?;
    refuse_same_photographs(&scenes)?;
    for scene in &scenes {
        check_selection(scene, &selection, about.least_sources)?;
        working_side(scene, &options, about.longest_side)?;
    }
    scenes.iter().for_each(warn_of);
    arguments.output.as_deref().map_or(Ok(()), |path| keep_file_apart(&scenes, path))?;
    let csv = |path: &Path| refuse_extension(path, "a table as CSV", &["csv", "txt"]);
    arguments.output.as_deref().map_or(Ok(()), csv)?;
    arguments.output.as_deref().map_or(Ok(()), |path| keep_others_than(path, files::CSV_BEGINNING))?;
    let (mut all, mut json_tables): (Vec<Vec<Score>>, Vec<serde_json::Value>) = (Vec::new(), Vec::new());
    let mut tell = |name: &str, results: &Table| -> anyhow::Result<()> {
        let title = format!("{name}: {}", counted(results.target_count, "target"));
        match (arguments.json, arguments.latex) {
            (true, _) => json_tables.push(json_of(&title, results)?),
            (_, true) => say(results.latex(&title))?,
            _ => print_table(&title, results, arguments.verbose)?,
        }
        Ok(())
    };
    let terminal = Terminal::new("evaluating");
    for (index, (path, scene)) in paths.iter().zip(&scenes).enumerate() {
        let name = if scenes.len() == 1 { String::new() } else { path.display().to_string() };
        let progress = Part::begin(&terminal, name, index..index + 1, scenes.len());
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
        terminal.aside(|| tell(&path.display().to_string(), &table(&observed(&[&scores]))))?;
        all.push(scores);
    }
    drop(terminal);
    if all.len() > 1 {
        tell(&format!("all {} scenes", all.len()), &table(&observed(&all.iter().collect::<Vec<_>>())))?;
    }
    if arguments.json {
        let whole = json!({
            "viewfuse": env!("CARGO_PKG_VERSION"), "device": device.name(), "options": values, "tables": json_tables,
        });
        say(format_args!("{whole:#}"))?;
    } else if !arguments.latex {
        say(format_args!("device: {}, {reason}", device.name()))?;
    }
    if let Some(path) = &arguments.output {
        let lines = paths
            .iter()
            .zip(&all)
            .flat_map(|(scene, scores)| scores.iter().map(move |score| (vec![scene.display().to_string()], score)));
        write_whole(path, &csv_of(&["scene"], &lines.collect::<Vec<_>>())?)?;
        if !arguments.json && !arguments.latex {
            say(format_args!("{}", path.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses a scene that is given as its folder and as its file, too: it would count as two in means and intervals.
fn refuse_same_photographs(scenes: &[Scene]) -> anyhow::Result<()> {
    let mut seen: HashMap<Vec<PathBuf>, &Path> = HashMap::new();
    for scene in scenes {
        let files = scene.views.iter().filter_map(|view| view.image.as_deref());
        let mut files: Vec<PathBuf> = files.map(|file| canonicalize(file).unwrap_or_else(|_| file.into())).collect();
        files.sort_unstable();
        if let Some(first) = seen.insert(files, &scene.path) {
            let (again, first) = (scene.path.display(), first.display());
            return Err(wrong(format_args!("{again}: the scene is given twice: its photographs are those of {first}")));
        }
    }
    Ok(())
}

/// Scores of one scene after the other.
fn observed<'a>(scenes: &[&'a Vec<Score>]) -> Vec<Observation<'a>> {
    let of_scene = |(scene, scores): (usize, &&'a Vec<Score>)| {
        scores.iter().map(move |score| Observation { scene, score }).collect::<Vec<_>>()
    };
    scenes.iter().enumerate().flat_map(of_scene).collect()
}
