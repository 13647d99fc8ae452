//! A scene at ten scales from 1e-9 to 1e9: every scheme gives the same weights and every field the same pictures as at
//! scale 1.
//!
//! Prints a table. `VIEWFUSE_ALL_SCALES=1` renders with every scheme at every scale; the tests do it with one, at two:
//! weights are compared with all.

use std::path::Path;
use tempfile::TempDir;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::AnyField;
use viewfuse::field::render::RenderOptions;
use viewfuse::job::progress::Silent;
use viewfuse::output::weights::WeightTable;
use viewfuse::scene::unit::{RigUnit, SRN_DISTANCE};
use viewfuse::scene::write::{Layout, write};
use viewfuse::scene::{Scene, SceneFrame};
use viewfuse::weighting::sources::SourcePoses;
use viewfuse::weighting::{Weighting, scheme_names};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_tests::fields::{job, model, on_scene, sample};
use viewfuse_tests::places::repository;

const SCALES: [f64; 10] = [1.0e-9, 1.0e-7, 1.0e-5, 1.0e-3, 1.0e-1, 1.0e1, 1.0e3, 1.0e5, 1.0e7, 1.0e9];
/// Those and the schemes of the pictures in the ordinary tests.
const FEW: ([f64; 2], [&str; 1]) = ([1.0e-9, 1.0e5], ["gaussian:beta=1"]);
/// Differences of weights: rounding of poses, times the exponents of attention, whose features have frequencies up to
/// 48.
const MAX_DIFFERENCE: f32 = 2.0e-5;

/// The scene with another unit in its files.
fn scaled(scene: &Scene, scale: f64) -> (TempDir, Scene) {
    let SceneFrame { origin, scale: unit } = scene.frame;
    let frame = SceneFrame { origin: origin * scale, scale: unit * scale };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene");
    write(&Scene { frame, ..scene.clone() }, Layout::Transforms, &path, &Silent).expect("written");
    let read = Scene::open(&path).expect("a scene");
    (folder, read)
}

/// All formulas, and the parameters of the included networks.
fn schemes() -> Vec<String> {
    let learned = ["pixelnerf_cars_attention", "pixelnerf_cars_attention_flat", "genvs_cars_attention"];
    let file = |name| format!("attention:{}", repository().join(format!("host/models/{name}.safetensors")).display());
    scheme_names().into_iter().map(str::to_owned).chain(learned.map(file)).collect()
}

fn all() -> bool {
    std::env::var_os("VIEWFUSE_ALL_SCALES").is_some()
}

#[test]
fn weights_are_the_same() {
    for (name, sources, target) in [("toy", "0..19", "20"), ("room", "0,1,3,4,6,7", "2"), ("car", "16,72,136", "48")] {
        let scene = sample(name);
        let weightings: Vec<Weighting> =
            schemes().iter().map(|scheme| Weighting::open(scheme).expect("a scheme")).collect();
        let table = |scene: &Scene| {
            WeightTable::of(scene, &job(scene, sources, target), &weightings, &Silent).expect("weights")
        };
        let expected = table(&scene);
        // Not all alike: a scheme that ignores the cameras would be the same at every scale, too.
        let gaussian = schemes().iter().position(|scheme| scheme.starts_with("gaussian")).expect("a scheme");
        let weights = expected.weights(gaussian, 0);
        assert!(weights.iter().any(|weight| (weight - weights[0]).abs() > 0.01), "{name}: {weights:?}");
        for scale in SCALES {
            let (_folder, scene) = scaled(&scene, scale);
            let found = table(&scene);
            let apart = |(index, scheme): (usize, String)| {
                let pairs = found.weights(index, 0).iter().zip(expected.weights(index, 0));
                (pairs.map(|(a, b)| (a - b).abs()).max_by(f32::total_cmp).expect("weights"), scheme)
            };
            let all = schemes().into_iter().enumerate().map(apart);
            let (worst, scheme) = all.max_by(|a, b| a.0.total_cmp(&b.0)).expect("schemes");
            println!(
                "| weights | {name} | {scale:e} | {worst:.1e} | {} |",
                scheme.rsplit('/').next().unwrap_or_default()
            );
            assert!(worst <= MAX_DIFFERENCE, "{name} x {scale:e}, {scheme}: weights are {worst} apart");
        }
    }
}

/// The pictures of a target with each of these schemes.
fn pictures(
    scene: &Scene,
    [sources, target]: [&str; 2],
    field: &AnyField,
    size: [u32; 2],
    schemes: &[String],
) -> Vec<Vec<u8>> {
    let (job, device) = (job(scene, sources, target), AnyDevice::Cpu(Cpu));
    let options = RenderOptions { size: Some(size), ..RenderOptions::default() };
    on_scene(scene, &job, field.on(&device).as_ref(), &options, |stage| {
        let picture = |scheme: &String| {
            let weighting = Weighting::open(scheme).expect("a scheme");
            stage.weigh(&weighting, &Silent).expect("encoded");
            stage.frame(&weighting, &job.targets[0], &Silent).expect("a picture").picture.into_raw()
        };
        schemes.iter().map(picture).collect()
    })
}

