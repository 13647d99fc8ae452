//! The layout of the Middlebury multi-view stereo data sets (Seitz et al. 2006).
//!
//! `NAME_par.txt` lists the photographs in its folder: first their count, then a line each of
//! `name K(9) R(9) t(3)`, row-major, with `x ~ K [R|t] X` in OpenCV axes. Files in the folder that the list does not
//! name are not part of the scene.
//!
//! In these files pixel `(0, 0)` is the centre of the top left pixel; in our image coordinates that is `(0.5, 0.5)`,
//! so half a pixel is added to the principal point.

use std::path::{Path, PathBuf};

use super::error::SceneError;
use super::fault::{FaultLocation, IntrinsicsFault};
use super::files;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawScene, RawView, Reader};

/// The suffix of a list's name.
const SUFFIX: &str = "_par.txt";

/// Numbers after the name: K, R and t.
const NUMBER_COUNT: usize = 9 + 9 + 3;

/// Largest skew and other zero entry of K that rounding may leave, in pixels.
const MAX_ROUNDING: f64 = 1.0e-6;

/// Middlebury multi-view stereo: `*_par.txt` beside the images.
pub(super) struct Middlebury;

impl Reader for Middlebury {
    fn name(&self) -> &'static str {
        "middlebury"
    }

    fn form(&self) -> &'static str {
        "a folder with one *_par.txt, or that file (Middlebury)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        let is_list = |path: &Path| path.to_string_lossy().ends_with(SUFFIX);
        if !path.is_dir() {
            return Ok(is_list(path).then(|| path.to_path_buf()));
        }
        match files::list(path, is_list)?.as_slice() {
            [] => Ok(None),
            [list] => Ok(Some(list.clone())),
            [first, second, ..] => {
                let name = |list: &Path| list.file_name().unwrap_or_default().to_string_lossy().into_owned();
                Err(SceneError::Ambiguous { path: path.to_path_buf(), first: name(first), second: name(second) })
            }
        }
    }

    fn read(&self, list: &Path) -> Result<RawScene, SceneError> {
        Ok(RawScene::from(read(list)?))
    }
}

/// All views of a list, in its order.
fn read(list: &Path) -> Result<Vec<RawView>, SceneError> {
    let text = files::read_text(list)?;
    let mut lines = files::lines(&text);
    let no_views = || SceneError::NoViews { path: list.to_path_buf(), looked_for: "a count, then a line each" };
    let (count_line, count) = lines.next().ok_or_else(no_views)?;
    let Ok(declared) = count.trim().parse::<usize>() else {
        let (path, place) = (list.to_path_buf(), FaultLocation::Line(count_line));
        return Err(SceneError::NotANumber { path, place, word: files::excerpt(count.trim()) });
    };
    let views = lines.map(|(line, content)| read_view(list, line, content)).collect::<Result<Vec<_>, _>>()?;
    if views.len() != declared {
        let (path, place, found) = (list.to_path_buf(), FaultLocation::Line(count_line), views.len());
        return Err(SceneError::WrongCount { path, place, of: "lines of cameras", expected: declared, found });
    }
    if views.is_empty() { Err(no_views()) } else { Ok(views) }
}

fn read_view(list: &Path, line: usize, content: &str) -> Result<RawView, SceneError> {
    let path = || list.to_path_buf();
    let place = FaultLocation::Line(line);
    let mut words = content.split_whitespace();
    let file_name = words.next().unwrap_or_default();
    let numbers = words.map(|word| files::number(list, line, word)).collect::<Result<Vec<_>, _>>()?;
    if numbers.len() != NUMBER_COUNT {
        let of = "numbers after the name";
        return Err(SceneError::WrongCount { path: path(), place, of, expected: NUMBER_COUNT, found: numbers.len() });
    }
    let (k, r, t) = (&numbers[..9], &numbers[9..18], &numbers[18..]);

    let intrinsics_fault = |fault| SceneError::Intrinsics { path: path(), place: FaultLocation::Line(line), fault };
    if k[1].abs() > MAX_ROUNDING {
        return Err(intrinsics_fault(IntrinsicsFault::Skew { skew: k[1] }));
    }
    if [k[3], k[6], k[7], k[8] - 1.0].iter().any(|zero| zero.abs() > MAX_ROUNDING) {
        return Err(intrinsics_fault(IntrinsicsFault::Form));
    }
    let pose = RawPose {
        matrix: [r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0.0, 0.0, 0.0, 1.0],
        form: PoseForm::OpenCvFromWorld,
        path: path(),
        place: place.clone(),
    };
    let image: PathBuf = list.with_file_name(file_name.replace('\\', "/")).components().collect();
    if !image.is_file() {
        return Err(SceneError::PoseWithoutImage { path: path(), place, image });
    }
    let image = ImageFile::open(&image)?;
    let intrinsics = RawIntrinsics {
        focal: [k[0], k[4]],
        principal: [k[2] + 0.5, k[5] + 0.5],
        size: None,
        lens: None,
        path: path(),
        place: place.clone(),
        size_place: place,
    };
    Ok(RawView::new(files::stem(image.path()), Some(image), pose, Some(intrinsics)))
}
