//! The same scene at the world's origin and in a map's coordinates, a million units away: every field makes the same pictures.

use image::RgbImage;
use std::fs;
use std::path::Path;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::options::FieldOptions;
use viewfuse::field::render::{RenderOptions, render_all};
use viewfuse::field::rows;
use viewfuse::field::{AnyField, Renderer};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::weighting::Weighting;
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::scenes::{Folder, words};

/// A round number and a place in a map, whose digits leave nothing round.
const OFFSETS: [[f64; 3]; 2] = [[1.0e6, 1.0e6, 1.0e6], [4_468_123.37, -5_333_987.91, 512.253]];

/// The SRN scene with its cameras moved, poses written with all digits of `f64`.
fn moved(scene: &Path, offset: [f64; 3]) -> Folder {
    let folder = Folder::new();
    for part in ["rgb", "pose", "target_pose"].map(|part| scene.join(part)).iter().filter(|part| part.is_dir()) {
        for file in fs::read_dir(part).expect("a folder").map(|entry| entry.expect("a file").path()) {
            let name = file.strip_prefix(scene).expect("a file of the scene").to_string_lossy().into_owned();
            let bytes = fs::read(&file).expect("a file");
            if name.starts_with("rgb") {
                folder.write(&name, bytes);
                continue;
            }
            let text = String::from_utf8(bytes).expect("a pose");
            let mut numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
            (0..3).for_each(|axis| numbers[4 * axis + 3] += offset[axis]);
            folder.write(&name, words(&numbers));
        }
    }
    folder.write("intrinsics.txt", fs::read(scene.join("intrinsics.txt")).expect("intrinsics"));
    folder
}

fn pictures(scene: &Scene, renderer: &dyn Renderer, sources: &str, targets: &str, side: u32) -> Vec<RgbImage> {
    let selection = Selection { targets: Some(targets.into()), sources: Some(sources.into()), ..Selection::default() };
    let job = selection.resolve(scene, 1).expect("a job");
    let options = RenderOptions { size: Some([side; 2]), ..RenderOptions::default() };
    let frames = render_all(scene, &job, &Weighting::default_scheme(), renderer, &options).expect("pictures");
    frames.into_iter().map(|frame| frame.picture).collect()
}

/// The pictures agree within a level of 255, and show something.
#[track_caller]
fn assert_unmoved(name: &str, field: &AnyField, sources: &str, targets: &str, side: u32) {
    let device = AnyDevice::Cpu(Cpu);
    let renderer = field.on(&device);
    let at = |folder: &Path| {
        let scene = Scene::open(folder).expect("a scene");
        let made = pictures(&scene, renderer.as_ref(), sources, targets, side);
        (scene.frame, made)
    };
    let (_, expected) = at(&data(name));
    assert!(expected.iter().flat_map(|picture| picture.pixels()).any(|pixel| pixel.0.iter().any(|level| *level < 128)));
    for offset in OFFSETS {
        let folder = moved(&data(name), offset);
        let (frame, made) = at(folder.path());
        assert!(frame.origin.length() > 1.0e6, "{frame:?}");
        let levels = made.iter().zip(&expected).flat_map(|(a, b)| a.as_raw().iter().zip(b.as_raw()));
        let differences: Vec<u8> = levels.map(|(a, b)| a.abs_diff(*b)).collect();
        let beyond = differences.iter().filter(|difference| **difference > 1).count();
        let largest = differences.iter().max();
        println!("{name} {offset:?}: largest {largest:?}, beyond 1: {beyond} of {}", differences.len());
        assert_eq!(beyond, 0, "largest difference {largest:?}");
    }
}

fn model(name: &str, options: &FieldOptions) -> AnyField {
    let path = repository().join("host/models").join(name);
    rows::open(Checkpoint::open(&path).expect("a checkpoint"), options).expect("a field")
}

#[test]
fn training_free() {
    assert_unmoved("toy", &AnyField::default(), "0..15", "20,22", 96);
}

#[test]
fn pixelnerf() {
    let field = model("pixelnerf_cars.safetensors", &FieldOptions::default());
    assert_unmoved("car", &field, "16,72,136", "48,160", 64);
}

#[test]
fn genvs() {
    let field = model("genvs_cars.safetensors", &FieldOptions::default().with("steps", "2"));
    assert_unmoved("car", &field, "16,72,136", "48", 64);
}