#[track_caller]
fn assert_same_pictures(field: &str, name: &str, views: [&str; 2], size: [u32; 2]) {
    let opened = match field {
        "training-free" => AnyField::default(),
        name => model(name, 0),
    };
    let (scales, schemes) = match all() {
        true => (SCALES.to_vec(), schemes()),
        false => (FEW.0.to_vec(), FEW.1.map(str::to_owned).to_vec()),
    };
    let scene = sample(name);
    let expected = pictures(&scene, views, &opened, size, &schemes);
    let is_something = |picture: &Vec<u8>| picture.iter().any(|level| level.abs_diff(picture[0]) > 32);
    assert!(expected.iter().all(is_something), "{field}, {name}: an empty picture");
    for scale in scales {
        let (_folder, scene) = scaled(&scene, scale);
        let made = pictures(&scene, views, &opened, size, &schemes);
        let apart = |(a, b): (&Vec<u8>, &Vec<u8>)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
        let (worst, scheme) = made.iter().zip(&expected).map(apart).zip(&schemes).max().expect("a scheme");
        let scheme =
            if worst > 0 { Path::new(scheme).file_name().unwrap_or_default().to_string_lossy() } else { "".into() };
        println!("| {field} | {name} | {scale:e} | {worst}/255 | {scheme} |");
        assert!(worst <= 1, "{field}, {name} x {scale:e}, {scheme}: a picture differs by {worst} of 255");
    }
}

#[test]
fn pictures_are_the_same() {
    assert_same_pictures("training-free", "toy", ["0..19/3", "20"], [32, 32]);
    assert_same_pictures("training-free", "room", ["0,1,3,4", "2"], [32, 24]);
    assert_same_pictures("pixelnerf_cars.safetensors", "car", ["16,72,136", "48"], [24, 24]);
    assert_same_pictures("genvs_cars.safetensors", "car", ["16,72,136", "48"], [24, 24]);
}

/// Four cameras on a ring around the origin.
fn ring(radius: f32) -> Vec<Camera> {
    let pinhole = Pinhole::new([100.0; 2], [32.0; 2], 64, 64).expect("a pinhole");
    let centres = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y].map(|axis| radius * (axis + 0.3 * Vec3::Z).normalize());
    let pose = |centre| Pose::look_at(centre, Vec3::ZERO, Vec3::Z).expect("a pose");
    centres.map(|centre| Camera { pose: pose(centre), pinhole }).to_vec()
}

#[test]
fn srn_keeps_its_bits_and_other_units_become_its_own() {
    let unscaled = ring(SRN_DISTANCE);
    assert!(RigUnit::of(&unscaled).is_world());
    for scale in [1.0e-9_f32, 3.0e-4, 0.5, 2.0, 777.0, 1.0e9] {
        let scaled = ring(SRN_DISTANCE * scale);
        let unit = RigUnit::of(&scaled);
        assert!((unit.length() / scale - 1.0).abs() < 1.0e-5, "{scale}: {unit:?}");
        for (camera, scaled) in unscaled.iter().zip(&scaled) {
            let apart = camera.pose.distance(&unit.pose(&scaled.pose));
            assert!(apart < 1.0e-5, "{scale}: {apart}");
            assert_eq!(unit.pose(&scaled.pose).forward_world(), scaled.pose.forward_world());
        }
        assert_eq!(RigUnit::of_network(&scaled).is_world(), (0.3..4.0).contains(&scale), "{scale}");
    }
}

#[test]
fn cameras_in_one_place_have_no_unit() {
    let cameras = ring(5.0);
    for few in [&cameras[..0], &cameras[..1], &[cameras[1], cameras[1]]] {
        assert!(RigUnit::of(few).is_world());
    }
    assert!(!RigUnit::of(&cameras[..2]).is_world());
}

/// Two sources at the same distance from the target, 2400 units from the object: rounding of squared distances once
/// gave one of them 0.94 of the weight.
#[test]
fn mirrored_neighbours_have_equal_weights() {
    let radius = 2400.0_f32;
    let cameras: Vec<Camera> = ring(radius);
    let unit = RigUnit::of(&cameras);
    let weighting = Weighting::open("gaussian:beta=1").expect("a scheme");
    for turn in [0.01_f32, 0.1, 0.4] {
        let at = |angle: f32| {
            let centre = radius * (Vec3::new(angle.cos(), angle.sin(), 0.3)).normalize();
            unit.pose(&Pose::look_at(centre, Vec3::ZERO, Vec3::Z).expect("a pose"))
        };
        let sources = SourcePoses::new(&[at(1.0 - turn), at(1.0 + turn)]).expect("sources");
        let weights = weighting.weigh(&sources, &at(1.0));
        assert!((weights.get(0) - 0.5).abs() < 1.0e-5, "{turn}: {:?}", &weights.values()[..2]);
    }
}
