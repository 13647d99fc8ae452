//! The layout of Scene Representation Networks (Sitzmann et al. 2019; ShapeNet and many after it).
//!
//! ```text
//! rgb/000000.png ...       photographs
//! pose/000000.txt ...      one per photograph: 16 numbers, row-major camera-to-world, OpenCV axes
//! target_pose/1.txt ...    poses without a photograph (may be absent)
//! intrinsics.txt           focal cx cy 0 / origin / [near plane /] scale / height width [/ 0 or 1]
//! ```
//!
//! Origin, near plane and scale place the original authors' voxel grid; no pose depends on them. The number that may
//! follow the size says whether the poses are world-to-camera (1) instead, as in the authors' own reader.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;

use super::View;
use super::check::{self, Axes, Intrinsics};
use super::error::SceneError;
use super::fault::Place;
use super::files::{self, IMAGE_EXTENSIONS};
use super::images;

/// Put before the name of a view from `target_pose/`, which often counts from 1 like the photographs do. A name
/// without a separator of folders can be the name of an output file.
const TARGET_PREFIX: &str = "target_";

/// All views of an SRN folder: photographs first, then target poses, each in natural order.
pub(super) fn read(folder: &Path) -> Result<Vec<View>, SceneError> {
    let image_folder = folder.join("rgb");
    let photographs = files::list(&image_folder, |path| files::has_extension(path, &IMAGE_EXTENSIONS))?;
    let pose_folder = folder.join("pose");
    let poses = list_poses(&pose_folder)?;
    check_partners(&photographs, &poses, &image_folder, &pose_folder)?;
    if photographs.is_empty() {
        return Err(SceneError::NoViews { path: image_folder, looked_for: "*.png, *.jpg" });
    }
    let list = read_intrinsics(&folder.join("intrinsics.txt"))?;

    let mut views = Vec::new();
    for image in photographs {
        let name = files::stem(&image);
        let pinhole = list.pinhole_of(&image)?;
        let pose = read_pose(&pose_folder.join(format!("{name}.txt")), list.inverse)?;
        views.push(View { name, camera: Camera { pose, pinhole }, image: Some(image) });
    }
    let target_folder = folder.join("target_pose");
    // A target is rendered at the size of the photographs; where these are smaller than `intrinsics.txt` says, so is it.
    if let Some(pinhole) = views.first().map(|view| view.camera.pinhole)
        && target_folder.is_dir()
    {
        for path in list_poses(&target_folder)? {
            let pose = read_pose(&path, list.inverse)?;
            let name = format!("{TARGET_PREFIX}{}", files::stem(&path));
            views.push(View { name, camera: Camera { pose, pinhole }, image: None });
        }
    }
    Ok(views)
}

fn list_poses(folder: &Path) -> Result<Vec<PathBuf>, SceneError> {
    files::list(folder, |path| path.extension().is_some_and(|extension| extension == "txt"))
}

/// Every photograph must have the pose of its name and the other way round.
fn check_partners(
    photographs: &[PathBuf],
    poses: &[PathBuf],
    image_folder: &Path,
    pose_folder: &Path,
) -> Result<(), SceneError> {
    let posed: HashSet<String> = poses.iter().map(|path| files::stem(path)).collect();
    let pictured: HashSet<String> = photographs.iter().map(|path| files::stem(path)).collect();
    for (path, name) in photographs.iter().map(|path| (path, files::stem(path))) {
        if !posed.contains(&name) {
            let pose = pose_folder.join(format!("{name}.txt"));
            return Err(SceneError::ImageWithoutPose { path: path.clone(), pose });
        }
    }
    for (path, name) in poses.iter().map(|path| (path, files::stem(path))) {
        if !pictured.contains(&name) {
            let image = image_folder.join(format!("{name}.png"));
            return Err(SceneError::PoseWithoutImage { path: path.clone(), place: Place::File, image });
        }
    }
    Ok(())
}

fn read_pose(path: &Path, inverse: bool) -> Result<Pose, SceneError> {
    let lines = files::number_lines(path, &files::read_text(path)?)?;
    let numbers: Vec<f64> = lines.into_iter().flat_map(|(_, numbers)| numbers).collect();
    let Ok(matrix) = <[f64; 16]>::try_from(numbers.as_slice()) else {
        let (path, place, found) = (path.to_path_buf(), Place::File, numbers.len());
        return Err(SceneError::WrongCount { path, place, of: "numbers", expected: 16, found });
    };
    if inverse {
        check::pose_from_inverse(path, Place::File, &matrix)
    } else {
        check::pose(path, Place::File, &matrix, Axes::OpenCv)
    }
}

/// What `intrinsics.txt` says.
struct IntrinsicsFile {
    path: PathBuf,
    intrinsics: Intrinsics,
    /// Where the focal length stands.
    focal_line: usize,
    /// Where the size stands.
    size_line: usize,
    /// The poses are world-to-camera.
    inverse: bool,
}

impl IntrinsicsFile {
    fn pinhole_of(&self, image: &Path) -> Result<Pinhole, SceneError> {
        // Numbers first, so that a bad focal length is reported at its own line and not at that of the size.
        self.intrinsics.pinhole(&self.path, Place::Line(self.focal_line))?;
        self.intrinsics.pinhole_of(&self.path, Place::Line(self.size_line), image, images::size(image)?)
    }
}

fn read_intrinsics(path: &Path) -> Result<IntrinsicsFile, SceneError> {
    let lines = files::number_lines(path, &files::read_text(path)?)?;
    let wrong_count = |place, of, expected, found| {
        Err(SceneError::WrongCount { path: path.to_path_buf(), place, of, expected, found })
    };
    let Some(((focal_line, first), rest)) = lines.split_first() else {
        return wrong_count(Place::File, "lines of numbers", 4, 0);
    };
    let ([focal, x, y] | [focal, x, y, _]) = first[..] else {
        return wrong_count(Place::Line(*focal_line), "numbers (focal cx cy 0)", 4, first.len());
    };
    // The number of lines before the size differs between files, its shape does not: the only line of two numbers.
    let Some(at) = rest.iter().rposition(|(_, numbers)| numbers.len() == 2) else {
        return wrong_count(Place::File, "lines with an image size (height width)", 1, 0);
    };
    let (size_line, height, width) = (rest[at].0, rest[at].1[0], rest[at].1[1]);
    let inverse = match &rest[at + 1..] {
        [] => false,
        [(_, flag)] if flag[..] == [0.0] || flag[..] == [1.0] => flag[0] == 1.0,
        [(line, _), ..] => {
            return wrong_count(Place::Line(*line), "lines after the size that are not a lone 0 or 1", 0, 1);
        }
    };
    let size = check::size(path, Place::Line(size_line), width, height)?;
    let intrinsics = Intrinsics { focal: [focal, focal], principal: [x, y], size };
    Ok(IntrinsicsFile { path: path.to_path_buf(), intrinsics, focal_line: *focal_line, size_line, inverse })
}
