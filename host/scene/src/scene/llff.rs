//! The layout of Local Light Field Fusion (Mildenhall et al. 2019): `poses_bounds.npy` next to the photographs.
//!
//! A row for each photograph, in the order of the photographs' names: 15 numbers are a 3x5 matrix, row-major, whose
//! first three columns are the camera's axes in the world (down, right, backwards), whose fourth is its centre and
//! whose fifth holds height, width and focal length of the full photograph in pixels; two numbers are the near and the
//! far bound of the photograph. The principal point is the centre of the photograph.
//!
//! Photographs are those of `images`, or without it of `images_2`, `images_4`, `images_8` and so on: of the folders
//! with as many photographs as there are rows, the one with the largest photographs. Intrinsics scale with them.
//!
//! The poses are made from a COLMAP model. If the model is in the same folder, its points are the scene's.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::check;
use super::colmap::{self, Origin};
use super::error::{SceneError, SceneFault};
use super::fault::{FileFault, FilePlace};
use super::files::{self, IMAGE_EXTENSIONS};
use super::numpy;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPoint, RawPose, RawScene, RawView, Reader};

const FILE_NAME: &str = "poses_bounds.npy";

/// Numbers in a row.
const ROW: usize = 17;

/// Centres of a row and of its image in a COLMAP model may differ by this share of their coordinates.
const SAME_CENTRE: f64 = 1.0e-4;

/// LLFF: `poses_bounds.npy` beside `images`, `images_4`, `images_8`.
pub(super) struct Llff;

impl Reader for Llff {
    fn name(&self) -> &'static str {
        "llff"
    }

    fn form(&self) -> &'static str {
        "a folder with poses_bounds.npy and images/ or images_N/ (LLFF)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        let is_named = path.file_name().is_some_and(|name| name == FILE_NAME);
        let file = if is_named { path.to_path_buf() } else { path.join(FILE_NAME) };
        Ok(file.is_file().then_some(file))
    }

    fn read(&self, file: &Path) -> Result<RawScene, SceneError> {
        let array = numpy::read_npy(file)?;
        let rows: Vec<&[f64]> = match array.shape[..] {
            [_, ROW] => array.values.chunks_exact(ROW).collect(),
            _ => {
                let found = array.shape.get(1).copied().unwrap_or(array.values.len());
                let fault = FileFault::WrongCount { of: "numbers in a row", expected: ROW, found };
                return Err(FilePlace::file(file).fault(fault));
            }
        };
        let (images, warning) = photographs(file, rows.len())?;
        let views = rows.iter().enumerate().zip(images).map(|((row, numbers), image)| view(file, row, numbers, &image));
        let mut scene = RawScene::from(views.collect::<Result<Vec<_>, _>>()?);
        scene.warnings.extend(warning);
        let reason = match colmap::beside(&file.with_file_name("")) {
            Ok(None) => None,
            Ok(Some(origin)) => match points(file, &scene.views, origin)? {
                Ok((points, path)) => {
                    (scene.points, scene.points_path) = (points, path);
                    None
                }
                Err(reason) => Some(reason),
            },
            Err(error) => Some(error.to_string()),
        };
        scene.warnings.extend(reason.map(|reason| format!("{reason}; the scene is read without its points")));
        Ok(scene)
    }
}

/// Refuses photographs that stand at other rows than images of their names: where one was removed and another one
/// added, each of those between them would have its neighbour's pose. Smaller photographs are often numbered anew; then
/// no name is the same.
fn check_names(file: &Path, views: &[RawView], names: &[String]) -> Result<(), SceneError> {
    let stems = || names.iter().map(|name| files::stem(Path::new(name)));
    let known: HashSet<String> = stems().collect();
    if !views.iter().any(|view| known.contains(&view.name)) {
        return Ok(());
    }
    // Photographs that are numbered anew, from 0 in the place of 1: all names differ by the same number.
    let number = |name: &str| files::trailing_number(name).map(|number| number as i64);
    let shift = |view: &RawView, stem: &str| Some(number(&view.name)? - number(stem)?);
    let shifts: HashSet<Option<i64>> = views.iter().zip(stems()).map(|(view, stem)| shift(view, &stem)).collect();
    if shifts.len() == 1 && !shifts.contains(&None) {
        return Ok(());
    }
    match views.iter().zip(stems()).enumerate().find(|(_, (view, stem))| view.name != *stem) {
        Some((row, (view, stem))) => {
            let (row, view) = (format!("row {row}, of '{stem}' by the COLMAP model beside it,"), &view.name);
            let photograph = format!("the photograph '{view}' in its place");
            Err(FilePlace::file(file).fault(FileFault::Contradiction(row, photograph)))
        }
        None => Ok(()),
    }
}

