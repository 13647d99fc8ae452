//! `viewfuse select`.

use super::options::SourceOptions;
use super::outputs::{keep_file_apart, keep_unlike};
use super::parse::parse_count;
use super::path::PathOptions;
use super::printing::{say, warn_of};
use super::table::table;
use super::weighting::scheme_help;
use super::wrong::wrong;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_job::files::write_whole;
use viewfuse_output::selected::SelectedSources;
use viewfuse_scene::Scene;
use viewfuse_weighting::WeightingSpec;

/// Targets that are printed; of more, how many there are.
const PRINTED: usize = 32;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse select photos/ --count 3 --targets 4,9\n  \
    viewfuse select photos/ --count 5 --between 3 7 --frames 60 --json -o views.json\n  \
    viewfuse select photos/ --count 2 --targets test --index -o evaluation_index.json\n\n\
    Indices count the scene's photographs from 0, in its order. What the chosen views lack of the whole weight bounds \
    how much a fusion of all views changes without the others, as a share of the range of what is fused.")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// How many sources
    #[arg(short = 'k', long, value_name = "K", value_parser = parse_count)]
    count: usize,
    /// The target views, as for --sources [default: the scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    path: PathOptions,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", default_value_t = WeightingSpec::default(), help = scheme_help())]
    weights: WeightingSpec,
    /// Everything as JSON: for each target alone, and for all together
    #[arg(long)]
    json: bool,
    /// A line a target: its name and the indices of its sources, the greatest weight first
    #[arg(long, conflicts_with = "json")]
    lines: bool,
    /// An index file as pixelSplat and MVSplat read: the sources for all targets together, and the targets
    #[arg(long, conflicts_with_all = ["json", "lines"])]
    index: bool,
    /// Write to this file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = Scene::open(&arguments.scene)?;
    warn_of(&scene);
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.path.choice());
    let job = selection.resolve(&scene, 1)?;
    let selected = SelectedSources::of(&scene, &job, &weighting, arguments.count)?;
    let text = if arguments.json {
        format!("{}\n", serde_json::to_string_pretty(&selected)?)
    } else if arguments.lines {
        if let Some(target) = job.targets.iter().find(|target| target.name.contains(['\n', '\r'])) {
            return Err(wrong(format_args!(
                "--lines: the name {:?} has a line break in it; --json holds it",
                target.name
            )));
        }
        selected.lines()
    } else if arguments.index {
        let no_index =
            || wrong("--index needs targets that are photographs of the scene, of which it holds the indices");
        format!("{}\n", selected.index().ok_or_else(no_index)?)
    } else {
        readable(&selected, job.sources.len())
    };
    match &arguments.output {
        Some(path) => {
            keep_file_apart([&scene], path)?;
            keep_unlike(path, text.as_bytes(), is_selection)?;
            write_whole(path, text.as_bytes()).context("the selection")?;
            say(path.display())?;
        }
        None => say(text.trim_end_matches('\n'))?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether a file is a selection in the form of another one: by the keys of JSON, the lines of a list, the header of a
/// table and its first line without scene, scheme and numbers.
fn is_selection(there: &[u8], new: &[u8]) -> bool {
    let keys = |text: &[u8]| -> Option<Vec<String>> {
        let whole: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(text).ok()?;
        // An index has one key, the scene's name.
        let inner = whole.values().next().and_then(serde_json::Value::as_object).filter(|_| whole.len() == 1);
        Some(whole.keys().chain(inner.into_iter().flat_map(|inner| inner.keys())).cloned().collect())
    };
    if let Some(new) = keys(new) {
        return keys(there) == Some(new);
    }
    let form = |text: &[u8]| -> Option<(String, String)> {
        let text = String::from_utf8_lossy(text);
        let mut lines = text.lines();
        let counts = lines.next()?.rsplit(':').next()?.replace(|letter: char| letter.is_ascii_digit(), "");
        let header: String = lines.nth(1)?.split_whitespace().collect();
        Some((counts, header))
    };
    let is_list = |text: &[u8]| {
        let text = String::from_utf8_lossy(text);
        let is_line = |line: &str| {
            let mut indices = line.split_whitespace().skip(1).peekable();
            indices.peek().is_some() && indices.all(|index| index.bytes().all(|byte| byte.is_ascii_digit()))
        };
        text.lines().all(is_line)
    };
    match is_list(new) {
        true => is_list(there),
        false => form(there) == form(new),
    }
}

/// For a person. `source_count` sources were there to choose from: a share is one of their weight.
fn readable(selected: &SelectedSources, source_count: usize) -> String {
    let mut rows = table(["target", "share", "sources and their weights"].map(str::to_owned));
    for target in selected.targets.iter().take(PRINTED) {
        let named = |(name, weight): (&String, &f32)| format!("{name} {weight:.3}");
        let sources: Vec<String> = target.sources.iter().zip(&target.weights).map(named).collect();
        rows.add_row([target.target.clone(), format!("{:.3}", target.share), sources.join(", ")]);
    }
    let more = selected.targets.len().saturating_sub(PRINTED);
    let more = if more > 0 { format!("and {more} more targets\n") } else { String::new() };
    let together = &selected.together;
    let [mean, least] = together.share;
    format!(
        "{}, {}: {} of {source_count} sources\n{rows}\n{more}for all together: {} (share of the weight: mean \
            {mean:.3}, least {least:.3})\n",
        selected.scene,
        selected.weighting,
        together.indices.len(),
        together.sources.join(", ")
    )
}
