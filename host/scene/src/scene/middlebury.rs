//! The layout of the Middlebury multi-view stereo data sets (Seitz et al. 2006).
//!
//! `NAME_par.txt` lists the photographs in its folder: first their count, then a line each of
//! `name K(9) R(9) t(3)`, row-major, with `x ~ K [R|t] X` in OpenCV axes. Files in the folder that the list does not
//! name are not part of the scene.
//!
//! In these files pixel `(0, 0)` is the centre of the top left pixel; in our image coordinates that is `(0.5, 0.5)`,
//! so half a pixel is added to the principal point.

use std::path::{Path, PathBuf};

use super::error::{SceneError, SceneFault};
use super::fault::{FileFault, FilePlace, IntrinsicsFault};
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
                Err(FilePlace::file(path).fault(SceneFault::Ambiguous(name(first), name(second))))
            }
        }
    }

    fn read(&self, list: &Path) -> Result<RawScene, SceneError> {
        let text = files::read_text(list)?;
        let mut lines = files::lines(&text);
        let no_views = || FilePlace::file(list).fault(SceneFault::NoViews("a count, then a line each"));
        let (count_line, count) = lines.next().ok_or_else(no_views)?;
        let place = FilePlace::line(list, count_line);
        let Ok(expected) = count.trim().parse::<usize>() else {
            return Err(place.fault(FileFault::NotANumber(files::excerpt(count.trim()))));
        };
        let views = lines.map(|(line, content)| read_view(list, line, content)).collect::<Result<Vec<_>, _>>()?;
        if views.len() != expected {
            let fault = FileFault::WrongCount { of: "lines of cameras", expected, found: views.len() };
            return Err(place.fault(fault));
        }
        if views.is_empty() { Err(no_views()) } else { Ok(RawScene::from(views)) }
    }
}

fn read_view(list: &Path, line: usize, content: &str) -> Result<RawView, SceneError> {
    let place = FilePlace::line(list, line);
    let mut words = content.split_whitespace();
    let file_name = words.next().unwrap_or_default();
    let numbers = words.map(|word| files::number(list, line, word)).collect::<Result<Vec<_>, _>>()?;
    if numbers.len() != NUMBER_COUNT {
        let (of, found) = ("numbers after the name", numbers.len());
        return Err(place.fault(FileFault::WrongCount { of, expected: NUMBER_COUNT, found }));
    }
    let (k, r, t) = (&numbers[..9], &numbers[9..18], &numbers[18..]);
    if k[1].abs() > MAX_ROUNDING {
        return Err(place.fault(IntrinsicsFault::Skew(k[1])));
    }
    if [k[3], k[6], k[7], k[8] - 1.0].iter().any(|zero| zero.abs() > MAX_ROUNDING) {
        return Err(place.fault(IntrinsicsFault::Form));
    }
    let row = |at: usize| [r[3 * at], r[3 * at + 1], r[3 * at + 2], t[at]];
    let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    let pose = RawPose { matrix, form: PoseForm::OpenCvFromWorld, place: place.clone() };
    let image: PathBuf = list.with_file_name(file_name.replace('\\', "/")).components().collect();
    if !image.is_file() {
        return Err(place.fault(SceneFault::PoseWithoutImage(image)));
    }
    let image = ImageFile::open(&image)?;
    let intrinsics = RawIntrinsics::of_photograph([k[0], k[4]], [k[2] + 0.5, k[5] + 0.5], place);
    Ok(RawView::new(files::stem(image.path()), Some(image), pose, Some(intrinsics)))
}
