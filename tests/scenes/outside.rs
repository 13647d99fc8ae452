//! A layout and a weighting of one's own, by the public interface alone: what they give is checked as everything else is,
//! and the render loop takes them.

use image::RgbImage;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use viewfuse::core::pose::Pose;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::On;
use viewfuse::field::render::{Frame, RenderError, RenderOptions, render};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawView, Reader, number_lines, read_text};
use viewfuse::scene::{Place, READERS, Scene, SceneError};
use viewfuse::weighting::sources::{MOST_SOURCES, SourcePoses, SourceWeights};
use viewfuse::weighting::{Weigh, Weighting};
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::Folder;

/// `cameras.list`: of `photograph_0.png` and so on a line each, the focal length, then the pose's upper three rows.
struct Lines;

const LIST: &str = "cameras.list";

impl Reader for Lines {
    fn name(&self) -> &'static str {
        "lines"
    }

    fn form(&self) -> &'static str {
        "a folder with cameras.list"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        let list = path.join(LIST);
        Ok(list.is_file().then_some(list))
    }

    fn read(&self, list: &Path) -> Result<Vec<RawView>, SceneError> {
        let lines = number_lines(list, &read_text(list)?)?;
        lines.iter().enumerate().map(|(index, (line, numbers))| view(list, index, *line, numbers)).collect()
    }
}

fn view(list: &Path, index: usize, line: usize, numbers: &[f64]) -> Result<RawView, SceneError> {
    let (path, place) = (list.to_path_buf(), Place::Line(line));
    let Ok([focal, pose @ ..]) = <[f64; 13]>::try_from(numbers) else {
        return Err(SceneError::WrongCount { path, place, of: "numbers", expected: 13, found: numbers.len() });
    };
    let mut matrix = [0.0; 16];
    matrix[..12].copy_from_slice(&pose);
    matrix[15] = 1.0;
    let name = format!("photograph_{index}");
    let image = ImageFile::open(&list.with_file_name(format!("{name}.png")))?;
    let size = image.size();
    let intrinsics = RawIntrinsics {
        focal: [focal; 2],
        principal: size.map(|side| f64::from(side) / 2.0),
        size,
        path: path.clone(),
        place: place.clone(),
        size_place: place.clone(),
    };
    let pose = RawPose { matrix, form: PoseForm::WorldFromOpenCv, path, place };
    Ok(RawView { name, image: Some(image), pose, intrinsics: Some(intrinsics) })
}

/// The nearest source counts, and no other.
struct Nearest;

impl Weigh for Nearest {
    fn name(&self) -> String {
        "nearest".to_owned()
    }

    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        let distance = |view: &u32| sources.pose(*view).distance(target);
        let nearest = (0..sources.count()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut scores = [0.0; MOST_SOURCES];
        scores[nearest.unwrap_or(0) as usize] = 1.0;
        SourceWeights::from_scores(&scores, sources.count())
    }
}

/// The sample scene in the layout above, with every third of its views.
fn sample() -> (Scene, Folder) {
    let sample = Scene::open(data("toy")).expect("the sample");
    let folder = Folder::new();
    let mut list = String::new();
    for (index, view) in sample.views.iter().filter(|view| view.image.is_some()).step_by(3).enumerate() {
        let camera = view.camera;
        let numbers = camera.pose.to_opencv().into_iter().take(3).flatten();
        let words: Vec<String> =
            [camera.pinhole.focal()[0]].into_iter().chain(numbers).map(|n| n.to_string()).collect();
        writeln!(list, "{}", words.join(" ")).expect("a line");
        let photograph = view.image.as_deref().expect("a photograph");
        std::fs::copy(photograph, folder.file(&format!("photograph_{index}.png"))).expect("a copy");
    }
    folder.write(LIST, list);
    (sample, folder)
}

fn open(folder: &Folder) -> Result<Scene, SceneError> {
    Scene::open_with(folder.path(), &[READERS.as_slice(), &[&Lines]].concat())
}

/// The picture of the third view from the others, at 32x32.
fn picture(scene: &Scene, weighting: &Weighting) -> Frame {
    let targets = Some(scene.views[2].name.clone());
    let job = Selection { targets, ..Selection::default() }.resolve(scene, 2).expect("a job");
    let options = RenderOptions { size: Some([32, 32]), ..RenderOptions::default() };
    let mut frames = Vec::new();
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    render(scene, &job, weighting, &renderer, &options, &Silent, |_, frame| {
        frames.push(frame);
        Ok::<_, RenderError>(())
    })
    .expect("a picture");
    frames.remove(0)
}

#[test]
fn a_layout_of_ones_own_is_opened_and_rendered() {
    let (sample, folder) = sample();
    let scene = open(&folder).expect("a scene");
    assert_eq!((scene.layout, scene.views.len()), ("lines", 8));
    for (view, original) in scene.views.iter().zip(sample.views.iter().step_by(3)) {
        assert_eq!(view.camera, original.camera, "{}", view.name);
    }
    let frame = picture(&scene, &Weighting::default_scheme());
    let flat = RgbImage::from_pixel(32, 32, *frame.picture.get_pixel(0, 0));
    assert_ne!(frame.picture, flat, "nothing was rendered");
    assert!(frame.truth.is_some_and(|truth| truth.psnr > 15.0));
    // The readers of the crate know nothing of it, and say what they look for.
    let error = Scene::open(folder.path()).expect_err("an unknown layout").to_string();
    assert!(error.contains("no scene here; looked for a folder with transforms.json"), "{error}");
}

#[test]
fn what_a_reader_gives_is_checked() {
    let (_, folder) = sample();
    let list = std::fs::read_to_string(folder.path().join(LIST)).expect("the list");
    let refused = |changed: String| {
        folder.write(LIST, changed);
        open(&folder).expect_err("no scene")
    };
    let first = list.lines().next().expect("a line");
    let words: Vec<&str> = first.split(' ').collect();
    let with = |index: usize, word: &str| {
        let mut words = words.clone();
        words[index] = word;
        list.replacen(first, &words.join(" "), 1)
    };
    assert!(matches!(refused(with(1, "5")), SceneError::Pose { place: Place::Line(1), .. }));
    assert!(matches!(refused(with(0, "-1")), SceneError::Intrinsics { place: Place::Line(1), .. }));
    assert!(matches!(refused(with(4, "NaN")), SceneError::NotFinite { place: Place::Line(1), .. }));
    assert!(matches!(refused(String::new()), SceneError::NoViews { .. }));
}

#[test]
fn a_weighting_of_ones_own_is_rendered_with() {
    let scene = Scene::open(data("toy")).expect("the sample");
    let nearest = Weighting::custom(Nearest);
    assert_eq!(nearest.to_string(), "nearest");
    let frame = picture(&scene, &nearest);
    let weights = frame.weights.values();
    assert_eq!(weights.iter().filter(|weight| **weight > 0.0).count(), 1);
    assert!(weights.contains(&1.0));
    assert_ne!(frame.picture, picture(&scene, &Weighting::default_scheme()).picture);
}