/// Points and their file, or why they are not the scene's.
type Points = Result<(Vec<RawPoint>, PathBuf), String>;

/// The points of the COLMAP model that the poses were made from.
fn points(file: &Path, views: &[RawView], origin: Origin) -> Result<Points, SceneError> {
    let Origin { names, cameras_from_world, points, points_path } = origin;
    // Each centre, from `[R | t]` and from the row: -R^T t.
    let differs = |(m, view): (&[[f64; 4]; 4], &RawView)| {
        let c = &view.pose.matrix;
        let centre = |axis: usize| -(m[0][axis] * m[0][3] + m[1][axis] * m[1][3] + m[2][axis] * m[2][3]);
        let offset = |axis: usize| centre(axis) - c[axis][3];
        let size = 1.0 + [0, 1, 2].map(|row| m[row][3].abs()).into_iter().fold(0.0, f64::max);
        // A NaN counts as different.
        !((0..3).all(|axis| offset(axis).abs() <= SAME_CENTRE * size))
    };
    if cameras_from_world.len() != views.len() || cameras_from_world.iter().zip(views).any(differs) {
        return Ok(Err(format!("{}: its rows are not the images of the COLMAP model beside it", file.display())));
    }
    check_names(file, views, &names)?;
    Ok(Ok((points, points_path)))
}

/// The photographs in the order of their names (by character, as the authors' code sorts them), and a warning where a
/// folder of larger ones has others.
fn photographs(file: &Path, row_count: usize) -> Result<(Vec<PathBuf>, Option<String>), SceneError> {
    let root = file.with_file_name("");
    let mut wrong = None;
    for folder in files::image_folders(&root)? {
        let mut images = files::list(&folder, |path| files::has_extension(path, &IMAGE_EXTENSIONS))?;
        images.sort();
        match images.len() {
            0 => {}
            count if count == row_count => {
                let told = wrong.map(|(larger, found): (PathBuf, usize)| {
                    format!(
                        "{}: {found} photographs for the {row_count} rows of poses_bounds.npy: those of {} are taken",
                        larger.display(),
                        folder.display()
                    )
                });
                return Ok((images, told));
            }
            found => _ = wrong.get_or_insert((folder, found)),
        }
    }
    Err(match wrong {
        Some((path, found)) => {
            let of = "photographs (rows of poses_bounds.npy)";
            FilePlace::file(path).fault(FileFault::WrongCount { of, expected: row_count, found })
        }
        None => FilePlace::file(root).fault(SceneFault::NoViews("images/, images_2/, images_4/, images_8/")),
    })
}

fn view(file: &Path, row: usize, numbers: &[f64], image: &Path) -> Result<RawView, SceneError> {
    let place = FilePlace::key(file, format!("row {row}"));
    let at = |line: usize, column: usize| numbers[5 * line + column];
    let row = |line: usize| [at(line, 1), at(line, 0), -at(line, 2), at(line, 3)];
    let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    let size = check::size(&place, at(1, 4), at(0, 4))?;
    let intrinsics = RawIntrinsics::centred(at(2, 4), size, place.clone());
    let pose = RawPose { matrix, form: PoseForm::WorldFromOpenCv, place };
    let mut view = RawView::new(files::stem(image), Some(ImageFile::open(image)?), pose, Some(intrinsics));
    view.near_far = Some([numbers[15], numbers[16]]);
    Ok(view)
}
