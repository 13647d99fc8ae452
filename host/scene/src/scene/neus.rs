//! The layout of NeuS and IDR (DTU, BlendedMVS): `cameras_sphere.npz` (or another `cameras*.npz`), `image/`, `mask/`.
//!
//! For each photograph the archive has `world_mat_N`, a 4x4 matrix whose first three rows project world points to
//! pixels, and mostly `scale_mat_N`, which places the unit sphere around the object in that world. The scene's world is
//! the unit sphere's: the projection is `P = world_mat_N scale_mat_N`, decomposed in f64 into `K [R | t]` by an RQ
//! decomposition. The near and far bounds are those of the sphere, if the archive has one and the camera is outside of
//! it.
//!
//! A photograph belongs to the matrix with the number that its name ends in, if all have one and these differ;
//! otherwise to that of its position. `mask/` holds masks of the same names or numbers. Pixel `(0, 0)` is the centre of
//! the top left pixel there; here that is `(0.5, 0.5)`.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::error::{SceneError, SceneFault};
use super::fault::{FileFault, FilePlace, IntrinsicsFault};
use super::files::{self, IMAGE_EXTENSIONS};
use super::masks::meaning::MaskMeaning;
use super::missing::Missing;
use super::numpy::{self, NumpyArray};
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawScene, RawView, Reader};

/// Names of the archive, in the order in which they are searched; then any other `cameras*.npz`.
const FILE_NAMES: [&str; 3] = ["cameras_sphere.npz", "cameras.npz", "cameras_large.npz"];
/// Folders of photographs.
const IMAGE_FOLDERS: [&str; 3] = ["image", "images", "rgb"];
const MASK_FOLDERS: [&str; 2] = ["mask", "masks"];
/// Prefix of the projections' names, before their number.
const WORLD: &str = "world_mat_";
/// Prefix of the spheres' names.
const SCALE: &str = "scale_mat_";
/// Largest skew that rounding of 32-bit matrices may cause, in pixels.
const MAX_SKEW: f64 = 0.05;

/// The layout's name.
pub(crate) const NAME: &str = "neus";

/// NeuS and IDR: `cameras*.npz`, `image/`, `mask/`.
pub(super) struct Neus;

impl Reader for Neus {
    fn name(&self) -> &'static str {
        NAME
    }

    fn form(&self) -> &'static str {
        "a folder with cameras_sphere.npz (or another cameras*.npz) and image/ (NeuS, DTU)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        let is_archive = |path: &Path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            name.starts_with("cameras") && name.ends_with(".npz")
        };
        if !path.is_dir() {
            return Ok(is_archive(path).then(|| path.to_path_buf()));
        }
        if let Some(file) = FILE_NAMES.iter().map(|name| path.join(name)).find(|file| file.is_file()) {
            return Ok(Some(file));
        }
        Ok(files::list(path, is_archive)?.into_iter().next())
    }

    fn read(&self, file: &Path) -> Result<RawScene, SceneError> {
        let matrices = numpy::read_npz(file, |name| numbered(name, WORLD).or(numbered(name, SCALE)).is_some())?;
        let mut worlds: BTreeMap<u64, &NumpyArray> = BTreeMap::new();
        for (name, array) in &matrices {
            if let Some(number) = numbered(name, WORLD) {
                worlds.insert(number, array);
            }
        }
        let root = file.with_file_name("");
        let folder = IMAGE_FOLDERS.iter().map(|name| root.join(name)).find(|folder| folder.is_dir());
        let folder = folder.unwrap_or_else(|| root.join(IMAGE_FOLDERS[0]));
        let images = files::list(&folder, |path| files::has_extension(path, &IMAGE_EXTENSIONS))?;
        if images.is_empty() || worlds.is_empty() {
            let place = FilePlace::file(if worlds.is_empty() { file } else { &folder });
            return Err(place.fault(SceneFault::NoViews("photographs in image/, world_mat_0 in the archive")));
        }
        let stems: Vec<String> = images.iter().map(|image| files::stem(image)).collect();
        let stems: Vec<&str> = stems.iter().map(String::as_str).collect();
        let numbers = matrices_of(&stems, &worlds.keys().copied().collect()).ok_or_else(|| {
            let (of, expected, found) = ("matrices world_mat_N (one a photograph)", images.len(), worlds.len());
            FilePlace::file(file).fault(FileFault::WrongCount { of, expected, found })
        })?;
        let masks = masks(&root, &images)?;
        let mut missing = Missing::default();
        for number in worlds.keys() {
            if numbers.contains(number) {
                missing.found();
            } else {
                let place = FilePlace::key(file, format!("{WORLD}{number}"));
                missing.missed(place, folder.join(format!("{number:06}.png")));
            }
        }
        let mut views = Vec::new();
        for (image, number) in images.iter().zip(&numbers) {
            let mut view = view(file, *number, &matrices, image)?;
            view.mask = masks.get(&files::trailing_number(&files::stem(image)).unwrap_or(*number)).cloned();
            views.push(view);
        }
        let mut warnings: Vec<String> = missing.warning(file)?.into_iter().collect();
        // Names that count from 1, of which the last is missing, are the numbers of matrices, too.
        let lacks_first = worlds.keys().next().is_some_and(|first| !numbers.contains(first));
        if lacks_first && numbers.len() + 1 == worlds.len() {
            let (first, last) = (numbers.iter().min().unwrap_or(&0), numbers.iter().max().unwrap_or(&0));
            warnings.push(format!(
                "{}: photographs are numbered {first} to {last}, and the matrices begin before: where names count from 1, \
                 each photograph has the next one's pose; give names the numbers of their matrices",
                file.display()
            ));
        }
        Ok(RawScene { views, warnings, ..RawScene::default() })
    }

    fn masks(&self) -> Option<MaskMeaning> {
        Some(MaskMeaning::Object)
    }
}

