//! What was tried.

use super::candidates::Candidates;
use super::joined;
use super::learning::{Learning, train};
use super::network::{Network, Parts};
use super::table::{Job, Measured, PHOTOGRAPHS};
use anyhow::Context;

/// Each variant is trained with these.
pub(crate) const SEEDS: [u64; 2] = [0, 1];

/// What a variant is trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pictures {
    /// Generated scenes as they are.
    Clean,
    /// Generated scenes with what photographs have besides.
    AsPhotographs,
    /// These, and the photographs of all scenes but the one that is measured, as often.
    AndPhotographs,
}

/// A variant.
pub(crate) struct Variant {
    pub(crate) name: &'static str,
    pub(crate) parts: Parts,
    pub(crate) caution: f64,
    pub(crate) pictures: Pictures,
}

const BOTH: Parts =
    Parts { temperature: false, blend: true, planes: true, directions: false, position: false, pooled_weights: true };
const BLEND: Parts = Parts { planes: false, ..BOTH };
const PLANES: Parts = Parts { blend: false, ..BOTH };
const TEMPERATURE: Parts = Parts { temperature: true, blend: false, ..BOTH };
/// Cost of the logits where a variant is cautious.
const CAUTION: f64 = 0.1;

const fn on(name: &'static str, parts: Parts, caution: f64, pictures: Pictures) -> Variant {
    Variant { name, parts, caution, pictures }
}

/// All of them.
pub(crate) const VARIANTS: [Variant; 13] = [
    on("temperature", TEMPERATURE, 0.0, Pictures::Clean),
    on("blend", BLEND, 0.0, Pictures::Clean),
    on("planes", PLANES, 0.0, Pictures::Clean),
    on("both", BOTH, 0.0, Pictures::Clean),
    on("both, directions", Parts { directions: true, ..BOTH }, 0.0, Pictures::Clean),
    on("both, position", Parts { position: true, ..BOTH }, 0.0, Pictures::Clean),
    on("both, weights only in the blend", Parts { pooled_weights: false, ..BOTH }, 0.0, Pictures::Clean),
    on("planes, cautious", PLANES, CAUTION, Pictures::Clean),
    on("blend; as photographs", BLEND, 0.0, Pictures::AsPhotographs),
    on("planes; as photographs", PLANES, 0.0, Pictures::AsPhotographs),
    on("both; as photographs", BOTH, 0.0, Pictures::AsPhotographs),
    on("planes; and photographs", PLANES, 0.0, Pictures::AndPhotographs),
    on("both, cautious; and photographs", BOTH, CAUTION, Pictures::AndPhotographs),
];

/// The pictures of a run.
pub(crate) struct Data {
    pub(crate) clean: Vec<Candidates>,
    pub(crate) as_photographs: Vec<Candidates>,
    pub(crate) tested: Vec<Job>,
}

/// Trains a variant with each seed and measures it.
pub(crate) fn measure(variant: &Variant, data: &Data, steps: u32) -> anyhow::Result<Measured> {
    let gains = std::thread::scope(|scope| {
        let threads = SEEDS.map(|seed| scope.spawn(move || with_seed(variant, data, steps, seed)));
        threads.into_iter().map(joined).collect::<anyhow::Result<Vec<_>>>()
    })?;
    let parameters = Network::new(variant.parts, 0)?.parameter_count();
    Ok(Measured { name: variant.name, parameters, gains })
}

/// What a variant gains on each scene.
fn with_seed(variant: &Variant, data: &Data, steps: u32, seed: u64) -> anyhow::Result<Vec<f64>> {
    let learning = Learning { caution: variant.caution, steps, seed };
    let generated = if variant.pictures == Pictures::Clean { &data.clean } else { &data.as_photographs };
    let generated: Vec<&Candidates> = generated.iter().collect();
    let has_photographs = variant.pictures == Pictures::AndPhotographs;
    let without = |name: &str| -> anyhow::Result<Network> {
        let pictures =
            if has_photographs { with_photographs(&generated, &data.tested, name) } else { generated.clone() };
        Ok(train(variant.parts, &learning, &pictures)?)
    };
    let common = without("")?;
    let of_job = |job: &Job| match has_photographs && job.group == PHOTOGRAPHS {
        true => gain(&without(&job.name)?, &job.pictures),
        false => gain(&common, &job.pictures),
    };
    data.tested.iter().map(of_job).collect()
}

/// Generated pictures, and those of all photographs but one scene's until they are as many.
fn with_photographs<'a>(generated: &[&'a Candidates], tested: &'a [Job], but: &str) -> Vec<&'a Candidates> {
    let others = tested.iter().filter(|job| job.group == PHOTOGRAPHS && job.name != but);
    let photographs: Vec<&Candidates> = others.flat_map(|job| &job.pictures).collect();
    generated.iter().copied().chain(photographs.into_iter().cycle().take(generated.len())).collect()
}

/// The mean gain over pictures, decibels.
fn gain(network: &Network, pictures: &[Candidates]) -> anyhow::Result<f64> {
    let mut sum = 0.0;
    for picture in pictures {
        let refined = network.refine(&picture.pixels).with_context(|| picture.scene.clone())?;
        sum += picture.gain(&refined.colours.detach())?;
    }
    Ok(sum / pictures.len().max(1) as f64)
}
