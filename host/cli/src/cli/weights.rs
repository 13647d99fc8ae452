//! `viewfuse weights`.

use super::options::SourceOptions;
use super::outputs::{keep_file_apart, keep_unlike};
use super::path::PathOptions;
use super::printing::{complain, counted, say, warn_of};
use super::table::table;
use super::weighting::{many_help, open_all, or_every_scheme};
use super::wrong::wrong;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_job::files::write_whole;
use viewfuse_job::progress::Silent;
use viewfuse_output::weights::WeightTable;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{FewShot, Target, away_warning};
use viewfuse_scene::unit::{RigUnit, SRN_DISTANCE};
use viewfuse_weighting::WeightingSpec;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse weights dino/ --target '#4' --weights error:alpha=0.5 --json\n  \
    viewfuse weights dino/ --orbit 36 --weights mean --weights cars=attention:cars.safetensors --csv\n  \
    viewfuse weights dino/ --targets all/4 --npy weights.npy\n\n\
    CSV has a line for each scheme, target and source. The array is [scheme][target][source]; what its indices mean is \
    printed as JSON.")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// The target views, as for --sources [default: the scene's target poses]
    #[arg(long, alias = "target", value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    path: PathOptions,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = many_help())]
    weights: Vec<WeightingSpec>,
    /// Print JSON instead of tables: an object for one target, a list of them for several
    #[arg(long)]
    json: bool,
    /// Print CSV instead of tables
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Write an array for NumPy to this file, and print what its indices mean
    #[arg(long, value_name = "FILE", conflicts_with_all = ["json", "csv"])]
    npy: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weightings = open_all(&each_once(or_every_scheme(&arguments.weights)?)?)?;
    let scene = Scene::open(&arguments.scene)?;
    warn_of(&scene);
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.path.choice());
    let job = selection.resolve(&scene, 1)?;
    let away = away_warning(&scene, &job);
    job.warning.iter().chain(&away).for_each(|warning| complain(format_args!("warning: {warning}")));
    let weights = WeightTable::of(&scene, &job, &weightings, &Silent)?;
    if arguments.json {
        let mut documents = weights.documents();
        // One target is the rule; several become a list.
        let text = match documents.len() {
            1 => serde_json::to_string_pretty(&documents.remove(0))?,
            _ => serde_json::to_string_pretty(&documents)?,
        };
        say(text)?;
    } else if arguments.csv {
        say(csv_of(&weights)?.trim_end_matches('\n'))?;
    } else if let Some(path) = &arguments.npy {
        keep_file_apart([&scene], path)?;
        let numbers = weights.npy();
        keep_unlike(path, &numbers, is_weights)?;
        write_whole(path, &numbers)?;
        let axes = json!({
            "file": path, "shape": weights.shape(), "schemes": weights.schemes, "targets": weights.targets,
            "sources": weights.sources,
        });
        say(format_args!("{axes:#}"))?;
    } else {
        for (index, target) in job.targets.iter().enumerate() {
            print_table(&scene, &job, target, &weights, index)?;
        }
        let unit = RigUnit::of_scene(&scene);
        let length = scene.frame.file_length(unit.length());
        if length != 1.0 {
            say(format_args!(
                "Distances are in the units of the scene's files; schemes measure lengths in {length:.4e} of these, in \
                 which the cameras are {SRN_DISTANCE} from what they look at."
            ))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Each scheme once. Two under one name are refused: JSON has one entry a name, so one of them would be missing, and in
/// tables nobody could tell them apart.
fn each_once(given: Vec<WeightingSpec>) -> anyhow::Result<Vec<WeightingSpec>> {
    let mut schemes: Vec<WeightingSpec> = Vec::new();
    for scheme in given {
        if schemes.contains(&scheme) {
            continue;
        }
        let name = scheme.to_string();
        if schemes.iter().any(|other| other.to_string() == name) {
            return Err(wrong(format_args!("--weights: two schemes would be called '{name}'; give them other labels")));
        }
        schemes.push(scheme);
    }
    Ok(schemes)
}

/// Whether an array is one of weights, as another one: its header without the sizes.
fn is_weights(there: &[u8], new: &[u8]) -> bool {
    let kind = |bytes: &[u8]| -> Vec<u8> {
        let header = bytes.get(10..128).unwrap_or_default();
        header.iter().copied().filter(|byte| !byte.is_ascii_digit() && *byte != b' ').collect()
    };
    there.get(..10) == new.get(..10) && kind(there) == kind(new)
}

/// A line for each scheme, target and source.
fn csv_of(weights: &WeightTable) -> anyhow::Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["scheme", "target", "source", "weight"])?;
    for (scheme, scheme_name) in weights.schemes.iter().enumerate() {
        for (target, target_name) in weights.targets.iter().enumerate() {
            for (source, weight) in weights.sources.iter().zip(weights.weights(scheme, target)) {
                writer.write_record([scheme_name, target_name, source, &weight.to_string()])?;
            }
        }
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}

/// A length with three decimals, or four digits where these show nothing of it.
fn length(length: f32) -> String {
    if length == 0.0 || (0.1..1.0e5).contains(&length) { format!("{length:.3}") } else { format!("{length:.3e}") }
}

fn print_table(
    scene: &Scene,
    job: &FewShot,
    target: &Target,
    weights: &WeightTable,
    index: usize,
) -> std::io::Result<()> {
    let lead = ["source".to_owned(), "distance".to_owned(), "angle".to_owned()];
    // Parameters go below the name, so that the table stays narrow.
    let names = weights.schemes.iter().map(|name| name.replace(':', "\n").replace(',', ",\n").replace('-', "-\n"));
    let mut rows = table(lead.into_iter().chain(names));
    for (row, &view) in job.sources.iter().enumerate() {
        let (source, pose) = (&scene.views[view], target.camera.pose);
        let distance = scene.frame.file_length(source.camera.pose.distance(&pose));
        let angle = source.camera.pose.axis_angle(&pose).to_degrees();
        let lead = [source.name.clone(), length(distance), format!("{angle:.1}\u{b0}")];
        let weight = |scheme| format!("{:.4}", weights.weights(scheme, index)[row]);
        rows.add_row(lead.into_iter().chain((0..weights.schemes.len()).map(weight)));
    }
    let sources = counted(job.sources.len(), "source");
    say(format_args!("{}: target {}, {sources}", scene.path.display(), target.name))?;
    say(format_args!("{rows}"))
}
