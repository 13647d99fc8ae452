//! The layout of Scene Representation Networks (Sitzmann et al. 2019; ShapeNet and many after it).
//!
//! ```text
//! rgb/000000.png ...       photographs
//! pose/000000.txt ...      one per photograph: 16 numbers, row-major camera-to-world, OpenCV axes
//! target_pose/1.txt ...    poses without a photograph (may be absent)
//! intrinsics.txt           focal cx cy 0 / origin / [near plane /] scale / height width [/ 0 or 1]
//!                          or K alone, a matrix of 4x4 or 3x3 numbers (NSVF, BlendedMVS)
//! ```
//!
//! Origin, near plane and scale place the original authors' voxel grid; no pose depends on them. An optional number
//! after the size states whether the poses are world-to-camera (1) instead, as in the authors' own reader.
//!
//! NSVF's names begin with the number of their split: `0_train_0000`, `1_val_0000`, `2_test_0000`. K is for photographs
//! of their own size.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::check;
use super::colmap::Colmap;
use super::error::{SceneError, SceneFault};
use super::fault::{FaultLocation, FileFault, FilePlace, IntrinsicsFault};
use super::files::{self, IMAGE_EXTENSIONS};
use super::llff::Llff;
use super::neus::Neus;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawScene, RawView, Reader};
use super::split::Split;

/// Put before the name of a view from `target_pose/`, which often counts from 1 like the photographs do. A name without
/// a path separator can be the name of an output file.
const TARGET_PREFIX: &str = "target_";

/// ShapeNet scenes of Scene Representation Networks: `rgb/`, `pose/`, `intrinsics.txt`, and `target_pose/`.
pub(super) struct Srn;

impl Reader for Srn {
    fn name(&self) -> &'static str {
        "srn"
    }

    fn form(&self) -> &'static str {
        "a folder with rgb/, pose/ and intrinsics.txt (SRN)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        // One of the two folders is enough, so that the error names the other one if it is missing; photographs of
        // other layouts lie in rgb/, too.
        let is_there = |name: &str| path.join(name).is_dir();
        let others: [&dyn Reader; 3] = [&Neus, &Llff, &Colmap];
        let mut is_other = false;
        if is_there("rgb") && !is_there("pose") {
            for reader in others {
                is_other |= reader.recognise(path)?.is_some();
            }
        }
        let is_here = is_there("rgb") || is_there("pose");
        Ok((is_here && !is_other).then(|| path.to_path_buf()))
    }

    /// Photographs first, then target poses, each in natural order.
    fn read(&self, folder: &Path) -> Result<RawScene, SceneError> {
        let [image_folder, pose_folder, target_folder] = ["rgb", "pose", "target_pose"].map(|name| folder.join(name));
        let photographs = files::list(&image_folder, |path| files::has_extension(path, &IMAGE_EXTENSIONS))?;
        let poses = list_poses(&pose_folder)?;
        check_partners(&photographs, &poses, &image_folder, &pose_folder)?;
        if photographs.is_empty() {
            return Err(FilePlace::file(image_folder).fault(SceneFault::NoViews("*.png, *.jpg")));
        }
        let list = read_intrinsics(&folder.join("intrinsics.txt"))?;

        let mut views = Vec::new();
        for image in photographs {
            let pose = read_pose(&partner(&image, &pose_folder, "txt"), list.form)?;
            let (name, file) = (files::stem(&image), ImageFile::open(&image)?);
            views.push(RawView::new(name, Some(file), pose, Some(list.intrinsics.clone())));
        }
        if target_folder.is_dir() {
            for path in list_poses(&target_folder)? {
                let pose = read_pose(&path, list.form)?;
                let name = format!("{TARGET_PREFIX}{}", files::stem(&path));
                // A target is rendered at the size of the photographs; if these are smaller than in `intrinsics.txt`,
                // so is it.
                views.push(RawView::new(name, None, pose, None));
            }
        }
        let mut scene = RawScene::from(views);
        if list.is_matrix {
            scene.conventions.push("intrinsics.txt: K alone, for the photographs' size (NSVF)".to_string());
            split_by_digit(&mut scene);
        }
        Ok(scene)
    }
}

/// NSVF's splits, if all photographs' names begin with one.
fn split_by_digit(scene: &mut RawScene) {
    const SPLITS: [(&str, Split); 3] = [("0_", Split::Train), ("1_", Split::Validation), ("2_", Split::Test)];
    let split_of =
        |view: &RawView| SPLITS.into_iter().find(|(digit, _)| view.name.starts_with(digit)).map(|named| named.1);
    let has_photograph = |view: &&RawView| view.image.is_some();
    if scene.views.iter().filter(has_photograph).all(|view| split_of(view).is_some()) {
        scene.views.iter_mut().for_each(|view| view.split = split_of(view));
        scene.conventions.push("splits: 0_ training, 1_ validation, 2_ test in names (NSVF)".to_string());
    }
}

fn list_poses(folder: &Path) -> Result<Vec<PathBuf>, SceneError> {
    files::list(folder, |path| path.extension().is_some_and(|extension| extension == "txt"))
}