/// The number behind a prefix.
fn numbered(name: &str, prefix: &str) -> Option<u64> {
    name.strip_prefix(prefix)?.parse().ok()
}

/// The matrix of each photograph, by their names in the order in which they are listed: those of different numbers in
/// the names, if the archive has all of them; otherwise one after the other, if there are as many; otherwise none.
pub(crate) fn matrices_of(names: &[&str], worlds: &BTreeSet<u64>) -> Option<Vec<u64>> {
    let by_name: Option<Vec<u64>> = names.iter().map(|name| files::trailing_number(name)).collect();
    let fit = |numbers: &Vec<u64>| {
        let mut seen = HashSet::new();
        numbers.iter().all(|number| worlds.contains(number) && seen.insert(*number))
    };
    let in_order = || (names.len() == worlds.len()).then(|| worlds.iter().copied().collect());
    by_name.filter(fit).or_else(in_order)
}

/// Masks by the number that their names end in; those with a photograph's name are found by it ([`super::masks`]).
fn masks(root: &Path, images: &[PathBuf]) -> Result<BTreeMap<u64, PathBuf>, SceneError> {
    let Some(folder) = MASK_FOLDERS.iter().map(|name| root.join(name)).find(|folder| folder.is_dir()) else {
        return Ok(BTreeMap::new());
    };
    let names: HashSet<_> = images.iter().map(|image| image.file_stem()).collect();
    let is_numbered = |path: &Path| files::has_extension(path, &IMAGE_EXTENSIONS) && !names.contains(&path.file_stem());
    let masks = files::list(&folder, is_numbered)?;
    Ok(masks.into_iter().filter_map(|mask| Some((files::trailing_number(&files::stem(&mask))?, mask))).collect())
}

/// A 4x4 matrix (of a 3x4 one the last row is `0 0 0 1`).
fn matrix(
    file: &Path,
    name: &str,
    matrices: &BTreeMap<String, NumpyArray>,
) -> Result<Option<[[f64; 4]; 4]>, SceneError> {
    let Some(array) = matrices.get(name) else { return Ok(None) };
    let rows = match array.shape[..] {
        [4, 4] => 4,
        [3, 4] => 3,
        _ => {
            let fault = FileFault::WrongCount { of: "numbers (4 x 4)", expected: 16, found: array.values.len() };
            return Err(FilePlace::key(file, name).fault(fault));
        }
    };
    let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (row, numbers) in matrix.iter_mut().zip(array.values.chunks_exact(4)).take(rows) {
        row.copy_from_slice(numbers);
    }
    Ok(Some(matrix))
}

