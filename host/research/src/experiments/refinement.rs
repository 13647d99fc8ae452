//! A learned refinement of the training-free field: variants of it, trained on scenes and measured on others.
//!
//! `cargo run --release -p viewfuse-research -- refinement SIDE STEPS SCENES GROUP=SCENE=PROTOCOL...`
//!
//! The network ([`network`]) gets what the plane sweep knows of a pixel's best planes and sources ([`candidates`]) and changes the
//! parts of the sources, the shares of the planes, or both; untrained it is the field, which is checked in each picture. It is
//! trained on `SCENES` generated rooms and gardens ([`scenes`]), and measured on the scenes of the command: a folder, or
//! `made:PLACE/RIG/SEED`. A group named `photographs` decides whether a variant could be part of the field; a variant that is
//! trained on photographs is trained anew for each of them, on the others. Weights and draws are those of `headroom`. Below the
//! table stands what was run.

mod candidates;
mod learning;
mod network;
mod scenes;
mod table;
#[cfg(test)]
mod tests;
mod variants;

use super::planes::visit::{SCHEME, visit};
use anyhow::{Context, bail};
use candidates::Candidates;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::thread::ScopedJoinHandle;
use table::{Job, table};
use variants::{Data, VARIANTS, measure};
use viewfuse_evaluate::protocol::Protocol;
use viewfuse_scene::Scene;

/// Targets of a scene to train on, each from 2 to 5 sources.
const TARGETS: &str = "2,6";
/// Most targets of a job.
const MAX_TARGETS: usize = 4;

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [side, steps, scene_count, jobs @ ..] = arguments else {
        bail!("usage: refinement SIDE STEPS SCENES GROUP=SCENE=PROTOCOL...");
    };
    let (side, steps, scene_count): (u32, u32, u64) = (side.parse()?, steps.parse()?, scene_count.parse()?);
    let scratch = std::env::temp_dir().join(format!("viewfuse-refinement-{}", std::process::id()));
    let mut tested = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        let [group, scene, protocol] = job.splitn(3, '=').collect::<Vec<_>>()[..] else {
            bail!("'{job}': a job is GROUP=SCENE=PROTOCOL");
        };
        let (name, scene) = match scene.strip_prefix("made:") {
            Some(words) => (words.to_owned(), scenes::test_scene(&scratch.join(format!("test-{index}")), words, side)?),
            None => {
                let folder = PathBuf::from(scene);
                let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
                (name, Scene::open(&folder)?)
            }
        };
        let pictures = pictures(&name, scene, &protocol.parse()?, side).with_context(|| job.clone())?;
        eprintln!("{name}: {} pictures", pictures.len());
        tested.push(Job { group: group.to_owned(), name, protocol: protocol.to_owned(), pictures });
    }
    let (clean, as_photographs) = std::thread::scope(|scope| {
        let clean = scope.spawn(|| training(&scratch.join("clean"), scene_count, side, false));
        (joined(clean), training(&scratch.join("photographs"), scene_count, side, true))
    });
    let data = Data { clean: clean?, as_photographs: as_photographs?, tested };
    if scratch.exists() {
        std::fs::remove_dir_all(&scratch)?;
    }
    let mut measured = Vec::new();
    for variant in &VARIANTS {
        measured.push(measure(variant, &data, steps)?);
        eprintln!("{}", table(&measured, &data.tested));
    }
    let count = data.clean.len();
    let head = format!(
        "Pictures of {side} pixels, weights {SCHEME}; {steps} steps on {count} pictures of {scene_count} generated scenes:\n"
    );
    let run: Vec<String> = data
        .tested
        .iter()
        .map(|job| format!("{}: {}, {}, {} pictures", job.group, job.name, job.protocol, job.pictures.len()))
        .collect();
    println!("{}\n{head}{}", table(&measured, &data.tested), run.join("\n"));
    Ok(())
}

/// What a thread returns.
pub(crate) fn joined<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| resume_unwind(panic))
}

/// The pictures of the scenes to train on.
fn training(folder: &Path, scene_count: u64, side: u32, as_photographs: bool) -> anyhow::Result<Vec<Candidates>> {
    std::fs::create_dir_all(folder)?;
    let mut all = Vec::new();
    for index in 0..scene_count {
        let scene = scenes::training_scene(&folder.join(index.to_string()), index, side, as_photographs)?;
        let protocol = format!("nearest:{}:{TARGETS}", 2 + index % 4).parse()?;
        all.extend(pictures(&format!("training {index}"), scene, &protocol, side)?);
        eprintln!("training {index}: {} pictures", all.len());
    }
    Ok(all)
}

/// The targets of a protocol on a scene.
fn pictures(name: &str, scene: Scene, protocol: &Protocol, side: u32) -> anyhow::Result<Vec<Candidates>> {
    let mut pictures = Vec::new();
    visit(scene, protocol, side, MAX_TARGETS, |visit| {
        pictures.push(Candidates::of(name, visit)?);
        Ok(())
    })?;
    Ok(pictures)
}
