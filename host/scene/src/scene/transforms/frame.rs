//! One entry of `frames`: its photograph, its mask, its intrinsics and its lens.

use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use serde_json::Value;
use viewfuse_core::lens::{Coefficients, Lens, Projection};

use super::super::camera_models::{KEYED_LENSES, KeyedLens, LENS_KEYS, LENS_LIST, REFUSED_FLAGS, keyed_lens_names};
use super::super::check;
use super::super::error::{SceneError, SceneFault};
use super::super::fault::{FileFault, FilePlace, IntrinsicsFault};
use super::super::files::{self, IMAGE_EXTENSIONS};
use super::super::json::Object;
use super::super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawView};
use super::super::split::Split;

/// Share of a number by which the same one may differ in two places.
const SAME_NUMBER: f64 = 1.0e-6;

/// Lists of photographs at the top of nerfstudio's files.
const LISTS: [(&str, Split); 3] =
    [("train_filenames", Split::Train), ("val_filenames", Split::Validation), ("test_filenames", Split::Test)];

/// A frame's view, or its missing photograph.
pub(super) enum Listed {
    /// A view with its photograph.
    View(Box<RawView>),
    /// A photograph that does not exist, and the place that names it.
    Missing(FilePlace, PathBuf),
}

/// The splits of photographs by the lists at the top level of a file. Names are compared as paths.
pub(super) struct Lists {
    parts: HashMap<PathBuf, Split>,
    /// Those of them that a frame has.
    found: HashSet<PathBuf>,
}

impl Lists {
    pub(super) fn new(path: &Path, top: &Object) -> Result<Lists, SceneError> {
        let mut parts = HashMap::new();
        for (key, split) in LISTS {
            if top.get(key).is_some() {
                let names = top.array(key)?.iter().filter_map(Value::as_str);
                parts.extend(names.map(|name| (beside(path, name), split)));
            }
        }
        Ok(Lists { parts, found: HashSet::new() })
    }

    /// The split of a frame's photograph.
    fn split(&mut self, given: &Path) -> Option<Split> {
        let split = self.parts.get(given).copied()?;
        self.found.insert(given.to_path_buf());
        Some(split)
    }

    /// Counts the names in lists that no frame has.
    pub(super) fn warning(&self, path: &Path) -> Option<String> {
        let lacking = self.parts.keys().filter(|name| !self.found.contains(*name));
        let (count, all, first) = (lacking.clone().count(), self.parts.len(), lacking.min()?);
        let (path, first) = (path.display(), first.display());
        Some(format!(
            "{path}: no frame has {count} of the {all} names in train_filenames and the like (such as {first})"
        ))
    }
}

/// A path relative to a JSON file. Components without `.`, so that `./train/r_0` is named `train/r_0`; joined with `/`,
/// for any separator of the system that wrote the file.
fn beside(file: &Path, path: &str) -> PathBuf {
    file.with_file_name("").join(path.replace('\\', "/")).components().collect()
}

/// One entry of `frames`.
pub(crate) struct TransformsFrame<'a> {
    pub(crate) path: &'a Path,
    /// `frames[3]`.
    pub(crate) key: String,
    /// Where its intrinsics are looked up: in the frame, then at the top of the file.
    pub(crate) scopes: [Object<'a>; 2],
}

impl<'a> TransformsFrame<'a> {
    pub(super) fn view(&self, lists: &mut Lists) -> Result<Listed, SceneError> {
        let [frame, _] = &self.scopes;
        let pose = self.pose()?;
        let file_path = frame.text("file_path")?;
        let given = self.beside(file_path);
        let split = lists.split(&given);
        let Some(image) = photograph(&given).or_else(|| smaller(&given)) else {
            return Ok(Listed::Missing(FilePlace::key(self.path, frame.full("file_path")), given));
        };
        let image = ImageFile::open(&image)?;
        let intrinsics = Some(self.intrinsics(image.size(), reduced(&given, image.path()))?);
        let mut view = RawView::new(files::stem(image.path()), Some(image), pose, intrinsics);
        view.mask = self.mask()?;
        view.split = split;
        Ok(Listed::View(Box::new(view)))
    }

    /// Its camera alone: photograph, mask and lens are ignored. A size that is not stated is `size`; without focal
    /// lengths it has no intrinsics.
    pub(crate) fn camera_alone(&self, size: [u32; 2]) -> Result<RawView, SceneError> {
        let [frame, _] = &self.scopes;
        let pose = self.pose()?;
        let has_focal = ["fl_x", "camera_angle_x", "x_fov"].iter().any(|key| self.get(key).is_some());
        let intrinsics = if has_focal { Some(RawIntrinsics { lens: None, ..self.intrinsics(size, 1)? }) } else { None };
        let intrinsics = intrinsics.map(|raw| RawIntrinsics { size: raw.size.or(Some(size)), ..raw });
        let name = frame.get("file_path").and_then(Value::as_str).map(|path| files::picture_stem(&self.beside(path)));
        Ok(RawView::new(name.unwrap_or_default(), None, pose, intrinsics))
    }

