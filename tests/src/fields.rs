//! A field from sources to a picture, what it omitted on the way, and comparing pictures.

use crate::places::{data, repository};
use std::sync::Arc;
use viewfuse::device::Device;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::options::Given;
use viewfuse::field::render::{RenderOptions, Stage, open_album};
use viewfuse::field::rows;
use viewfuse::field::{AnyField, Field, FieldError, LeftOut, On, Record, Rendered, Renderer};
use viewfuse::job::progress::{Progress, Silent};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::{FewShot, Selection};
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::Weighting;
use viewfuse::weighting::sources::{MAX_SOURCES, SourcePoses, SourceWeights};
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;

/// A scene of `tests/data`.
pub fn sample(name: &str) -> Scene {
    Scene::open(data(name)).expect("a scene")
}

/// The field of a checkpoint that is included (`host/models`), with a seed.
pub fn model(name: &str, seed: u64) -> AnyField {
    let path = repository().join("host/models").join(name);
    let checkpoint = Checkpoint::open(&path).expect("a checkpoint");
    rows::open(checkpoint, &Given { seed, ..Given::default() }).expect("a network")
}

/// Targets from sources, each as an option names them.
pub fn job(scene: &Scene, sources: &str, targets: &str) -> FewShot {
    let [sources, targets] = [sources, targets].map(|views| Some(views.to_owned()));
    Selection { targets, sources, ..Selection::default() }.resolve(scene, 1).expect("views")
}

/// Weights of the first of so many views, by their scores; the others have none.
pub fn weights<const N: usize>(scores: [f32; N], count: u32) -> SourceWeights {
    let mut all = [0.0; MAX_SOURCES];
    all[..N].copy_from_slice(&scores);
    Weights::from_scores(&all, count)
}

/// Calls `act` with the sources of a job, prepared; the photographs of its targets are there.
pub fn on_scene<T>(
    scene: &Scene,
    job: &FewShot,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    act: impl FnOnce(&mut Stage<'_>) -> T,
) -> T {
    let shown = job.sources.iter().copied().chain(job.targets.iter().filter_map(|target| target.truth));
    let album = open_album(scene, shown, renderer, options, &Silent).expect("photographs");
    act(&mut Stage::prepare(scene, &album, &job.sources, renderer, options, &Silent).expect("a stage"))
}

/// Calls `act` with sources in memory, on the CPU and with the usual options; nothing weighs them yet.
pub fn on_sources<T>(
    sources: &SourceImages,
    field: &(impl Field + Sync),
    progress: &dyn Progress,
    act: impl FnOnce(&mut Stage<'_>) -> T,
) -> T {
    let (renderer, options) = (On { device: &Cpu, field }, RenderOptions::default());
    act(&mut Stage::of_sources(Arc::new(sources.clone()), &renderer, &options, progress).expect("a stage"))
}

/// One target on a device, from sources that nothing is known of, and the field's record of it.
///
/// # Errors
/// The field's.
pub fn picture<D: Device + Sync, F: Field + Sync>(
    device: &D,
    field: &F,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
    early_termination: f32,
    progress: &dyn Progress,
) -> Result<(Rendered, Record), FieldError> {
    let renderer = On { device, field };
    let options = RenderOptions::default();
    let mut stage = Stage::of_sources(Arc::new(sources.clone()), &renderer, &options, progress)?;
    stage.weigh_by(&[], progress)?;
    let picture = stage.picture(target, weights, early_termination, progress)?;
    Ok((picture, stage.record()))
}

/// What a record says of something that may be omitted.
///
/// # Panics
/// If it says nothing.
#[track_caller]
pub fn line(record: &Record, what: &str) -> LeftOut {
    *record.left_out.iter().find(|line| line.what == what).unwrap_or_else(|| panic!("no line '{what}'"))
}

/// One target on the CPU, from sources that a scheme weighs.
///
/// # Errors
/// The field's.
pub fn weighted_picture(
    field: &AnyField,
    scheme: &str,
    sources: &SourceImages,
    target: &Camera,
    early_termination: f32,
) -> Result<Rendered, FieldError> {
    let (device, options) = (AnyDevice::Cpu(Cpu), RenderOptions::default());
    let renderer = field.on(&device);
    let weighting = Weighting::open(scheme).expect("a scheme");
    let mut stage = Stage::of_sources(Arc::new(sources.clone()), renderer.as_ref(), &options, &Silent)?;
    stage.weigh_by(&relevance(sources, &weighting), &Silent)?;
    let poses: Vec<_> = sources.images.iter().map(|image| image.camera.pose).collect();
    let weights = weighting.weigh(&SourcePoses::new(&poses).expect("sources"), &target.pose);
    stage.picture(target, &weights, early_termination, &Silent)
}

/// The weights of all sources for each as a target, whose own is 0; none for a single source.
fn relevance(sources: &SourceImages, weighting: &Weighting) -> Vec<SourceWeights> {
    let poses: Vec<_> = sources.images.iter().map(|image| image.camera.pose).collect();
    let for_target = |target: usize| {
        let mut others = poses.clone();
        others.remove(target);
        let others = SourcePoses::new(&others).expect("two sources or more");
        let mut scores = weighting.weigh(&others, &poses[target]).values().to_vec();
        scores.insert(target, 0.0);
        let scores: [f32; MAX_SOURCES] = std::array::from_fn(|view| scores[view]);
        Weights::from_scores(&scores, poses.len() as u32)
    };
    if poses.len() < 2 { Vec::new() } else { (0..poses.len()).map(for_target).collect() }
}

/// The largest difference of a channel of each pixel; NaN if there is one.
fn differences<'a>(a: &'a [[f32; 4]], b: &'a [[f32; 4]]) -> impl Iterator<Item = f32> + 'a {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| largest(a.iter().zip(b).map(|(a, b)| (a - b).abs())))
}

/// The largest number; NaN if there is one.
fn largest(numbers: impl Iterator<Item = f32>) -> f32 {
    numbers.fold(0.0, |largest, number| if number <= largest || largest.is_nan() { largest } else { number })
}

/// Largest difference of any channel of any pixel; NaN if there is one.
#[track_caller]
pub fn largest_difference(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    largest(differences(a, b))
}

/// Root mean square of the differences of colours, over pixels and their three channels.
#[track_caller]
pub fn rms(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let square = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    (a.iter().zip(b).map(square).sum::<f64>() / (3 * a.len()) as f64).sqrt()
}

/// Colours that are laid over white.
pub fn over_white(texels: &[[f32; 4]]) -> Vec<[f32; 4]> {
    texels.iter().map(|texel| texel.map(|channel| channel + 1.0 - texel[3])).collect()
}

/// Share of pixels no channel of which differs by more than `bound`.
#[track_caller]
pub fn share_within(a: &[[f32; 4]], b: &[[f32; 4]], bound: f32) -> f64 {
    differences(a, b).filter(|difference| *difference <= bound).count() as f64 / a.len() as f64
}

/// Nothing is NaN or infinite, colours lie in their range.
#[track_caller]
pub fn assert_sound(picture: &Rendered) {
    let in_range = |value: &f32| (-1.0e-5..=1.0 + 1.0e-5).contains(value);
    assert!(picture.colours.iter().flatten().all(in_range), "a colour out of range or not finite");
    assert!(picture.depths.iter().all(|depth| depth.is_finite() && *depth >= 0.0), "a depth that is not finite");
    assert_eq!(picture.colours.len(), (picture.width * picture.height) as usize);
}