/// Every photograph must have the pose of its name, and every pose its photograph.
fn check_partners(
    photographs: &[PathBuf],
    poses: &[PathBuf],
    image_folder: &Path,
    pose_folder: &Path,
) -> Result<(), SceneError> {
    let posed: HashSet<&OsStr> = poses.iter().filter_map(|path| path.file_stem()).collect();
    let pictured: HashSet<&OsStr> = photographs.iter().filter_map(|path| path.file_stem()).collect();
    let lacks = |names: &HashSet<&OsStr>, path: &Path| path.file_stem().is_none_or(|name| !names.contains(name));
    if let Some(path) = photographs.iter().find(|path| lacks(&posed, path)) {
        let pose = partner(path, pose_folder, "txt");
        return Err(FilePlace::file(path).fault(SceneFault::ImageWithoutPose(pose)));
    }
    if let Some(path) = poses.iter().find(|path| lacks(&pictured, path)) {
        let image = partner(path, image_folder, "png");
        return Err(FilePlace::file(path).fault(SceneFault::PoseWithoutImage(image)));
    }
    Ok(())
}

/// The file of the same name in another folder.
fn partner(path: &Path, folder: &Path, extension: &str) -> PathBuf {
    files::appended(&folder.join(path.file_stem().unwrap_or_default()), extension)
}

fn read_pose(path: &Path, form: PoseForm) -> Result<RawPose, SceneError> {
    let lines = files::number_lines(path, &files::read_text(path)?)?;
    let numbers: Vec<f64> = lines.into_iter().flat_map(|(_, numbers)| numbers).collect();
    let place = FilePlace::file(path);
    match numbers.as_chunks() {
        (&[a, b, c, d], []) => Ok(RawPose { matrix: [a, b, c, d], form, place }),
        _ => Err(place.fault(FileFault::WrongCount { of: "numbers", expected: 16, found: numbers.len() })),
    }
}

/// The contents of `intrinsics.txt`.
struct IntrinsicsFile {
    intrinsics: RawIntrinsics,
    /// The convention of the poses.
    form: PoseForm,
    /// Whether it is K alone.
    is_matrix: bool,
}

fn read_intrinsics(path: &Path) -> Result<IntrinsicsFile, SceneError> {
    let lines = files::number_lines(path, &files::read_text(path)?)?;
    if let Some(k) = matrix(&lines) {
        return matrix_intrinsics(path, lines[0].0, &k);
    }
    let wrong_count = |location, of, expected, found| {
        Err(FilePlace { path: path.to_path_buf(), location }.fault(FileFault::WrongCount { of, expected, found }))
    };
    let Some(((focal_line, first), rest)) = lines.split_first() else {
        return wrong_count(FaultLocation::File, "lines of numbers", 4, 0);
    };
    let ([focal, x, y] | [focal, x, y, _]) = first[..] else {
        return wrong_count(FaultLocation::Line(*focal_line), "numbers (focal cx cy 0)", 4, first.len());
    };
    // The number of lines before the size differs between files, its shape does not: the only line of two numbers.
    let Some(at) = rest.iter().rposition(|(_, numbers)| numbers.len() == 2) else {
        return wrong_count(FaultLocation::File, "lines with an image size (height width)", 1, 0);
    };
    let (size_line, height, width) = (rest[at].0, rest[at].1[0], rest[at].1[1]);
    let form = match &rest[at + 1..] {
        [(_, flag)] if flag[..] == [1.0] => PoseForm::OpenCvFromWorld,
        [] => PoseForm::WorldFromOpenCv,
        [(_, flag)] if flag[..] == [0.0] => PoseForm::WorldFromOpenCv,
        [(line, _), ..] => {
            return wrong_count(FaultLocation::Line(*line), "lines after the size that are not a lone 0 or 1", 0, 1);
        }
    };
    let (place, size_place) = (FilePlace::line(path, *focal_line), FilePlace::line(path, size_line));
    let size = Some(check::size(&size_place, width, height)?);
    let intrinsics = RawIntrinsics { focal: [focal, focal], principal: [x, y], size, lens: None, place, size_place };
    Ok(IntrinsicsFile { intrinsics, form, is_matrix: false })
}

/// K, where the lines are nothing but a matrix of 3x3 or 4x4 numbers, or one in a line.
fn matrix(lines: &[(usize, Vec<f64>)]) -> Option<[[f64; 4]; 4]> {
    let numbers: Vec<f64> = lines.iter().flat_map(|(_, numbers)| numbers.iter().copied()).collect();
    let side = [3, 4].into_iter().find(|side| numbers.len() == side * side)?;
    let is_square = lines.len() == 1 || lines.iter().all(|(_, numbers)| numbers.len() == side);
    let mut k = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    for (row, numbers) in k.iter_mut().zip(numbers.chunks(side)) {
        row[..side].copy_from_slice(numbers);
    }
    is_square.then_some(k)
}

fn matrix_intrinsics(path: &Path, line: usize, k: &[[f64; 4]; 4]) -> Result<IntrinsicsFile, SceneError> {
    let place = FilePlace::line(path, line);
    let [[focal_x, skew, x, _], [_, focal_y, y, _], ..] = *k;
    let expected = [[focal_x, skew, x, 0.0], [0.0, focal_y, y, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    if *k != expected || skew != 0.0 {
        return Err(place.fault(if *k == expected { IntrinsicsFault::Skew(skew) } else { IntrinsicsFault::Form }));
    }
    let intrinsics = RawIntrinsics::of_photograph([focal_x, focal_y], [x, y], place);
    Ok(IntrinsicsFile { intrinsics, form: PoseForm::WorldFromOpenCv, is_matrix: true })
}