    fn pose(&self) -> Result<RawPose, SceneError> {
        let [frame, _] = &self.scopes;
        Ok(RawPose {
            matrix: frame.rows("transform_matrix")?,
            form: PoseForm::WorldFromOpenGl,
            place: FilePlace::key(self.path, frame.full("transform_matrix")),
        })
    }

    /// Whether it names a depth image.
    pub(super) fn has_depth(&self) -> bool {
        self.scopes[0].get("depth_file_path").is_some()
    }

    /// The mask that the frame names.
    fn mask(&self) -> Result<Option<PathBuf>, SceneError> {
        let [frame, _] = &self.scopes;
        if frame.get("mask_path").is_none() {
            return Ok(None);
        }
        let mask = self.beside(frame.text("mask_path")?);
        if mask.is_file() {
            return Ok(Some(mask));
        }
        Err(FilePlace::key(self.path, frame.full("mask_path")).fault(SceneFault::NoMask(mask)))
    }

    /// A path relative to the JSON file.
    fn beside(&self, path: &str) -> PathBuf {
        beside(self.path, path)
    }

    /// Of a photograph of this size, which is `reduction` times smaller than the one that the file speaks of.
    fn intrinsics(&self, image_size: [u32; 2], reduction: u32) -> Result<RawIntrinsics, SceneError> {
        let place = FilePlace::key(self.path, &self.key);
        let stated = match (self.number("w")?, self.number("h")?) {
            (None, None) => None,
            (Some((width, _)), Some((height, _))) => Some(check::size(&place, width, height)?),
            (Some(_), None) => return Err(self.missing("h")),
            (None, Some(_)) => return Err(self.missing("w")),
        };
        let stated = stated.or((reduction > 1).then(|| image_size.map(|side| side.saturating_mul(reduction))));
        let size = stated.unwrap_or(image_size);
        let focal_x = self.focal("x", size[0])?.ok_or_else(|| self.missing("fl_x (or camera_angle_x)"))?;
        let focal_y = self.focal("y", size[1])?.unwrap_or(focal_x);
        let centre = size.map(|side| f64::from(side) / 2.0);
        let principal = [
            self.number("cx")?.map_or(centre[0], |(value, _)| value),
            self.number("cy")?.map_or(centre[1], |(value, _)| value),
        ];
        let (focal, lens, size_place) = ([focal_x, focal_y], self.lens(&place)?, place.clone());
        Ok(RawIntrinsics { focal, principal, size: stated, lens, place, size_place })
    }

    /// A focal length along an axis: from the frame in any form, otherwise from the top level of the file.
    fn focal(&self, axis: &str, side: u32) -> Result<Option<f64>, SceneError> {
        for scope in &self.scopes {
            if let Some(focal) = scope.number(&format!("fl_{axis}"))? {
                return Ok(Some(focal));
            }
            // Full opening angles, in radians and in degrees.
            for (key, unit) in [(format!("camera_angle_{axis}"), 1.0), (format!("{axis}_fov"), PI / 180.0)] {
                let Some(angle) = scope.number(&key)?.map(|angle| angle * unit) else { continue };
                if !(angle > 0.0 && angle < PI) {
                    return Err(FilePlace::key(self.path, scope.full(&key)).fault(IntrinsicsFault::Angle(angle)));
                }
                return Ok(Some(f64::from(side) / 2.0 / (angle / 2.0).tan()));
            }
        }
        Ok(None)
    }

    /// The lens that the frame, whose place this is, or the file states.
    fn lens(&self, place: &FilePlace) -> Result<Option<Lens>, SceneError> {
        let refuse = |key, value| Err(FilePlace::file(self.path).fault(IntrinsicsFault::Distorted(key, value)));
        let [perspective, _, fisheye] = &KEYED_LENSES;
        let flag = match self.get("is_fisheye") {
            Some((Value::Bool(true), key)) => Some(key),
            None | Some((Value::Bool(false), _)) => None,
            Some((value, key)) => return refuse(key, files::excerpt(&value.to_string())),
        };
        let keyed = match self.get("camera_model") {
            None if flag.is_some() => fisheye,
            None => perspective,
            Some((value, key)) => KeyedLens::named(value.as_str().unwrap_or_default()).ok_or_else(|| {
                let model = files::excerpt(&value.to_string());
                FilePlace::key(self.path, key).fault(IntrinsicsFault::CameraModel(model, keyed_lens_names()))
            })?,
        };
        if let Some(key) = flag.filter(|_| keyed.projection != Projection::Fisheye) {
            let second = format!("camera_model {}", keyed.models[0]);
            return Err(FilePlace::file(self.path).fault(FileFault::Contradiction(format!("{key} true"), second)));
        }
        for flag in REFUSED_FLAGS {
            if let Some((value, key)) = self.get(flag)
                && value != &Value::Bool(false)
            {
                return refuse(key, files::excerpt(&value.to_string()));
            }
        }
        let mut coefficients = Coefficients::default();
        let listed = self.listed_lens()?;
        for key in LENS_KEYS.split(' ') {
            let in_list = listed.iter().find(|(known, ..)| *known == key);
            let stated = self.lens_number(key, in_list.map(|(_, value, full)| (*value, full.as_str())))?;
            let Some((value, full)) = stated else { continue };
            match keyed.keys.iter().find(|(known, _)| *known == key) {
                Some((_, index)) => coefficients[*index] = value,
                None if value != 0.0 => return refuse(full, value.to_string()),
                None => {}
            }
        }
        let lens = Lens::new(keyed.projection, coefficients);
        let lens = lens.map_err(|reason| place.clone().fault(IntrinsicsFault::Lens(reason)))?;
        Ok((!lens.is_pinhole()).then_some(lens))
    }

