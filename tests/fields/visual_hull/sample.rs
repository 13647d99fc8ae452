//! The sample scene: quality, leaving views out, photographs with and without alpha.

use image::{Rgba, RgbaImage};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse::device::cpu::Cpu;
use viewfuse::evaluate::Evaluator;
use viewfuse::evaluate::baseline::Baseline;
use viewfuse::evaluate::metrics::Metrics;
use viewfuse::evaluate::summary::{Observation, Table, table};
use viewfuse::field::On;
use viewfuse::field::render::{Frame, RenderOptions};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::photographs::{Album, BackgroundChoice, PhotographsError, to_rgb8};
use viewfuse::weighting::{OpenedChoice, Weighting};
use viewfuse_tests::fields::{job, on_scene, sample};
use viewfuse_tests::scenes::Folder;

use super::worlds::rendered;

const TRAINING: &str = "000000..000019";

fn sample_folder() -> PathBuf {
    viewfuse_tests::places::data("toy")
}

fn scheme(name: &str) -> Weighting {
    Weighting::open(name).expect("a scheme")
}

fn scores(folder: &Path, schemes: &[&str]) -> Table {
    let scene = Scene::open(folder).expect("the sample");
    let selection = Selection { sources: Some(TRAINING.to_owned()), ..Selection::default() };
    let weightings: Vec<OpenedChoice> = schemes.iter().map(|name| scheme(name).into()).collect();
    let evaluator = Evaluator {
        weightings: &weightings,
        renderer: &On { device: &Cpu, field: &TrainingFree::default() },
        options: &RenderOptions::default(),
        scorer: &Metrics::plain(&Cpu),
        progress: &Silent,
    };
    let scores = evaluator.score_all(&scene, &selection).expect("scores");
    table(&scores.iter().map(|score| Observation { scene: 0, score }).collect::<Vec<_>>())
}

fn psnr_of(table: &Table, scheme: &str) -> f64 {
    let row = table.rows.iter().find(|row| row.scheme == scheme).unwrap_or_else(|| panic!("no row {scheme}"));
    row.cells[0].as_ref().expect("a ratio").value.mean
}

/// The sample with every photograph laid over white, without an alpha channel.
fn flattened_sample() -> Folder {
    let folder = Folder::new();
    let copy = |name: &str| {
        fs::copy(sample_folder().join(name), folder.file(name)).expect("a copy");
    };
    copy("intrinsics.txt");
    for index in 0..24 {
        copy(&format!("pose/{index:06}.txt"));
        let name = format!("rgb/{index:06}.png");
        let straight = image::open(sample_folder().join(&name)).expect("a photograph").into_rgba8();
        let over = |pixel: &Rgba<u8>, c: usize| {
            let alpha = f32::from(pixel[3]) / 255.0;
            (f32::from(pixel[c]) * alpha + 255.0 * (1.0 - alpha)).round() as u8
        };
        let flat = image::RgbImage::from_fn(straight.width(), straight.height(), |x, y| {
            let pixel = straight.get_pixel(x, y);
            image::Rgb([over(pixel, 0), over(pixel, 1), over(pixel, 2)])
        });
        flat.save(folder.file(&name)).expect("a photograph");
    }
    folder
}

#[test]
fn error_weighting_beats_copying_and_the_mean_with_and_without_alpha() {
    let with_alpha = scores(&sample_folder(), &["error:alpha=1", "mean"]);
    let copy = psnr_of(&with_alpha, Baseline::NearestCopy.name());
    let (error, mean) = (psnr_of(&with_alpha, "error:alpha=1"), psnr_of(&with_alpha, "mean"));
    println!("sample: nearest copy {copy:.2} dB, mean {mean:.2} dB, error:alpha=1 {error:.2} dB");
    assert!(error >= copy + 8.0, "{error} dB is not 8 dB above the nearest copy's {copy}");
    assert!(error >= mean + 1.0, "{error} dB is not 1 dB above the mean's {mean}");
    let flat = psnr_of(&scores(flattened_sample().path(), &["error:alpha=1"]), "error:alpha=1");
    println!("sample laid over white: error:alpha=1 {flat:.2} dB");
    // The lorry has nearly white parts: of a thin bright rim before white nobody can tell how much is background.
    assert!((flat - error).abs() <= 0.8, "{flat} dB without alpha, {error} dB with it");
}

/// The sample's first held-out view from six small sources.
fn frame(leave_out: f32) -> (Frame, image::RgbImage) {
    let (scene, field) = (sample("toy"), TrainingFree::default());
    let job = job(&scene, "0..19/3", "20");
    let options = RenderOptions { size: Some([48, 48]), leave_out, ..RenderOptions::default() };
    let weighting = scheme("error:alpha=1");
    on_scene(&scene, &job, &On { device: &Cpu, field: &field }, &options, |stage| {
        stage.weigh(&weighting, &Silent).expect("depths");
        let frame = stage.frame(&weighting, &job.targets[0], &Silent).expect("a frame");
        let mut camera = frame.target.camera;
        camera.pinhole = camera.pinhole.resized(48, 48).expect("a size");
        let plain = rendered(&stage.images, &camera).expect("a picture");
        (frame, to_rgb8(&plain.colours, [48, 48]))
    })
}

#[test]
fn dropped_sources_are_reported_and_none_are_unless_asked() {
    let (whole, plain) = frame(0.0);
    assert_eq!((whole.omission.omitted_count, whole.omission.omitted_weight), (0, 0.0));
    assert_eq!(whole.omission.weights, whole.weights);
    assert!(whole.picture == plain, "leaving nothing out changes the picture");

    let (less, _) = frame(0.3);
    let omission = &less.omission;
    println!("dropped: {} views of weight {}", omission.omitted_count, omission.omitted_weight);
    assert!(omission.omitted_count > 0 && omission.omitted_weight > 0.0 && omission.omitted_weight <= 0.3);
    let left = omission.weights.values().iter().filter(|weight| **weight > 0.0).count() as u32;
    assert_eq!(left + omission.omitted_count, 7, "views used and views left out");
    assert_eq!(less.weights, whole.weights, "the weights before leaving out");
    assert!(less.picture != whole.picture, "leaving views out changes nothing");
    let psnr = |frame: &Frame| frame.truth.as_ref().expect("a truth").psnr;
    println!("all: {:.2} dB, less: {:.2} dB", psnr(&whole), psnr(&less));
}

#[test]
fn a_photograph_of_nothing_is_named() {
    let folder = flattened_sample();
    RgbaImage::from_pixel(128, 128, Rgba([255; 4])).save(folder.file("rgb/000007.png")).expect("a photograph");
    let scene = Scene::open(folder.path()).expect("a scene");
    let album = Album::open(&scene, 0..20, &Silent).expect("photographs");
    let sources: Vec<usize> = (0..20).collect();
    match album.sources(&sources, 128, BackgroundChoice::Colour([1.0; 3]), &Silent) {
        Err(PhotographsError::NoSilhouette(path, colour)) => {
            assert!(path.ends_with("000007.png"), "{path}");
            assert!(colour.contains("255,255,255"), "{colour}");
        }
        other => panic!("{:?}", other.map(|sources| sources.background)),
    }
    // Where nobody said that there is a background, nothing is cut out, and a warning says why.
    let whole = album.sources(&sources, 128, BackgroundChoice::Auto, &Silent).expect("whole photographs");
    assert!(!whole.has_silhouettes);
    assert!(whole.warnings.iter().any(|warning| warning.contains("000007.png")));
}