fn view(
    file: &Path,
    number: u64,
    matrices: &BTreeMap<String, NumpyArray>,
    image: &Path,
) -> Result<RawView, SceneError> {
    let key = format!("{WORLD}{number}");
    let world = matrix(file, &key, matrices)?.unwrap_or_default();
    let scale = matrix(file, &format!("{SCALE}{number}"), matrices)?;
    let projection = match scale {
        Some(scale) => product(&world, &scale),
        None => world,
    };
    let place = FilePlace::key(file, key);
    let fault = |fault: IntrinsicsFault| place.clone().fault(fault);
    let ProjectionParts { k, camera_from_world, centre } =
        take_apart(&projection).ok_or_else(|| fault(IntrinsicsFault::Projection))?;
    let skew = k.y_axis.x;
    if skew.abs() > MAX_SKEW {
        return Err(fault(IntrinsicsFault::Skew(skew)));
    }
    let r = camera_from_world.transpose();
    let row = |row: usize| [r.col(0)[row], r.col(1)[row], r.col(2)[row], centre[row]];
    let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    let (focal, principal) = ([k.x_axis.x, k.y_axis.y], [k.z_axis.x + 0.5, k.z_axis.y + 0.5]);
    let intrinsics = RawIntrinsics::of_photograph(focal, principal, place.clone());
    let pose = RawPose { matrix, form: PoseForm::WorldFromOpenCv, place };
    let mut view = RawView::new(files::stem(image), Some(ImageFile::open(image)?), pose, Some(intrinsics));
    let depth = -centre.dot(r.z_axis);
    view.near_far = (scale.is_some() && depth > 1.0).then_some([depth - 1.0, depth + 1.0]);
    Ok(view)
}

fn product(a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let entry = |row: usize, column: usize| (0..4).map(|k| a[row][k] * b[k][column]).sum();
    std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))
}

/// A projection `K R (X - centre)`; `K` upper triangular with a positive diagonal and a last entry of 1, `R` a
/// rotation.
struct ProjectionParts {
    k: DMat3,
    camera_from_world: DMat3,
    centre: DVec3,
}

/// `None` for a projection that is singular or not finite.
fn take_apart(projection: &[[f64; 4]; 4]) -> Option<ProjectionParts> {
    let row = |row: usize| DVec3::new(projection[row][0], projection[row][1], projection[row][2]);
    let largest = (0..3).map(|r| row(r).length()).fold(0.0, f64::max);
    // A projection means the same at any scale; of the two signs, the one that makes R a rotation.
    let handed = row(0).cross(row(1)).dot(row(2));
    let scale = 1.0 / (largest * handed.signum());
    if !(scale.is_finite() && handed != 0.0) {
        return None;
    }
    let [first, second, third] = [0, 1, 2].map(|r| row(r) * scale);
    let last = DVec3::new(projection[0][3], projection[1][3], projection[2][3]) * scale;
    // RQ by Gram and Schmidt from the last row up: twice, so that R is orthonormal to the last bits.
    let z = third.normalize();
    let y = orthogonal(second, &[z])?;
    let x = orthogonal(first, &[z, y])?;
    let (k22, k11, k00) = (third.dot(z), second.dot(y), first.dot(x));
    let (k12, k02, k01) = (second.dot(z), first.dot(z), first.dot(y));
    let columns = [DVec3::new(k00, 0.0, 0.0), DVec3::new(k01, k11, 0.0), DVec3::new(k02, k12, k22)];
    let k = DMat3::from_cols(columns[0], columns[1], columns[2]) * (1.0 / k22);
    let camera_from_world = DMat3::from_cols(x, y, z).transpose();
    let centre = -(DMat3::from_cols(first, second, third).transpose().inverse() * last);
    let is_finite = k.is_finite() && camera_from_world.is_finite() && centre.is_finite();
    is_finite.then_some(ProjectionParts { k, camera_from_world, centre })
}

/// The unit vector along the component of `vector` that is orthogonal to these unit vectors.
fn orthogonal(vector: DVec3, to: &[DVec3]) -> Option<DVec3> {
    let mut rest = vector;
    for _ in 0..2 {
        for other in to {
            rest -= *other * rest.dot(*other);
        }
    }
    rest.try_normalize()
}
