//! Gaussians of the sample scene on each device: derivatives, and pictures of a scene that is optimised.

use crate::candidate::{Candidate, tests};
use libtest_mimic::Failed;
use std::sync::OnceLock;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Memory};
use viewfuse::field::AnyField;
use viewfuse::field::gaussians::{Optimised, Recipe, Splatter, Tiles, optimised};
use viewfuse::field::point_cloud::{CloudPoint, point_cloud};
use viewfuse::field::render::{RenderOptions, Stage, open_album};
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::photographs::{SourceImages, to_rgb8};
use viewfuse::weighting::Weighting;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::metrics::psnr;
use viewfuse_kernels::gaussians::{SplatBlock, TileBlock};
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_tests::places::data;
use viewfuse_vulkan::GpuOptions;

tests!(derivatives_of_a_scene_are_the_cpus, a_scene_is_as_good_as_the_cpus);

/// Most splats of a tile: fewer than those whose loops Mesa's llvmpipe ends (`viewfuse_field::gaussians::optimised`).
const MAX_LISTED: u32 = 100;
/// Largest difference of derivatives, as a share of the norm of all: sums of at most 64 pixels and some 50 splats, in
/// another order and with other last digits of the exponential, differ by some 1e-5.
const MAX_DIFFERENCE: f64 = 1.0e-3;
/// Largest difference of scores, decibels: on another device the last digits differ, and the steps make them grow.
const MAX_LOSS: f64 = 0.5;

/// A short one.
fn recipe() -> Recipe {
    Recipe { iterations: [0, 24, 16, 16], ..Recipe::default() }
}

/// Photographs of the sample scene, and points on its surfaces.
fn start() -> &'static (SourceImages, Vec<CloudPoint>) {
    static START: OnceLock<(SourceImages, Vec<CloudPoint>)> = OnceLock::new();
    START.get_or_init(|| {
        let scene = Scene::open(data("toy")).expect("a scene");
        let selection = Selection { sources: Some("0..19/2".to_owned()), ..Selection::default() };
        let sources = selection.sources_without(&scene, &[], 2).expect("sources");
        let options = RenderOptions { size: Some([64; 2]), ..RenderOptions::default() };
        let (field, device) = (AnyField::default(), AnyDevice::Cpu(Cpu));
        let renderer = field.on(&device);
        let album = open_album(&scene, sources.clone(), renderer.as_ref(), &options, &Silent).expect("photographs");
        let stage = Stage::prepare(&scene, &album, &sources, renderer.as_ref(), &options, &Silent);
        let mut stage = stage.expect("a stage");
        let weighting = Weighting::open("distance:power=2").expect("a scheme");
        let points = point_cloud(&mut stage, &weighting, Recipe::cloud(sources.len()), &Silent).expect("points");
        (stage.images.as_ref().clone(), points)
    })
}

/// A scene of Gaussians that a device optimised.
fn scene<D: Device>(device: &D) -> Optimised {
    let (images, points) = start();
    optimised(device, images, points, recipe(), &Silent).expect("steps").expect("enough points")
}

/// The CPU's.
fn cpus_scene() -> &'static Optimised {
    static SCENE: OnceLock<Optimised> = OnceLock::new();
    SCENE.get_or_init(|| scene(&Cpu))
}

/// The first source's camera.
fn camera() -> CameraBlock {
    start().0.images[0].camera.block(0)
}

/// The longest list of splats of a tile.
fn longest_list(made: &Optimised) -> u32 {
    let (camera, gaussian_count) = (camera(), made.gaussians.len() as u32);
    let block = SplatBlock { camera, near: made.near, gaussian_count, padding: [0; 2] };
    let mut splats = Cpu.zeros(made.gaussians.len()).expect("memory");
    Cpu.project_gaussians(&block, &made.gaussians, &mut splats).expect("splats");
    let lists = Tiles::of(&TileBlock::new(camera.width, camera.height, made.background), &splats);
    lists.starts.windows(2).map(|part| part[1] - part[0]).max().unwrap_or(0)
}

/// Every so many Gaussians of the CPU's scene, so that no list is too long.
fn thinned() -> Optimised {
    let all = cpus_scene();
    let every =
        |step: usize| Optimised { gaussians: all.gaussians.iter().copied().step_by(step).collect(), ..all.clone() };
    (1..all.gaussians.len()).map(every).find(|cloud| longest_list(cloud) <= MAX_LISTED).expect("a step")
}

/// Derivatives by the Gaussians of a loss whose derivatives by the first source's pixels have all signs.
fn derivatives<D: Device>(device: &D, made: &Optimised) -> Vec<GaussianBlock> {
    let splatter = Splatter { device, near: made.near, background: made.background };
    let camera = camera();
    let uploaded = device.upload(&made.gaussians).expect("Gaussians");
    let picture = splatter.picture(&uploaded, made.gaussians.len(), &camera).expect("a picture");
    let by = |index: usize| [0, 1, 2, 3].map(|channel| ((index * 7 + channel * 5) % 11) as f32 / 5.0 - 1.0);
    let by_pixels: Vec<[f32; 4]> = (0..(camera.width * camera.height) as usize).map(by).collect();
    splatter.gradients(&uploaded, &picture, &by_pixels).expect("derivatives")
}

/// Some of a Gaussian's parameters.
type Part = fn(&GaussianBlock) -> Vec<f32>;

fn derivatives_of_a_scene_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let made = thinned();
    let (cpu, ours) = (derivatives(&Cpu, &made), derivatives(&device, &made));
    let groups: [(&str, Part); 5] = [
        ("position", |gaussian| gaussian.position.to_vec()),
        ("opacity", |gaussian| vec![gaussian.opacity]),
        ("scales", |gaussian| gaussian.log_scales.to_vec()),
        ("rotation", |gaussian| gaussian.rotation.to_vec()),
        ("colour", |gaussian| gaussian.colour.to_vec()),
    ];
    let norm = |values: &[f32]| values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
    for (name, part) in groups {
        let [a, b] = [&cpu, &ours].map(|all| all.iter().flat_map(part).collect::<Vec<f32>>());
        let apart: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let (difference, all) = (norm(&apart), norm(&a));
        assert!(
            all > 0.0 && difference <= MAX_DIFFERENCE * all,
            "{name}: {difference:e} of {all:e}, {} Gaussians",
            made.gaussians.len()
        );
    }
    Ok(())
}

/// The PSNR of the Gaussians at the sources, decibels.
fn score(made: &Optimised) -> f64 {
    let images = &start().0;
    let splatter = Splatter { device: &Cpu, near: made.near, background: made.background };
    let score = |index: usize| {
        let camera = images.images[index].camera.block(0);
        let rendered = splatter.rendered(&made.gaussians, made.gaussians.len(), &camera, 0.5).expect("a picture");
        let picture = to_rgb8(&rendered.colours, [rendered.width, rendered.height]);
        psnr(picture.as_raw(), images.picture(index).as_raw())
    };
    (0..images.images.len()).map(score).sum::<f64>() / images.images.len() as f64
}

fn a_scene_is_as_good_as_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let ours = scene(&device);
    if device.is_software() {
        assert_eq!(&ours, cpus_scene(), "by the CPU's own loops");
    }
    let (score, cpus) = (score(&ours), score(cpus_scene()));
    assert!(score > 15.0 && score > cpus - MAX_LOSS, "{score} dB, on the CPU {cpus} dB");
    Ok(())
}
