//! A field, a layout and a weighting of one's own, by the public interface alone: what they give is checked as
//! everything else is, and the render loop takes them.

use std::fmt::Write;
use std::fs;
use tempfile::TempDir;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::AnyField;
use viewfuse::field::render::{RenderOptions, RenderRun, render};
use viewfuse::job::progress::Silent;
use viewfuse::output::run::{Circumstances, RunWriter};
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::{FileFault, FilePlace, READERS, Scene, SceneError, SceneFault};
use viewfuse::weighting::Weighting;
use viewfuse_outside::{LIST, Lines, Nearest, Plane};
use viewfuse_tests::fields::sample;

/// The sample's cameras are as far from its object.
const PLANE: Plane = Plane { depth: 1.3 };

/// The sample scene in a layout of one's own, with every third of its views.
fn in_lines() -> (Scene, TempDir) {
    let (sample, folder) = (sample("toy"), tempfile::tempdir().expect("a folder"));
    let mut list = String::new();
    for (index, view) in sample.views.iter().filter(|view| view.image.is_some()).step_by(3).enumerate() {
        let camera = view.camera;
        let numbers = camera.pose.to_opencv().into_iter().take(3).flatten();
        let words: Vec<String> =
            [camera.pinhole.focal()[0]].into_iter().chain(numbers).map(|n| n.to_string()).collect();
        writeln!(list, "{}", words.join(" ")).expect("a line");
        let photograph = view.image.as_deref().expect("a photograph");
        fs::copy(photograph, folder.path().join(format!("photograph_{index}.png"))).expect("a copy");
    }
    fs::write(folder.path().join(LIST), list).expect("a list");
    (sample, folder)
}

fn open(folder: &TempDir) -> Result<Scene, SceneError> {
    Scene::open_with(folder.path(), &[READERS.as_slice(), &[&Lines]].concat())
}

#[test]
fn field_layout_and_weighting_of_ones_own_render_together() {
    let (_, folder) = in_lines();
    let scene = open(&folder).expect("a scene");
    let device = AnyDevice::Cpu(Cpu);
    let field = AnyField::new(PLANE);
    let renderer = field.on(&device);
    let nearest = Weighting::custom(Nearest);
    let output = tempfile::tempdir().expect("a folder");
    // The third view from the others.
    let targets = Some(scene.views[2].name.clone());
    let job = Selection { targets, ..Selection::default() }.resolve(&scene, 2).expect("a job");
    let options = RenderOptions { size: Some([32, 32]), ..RenderOptions::default() };
    let mut frames = Vec::new();
    let mut writer = RunWriter::new(output.path(), &scene, "lines".to_owned(), &job, &nearest);
    let run = RenderRun { scene: &scene, job: &job, renderer: renderer.as_ref(), options: &options, progress: &Silent };
    let finished = render(&run, &nearest, |sources, frame| {
        frames.push((frame.truth.as_ref().expect("a truth").psnr, frame.depths.clone()));
        writer.write(sources, frame).map_err(Box::<dyn std::error::Error>::from)
    })
    .expect("a picture");
    let (psnr, depths) = &frames[0];
    println!("a plane from the nearest of seven views: {psnr:.1} dB");
    assert!(*psnr > 10.0 && depths.contains(&PLANE.depth) && depths.contains(&0.0));
    let line = finished.record.left_out.first().expect("a line about views");
    assert_eq!((line.what, line.left_out, line.of), ("encoded views", 6, 7), "only the nearest one is used");

    // What a run writes.
    let record = writer.finish(renderer.as_ref(), &options, finished, Circumstances::default()).expect("a record");
    assert_eq!((record.field, record.weighting.as_str(), record.frames.len()), ("plane", "nearest", 1));
    let mut names: Vec<_> =
        fs::read_dir(output.path()).expect("a folder").map(|file| file.expect("a file").file_name()).collect();
    names.sort_unstable();
    assert_eq!(names, ["photograph_2.png", "photograph_2_depth.png", "photograph_2_sheet.png", "run.json"]);
}

#[test]
fn a_layout_of_ones_own_is_opened_as_any_other() {
    let (sample, folder) = in_lines();
    let scene = open(&folder).expect("a scene");
    assert_eq!((scene.layout, scene.views.len()), ("lines", 8));
    for (view, original) in scene.views.iter().zip(sample.views.iter().step_by(3)) {
        assert_eq!(view.camera, original.camera, "{}", view.name);
    }
    // The readers of the crate know nothing of it, and see photographs alone.
    let error = Scene::open(folder.path()).expect_err("an unknown layout").to_string();
    assert!(error.contains("8 photographs, and nothing that gives their poses"), "{error}");
}

#[test]
fn what_a_reader_gives_is_checked() {
    let (_, folder) = in_lines();
    let path = folder.path().join(LIST);
    let list = fs::read_to_string(&path).expect("the list");
    let refused = |changed: String| {
        fs::write(&path, changed).expect("a list");
        open(&folder).expect_err("no scene")
    };
    let first = list.lines().next().expect("a line");
    let words: Vec<&str> = first.split(' ').collect();
    let with = |index: usize, word: &str| {
        let mut words = words.clone();
        words[index] = word;
        list.replacen(first, &words.join(" "), 1)
    };
    let fault_of_line = |changed: String| {
        let SceneError { place, fault } = refused(changed);
        assert_eq!(place, FilePlace::line(&path, 1));
        fault
    };
    assert!(matches!(*fault_of_line(with(1, "5")), SceneFault::Pose(_)));
    assert!(matches!(*fault_of_line(with(0, "-1")), SceneFault::Intrinsics(_)));
    assert!(matches!(*fault_of_line(with(4, "NaN")), SceneFault::File(FileFault::NotFinite(_))));
    assert!(matches!(*refused(String::new()).fault, SceneFault::NoViews(_)));
}
