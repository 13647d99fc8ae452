//! `viewfuse weights`.

use super::options::SourceOptions;
use super::say;
use super::table::table;
use super::weighting::{many_help, open_all, or_every_scheme};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_core::sources::Sources;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{FewShot, Target};
use viewfuse_weighting::WeightingSpec;
use viewfuse_weighting::sources::MOST_SOURCES;

#[derive(Args)]
#[command(after_help = "Example:\n  viewfuse weights dino/ --target 4 --weights error:alpha=0.5 --json")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// The target view
    #[arg(long, value_name = "VIEW")]
    target: String,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = many_help())]
    weights: Vec<WeightingSpec>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weightings = open_all(&or_every_scheme(&arguments.weights)?)?;
    let scene = Scene::open(&arguments.scene)?;
    let job = arguments.sources.to_selection(Some(&arguments.target), None).resolve(&scene, 1)?;
    let poses: Vec<_> = job.sources.iter().map(|&view| scene.views[view].camera.pose).collect();
    let sources = Sources::<MOST_SOURCES>::new(&poses)?;
    let mut documents = Vec::new();
    for target in &job.targets {
        let columns: Vec<(String, Vec<f32>)> = weightings
            .iter()
            .map(|weighting| {
                let weights = weighting.weigh(&sources, &target.camera.pose);
                (weighting.to_string(), weights.values()[..job.sources.len()].to_vec())
            })
            .collect();
        if arguments.json {
            documents.push(as_json(&scene, &job, target, &columns));
        } else {
            print_table(&scene, &job, target, &columns)?;
        }
    }
    if arguments.json {
        // One target is the rule; several become a list.
        let document = if documents.len() == 1 { documents.remove(0) } else { documents.into() };
        say(format_args!("{}", serde_json::to_string_pretty(&document)?))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(scene: &Scene, job: &FewShot, target: &Target, columns: &[(String, Vec<f32>)]) -> serde_json::Value {
    let sources: Vec<&str> = job.sources.iter().map(|&view| scene.views[view].name.as_str()).collect();
    let weights: serde_json::Map<String, serde_json::Value> =
        columns.iter().map(|(name, values)| (name.clone(), json!(values))).collect();
    json!({ "scene": scene.path, "target": target.name, "sources": sources, "weights": weights })
}

fn print_table(scene: &Scene, job: &FewShot, target: &Target, columns: &[(String, Vec<f32>)]) -> std::io::Result<()> {
    let lead = ["source".to_owned(), "distance".to_owned(), "angle".to_owned()];
    // Parameters go below the name, so that the table stays narrow.
    let names = columns.iter().map(|(name, _)| name.replace(':', "\n").replace(',', ",\n").replace('-', "-\n"));
    let mut rows = table(lead.into_iter().chain(names));
    for (row, &view) in job.sources.iter().enumerate() {
        let (source, pose) = (&scene.views[view], target.camera.pose);
        let distance = source.camera.pose.distance(&pose);
        let angle = source.camera.pose.axis_angle(&pose).to_degrees();
        let lead = [source.name.clone(), format!("{distance:.3}"), format!("{angle:.1}\u{b0}")];
        rows.add_row(lead.into_iter().chain(columns.iter().map(|(_, values)| format!("{:.4}", values[row]))));
    }
    say(format_args!("{}: target {}, {} sources", scene.path.display(), target.name, job.sources.len()))?;
    say(format_args!("{rows}"))
}