    /// A lens's number by its key or from the list, which must say the same; a frame's list goes before keys at the top of
    /// the file.
    fn lens_number(&self, key: &str, in_list: Option<(f64, &str)>) -> Result<Option<(f64, String)>, SceneError> {
        let [frame, _] = &self.scopes;
        let Some((value, list)) = in_list else { return self.number(key) };
        let stated = match frame.get(LENS_LIST.0) {
            Some(_) => frame.number(key)?.map(|other| (other, frame.full(key))),
            None => self.number(key)?,
        };
        match stated {
            // One of them may have been saved in single precision.
            Some((other, full)) if (other - value).abs() > SAME_NUMBER * value.abs() => {
                let (list, full) = (format!("{list} {value}"), format!("{full} {other}"));
                Err(FilePlace::file(self.path).fault(FileFault::Contradiction(list, full)))
            }
            _ => Ok(Some((value, list.to_owned()))),
        }
    }

    /// The numbers of nerfstudio's list of them, with their keys and the full names of their places.
    fn listed_lens(&self) -> Result<Vec<(&'static str, f64, String)>, SceneError> {
        let (list, keys) = LENS_LIST;
        let Some(scope) = self.scopes.iter().find(|scope| scope.get(list).is_some()) else { return Ok(Vec::new()) };
        let full = scope.full(list);
        let wrong = |found: usize| {
            let fault = FileFault::WrongCount { of: "numbers (k1 k2 k3 k4 p1 p2)", expected: keys.len(), found };
            FilePlace::key(self.path, full.clone()).fault(fault)
        };
        let values = scope.array(list)?;
        let numbers: Vec<f64> = values.iter().filter_map(Value::as_f64).collect();
        // Those that are missing are 0.
        if numbers.len() != values.len() || numbers.len() > keys.len() {
            return Err(wrong(values.len()));
        }
        Ok(keys
            .into_iter()
            .zip(numbers)
            .enumerate()
            .map(|(at, (key, number))| (key, number, format!("{full}[{at}]")))
            .collect())
    }

    /// A value and the full name of its key, from the frame or the top of the file.
    fn get(&self, key: &str) -> Option<(&'a Value, String)> {
        self.scopes.iter().find_map(|scope| scope.get(key).map(|value| (value, scope.full(key))))
    }

    /// A number and the full name of its key, from the frame or the top of the file.
    fn number(&self, key: &str) -> Result<Option<(f64, String)>, SceneError> {
        for scope in &self.scopes {
            if let Some(value) = scope.number(key)? {
                return Ok(Some((value, scope.full(key))));
            }
        }
        Ok(None)
    }

    /// The error for a key that is neither in the frame nor at the top.
    fn missing(&self, key: &str) -> SceneError {
        let key = format!("{key}, in {} and at the top level,", self.key);
        FilePlace::file(self.path).fault(FileFault::MissingKey(key))
    }
}

/// The photograph of a path, with the extension that the Blender flavour omits. `000.jpg.png` is the mask of `000.jpg`.
fn photograph(given: &Path) -> Option<PathBuf> {
    let lacking: &[&str] = if files::has_extension(given, &IMAGE_EXTENSIONS) { &[] } else { &IMAGE_EXTENSIONS };
    let with_extension = lacking.iter().map(|extension| files::appended(given, extension));
    std::iter::once(given.to_path_buf()).chain(with_extension).find(|candidate| candidate.is_file())
}

/// How many times smaller a photograph is than the one that was given, as the name of its folder says.
fn reduced(given: &Path, image: &Path) -> u32 {
    let folder =
        |path: &Path| path.ancestors().find_map(|folder| files::reduction(&folder.file_name()?.to_string_lossy()));
    match (folder(given), folder(image)) {
        (Some(1), Some(reduction)) => u32::try_from(reduction).unwrap_or(1).max(1),
        _ => 1,
    }
}

/// The downscaled photograph for a missing one in `images`: from `images_2`, `images_4` and so on.
fn smaller(given: &Path) -> Option<PathBuf> {
    let folder = given.ancestors().find(|folder| folder.file_name().is_some_and(|name| name == "images"))?;
    let (inside, root) = (given.strip_prefix(folder).ok()?, folder.parent()?);
    files::image_folders(root).ok()?.iter().find_map(|folder| photograph(&folder.join(inside)))
}
