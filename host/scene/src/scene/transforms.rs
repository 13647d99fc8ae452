//! NeRF's `transforms.json`, as the Blender scenes, instant-ngp and nerfstudio write it.
//!
//! `frames[]` holds for each photograph `file_path` (relative to the JSON file; Blender's without extension) and
//! `transform_matrix`, camera-to-world in OpenGL axes. Intrinsics stand at the top or in a frame, where they win:
//! `fl_x fl_y cx cy w h`, or `camera_angle_x`/`camera_angle_y`, the full opening angles in radians. A missing `fl_y`
//! is `fl_x`, a missing `cx`, `cy` the centre of the image, missing `w`, `h` the photograph's size. Their image
//! coordinates are COLMAP's, with pixel centres at halves, as ours.
//!
//! `applied_transform`, `applied_scale`, `scale`, `offset` and `aabb_scale` say what was done to the world or what
//! a particular trainer should do; the poses stand as they are written. Lens distortion other than 0 is refused.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::check;
use super::error::SceneError;
use super::fault::{IntrinsicsFault, Place};
use super::files::{self, IMAGE_EXTENSIONS};
use super::json::{self, Object};
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPose, RawScene, RawView, Reader};

/// Names of the file, in the order in which they are looked for.
const FILE_NAMES: [&str; 2] = ["transforms.json", "transforms_train.json"];

/// Coefficients of lens distortion: radial, tangential, thin prism.
const DISTORTION_KEYS: [&str; 12] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s1", "s2", "s3", "s4"];

/// Flags of projections that are not a pinhole's, whatever the coefficients.
const PROJECTION_FLAGS: [&str; 3] = ["is_fisheye", "equirectangular", "latlong"];

/// Camera models that are a pinhole when their coefficients are 0.
const PINHOLE_MODELS: [&str; 7] =
    ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "FULL_OPENCV", "PERSPECTIVE", "SIMPLE_RADIAL", "RADIAL"];

/// NeRF's `transforms.json` (Blender, instant-ngp, nerfstudio).
pub(super) struct Transforms;

impl Reader for Transforms {
    fn name(&self) -> &'static str {
        "transforms"
    }

    fn form(&self) -> &'static str {
        "a folder with transforms.json or transforms_train.json, or such a .json file (NeRF)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        if !path.is_dir() {
            return Ok(files::has_extension(path, &["json"]).then(|| path.to_path_buf()));
        }
        Ok(FILE_NAMES.iter().map(|name| path.join(name)).find(|file| file.is_file()))
    }

    fn read(&self, file: &Path) -> Result<RawScene, SceneError> {
        Ok(RawScene::from(read(file)?))
    }
}

/// All views of a file, in the order of its frames.
fn read(path: &Path) -> Result<Vec<RawView>, SceneError> {
    let value = json::parse(path, &files::read_text(path)?)?;
    let top = Object::new(path, "", &value)?;
    let frames = top.array("frames")?;
    if frames.is_empty() {
        return Err(SceneError::NoViews { path: path.to_path_buf(), looked_for: "frames[]" });
    }
    let read_frame = |(index, value)| {
        let key = format!("frames[{index}]");
        let frame = Object::new(path, &key, value)?;
        Frame { path, key, scopes: [frame, top.clone()] }.view()
    };
    frames.iter().enumerate().map(read_frame).collect()
}

/// One entry of `frames`.
struct Frame<'a> {
    path: &'a Path,
    /// `frames[3]`.
    key: String,
    /// Where its intrinsics are looked up: in the frame, then at the top of the file.
    scopes: [Object<'a>; 2],
}

impl<'a> Frame<'a> {
    fn view(&self) -> Result<RawView, SceneError> {
        self.check_lens()?;
        let [frame, _] = &self.scopes;
        let pose = RawPose {
            matrix: frame.matrix("transform_matrix")?,
            form: PoseForm::WorldFromOpenGl,
            path: self.path.to_path_buf(),
            place: Place::Key(frame.full("transform_matrix")),
        };
        let image = ImageFile::open(&self.image(frame.text("file_path")?)?)?;
        let intrinsics = Some(self.intrinsics(image.size())?);
        Ok(RawView::new(files::stem(image.path()), Some(image), pose, intrinsics))
    }

    /// The photograph of a `file_path`, with the extension that the Blender flavour leaves out.
    fn image(&self, file_path: &str) -> Result<PathBuf, SceneError> {
        // Components without `.`, so that `./train/r_0` is named as people name it.
        let given: PathBuf = self.path.with_file_name("").join(file_path).components().collect();
        let with_extension = |extension: &&str| {
            let mut name = given.clone().into_os_string();
            name.push(format!(".{extension}"));
            PathBuf::from(name)
        };
        let mut candidates = std::iter::once(given.clone()).chain(IMAGE_EXTENSIONS.iter().map(with_extension));
        candidates.find(|candidate| candidate.is_file()).ok_or_else(|| SceneError::PoseWithoutImage {
            path: self.path.to_path_buf(),
            place: Place::Key(self.scopes[0].full("file_path")),
            image: given,
        })
    }

    fn intrinsics(&self, image_size: [u32; 2]) -> Result<RawIntrinsics, SceneError> {
        let place = || Place::Key(self.key.clone());
        let stated = match (self.number("w")?, self.number("h")?) {
            (None, None) => None,
            (Some((width, _)), Some((height, _))) => Some(check::size(self.path, place(), width, height)?),
            (Some(_), None) => return Err(self.missing("h")),
            (None, Some(_)) => return Err(self.missing("w")),
        };
        let size = stated.unwrap_or(image_size);
        let focal_x =
            self.focal("fl_x", "camera_angle_x", size[0])?.ok_or_else(|| self.missing("fl_x (or camera_angle_x)"))?;
        let focal_y = self.focal("fl_y", "camera_angle_y", size[1])?.unwrap_or(focal_x);
        let centre = size.map(|side| f64::from(side) / 2.0);
        let principal = [
            self.number("cx")?.map_or(centre[0], |(value, _)| value),
            self.number("cy")?.map_or(centre[1], |(value, _)| value),
        ];
        let (path, place, size_place) = (self.path.to_path_buf(), place(), place());
        Ok(RawIntrinsics { focal: [focal_x, focal_y], principal, size: stated, lens: None, path, place, size_place })
    }

    /// A focal length: what the frame says in either form, otherwise what the top of the file says.
    fn focal(&self, length_key: &str, angle_key: &str, side: u32) -> Result<Option<f64>, SceneError> {
        for scope in &self.scopes {
            if let Some(focal) = scope.number(length_key)? {
                return Ok(Some(focal));
            }
            if let Some(angle) = scope.number(angle_key)? {
                if !(angle > 0.0 && angle < std::f64::consts::PI) {
                    let (path, place) = (self.path.to_path_buf(), Place::Key(scope.full(angle_key)));
                    let fault = IntrinsicsFault::Angle { angle };
                    return Err(SceneError::Intrinsics { path, place, fault });
                }
                return Ok(Some(f64::from(side) / 2.0 / (angle / 2.0).tan()));
            }
        }
        Ok(None)
    }

    /// Refuses whatever is not a pinhole: its straight lines would not be straight.
    fn check_lens(&self) -> Result<(), SceneError> {
        let refuse =
            |key: String, value: String| Err(SceneError::Distorted { path: self.path.to_path_buf(), key, value });
        if let Some((value, key)) = self.get("camera_model") {
            let supported = |model: &str| PINHOLE_MODELS.iter().any(|pinhole| model.eq_ignore_ascii_case(pinhole));
            if !value.as_str().is_some_and(supported) {
                return refuse(key, files::excerpt(&value.to_string()));
            }
        }
        for flag in PROJECTION_FLAGS {
            if let Some((value, key)) = self.get(flag)
                && value != &Value::Bool(false)
            {
                return refuse(key, files::excerpt(&value.to_string()));
            }
        }
        for coefficient in DISTORTION_KEYS {
            if let Some((value, key)) = self.number(coefficient)?
                && value != 0.0
            {
                return refuse(key, value.to_string());
            }
        }
        Ok(())
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
        SceneError::MissingKey { path: self.path.to_path_buf(), key }
    }
}
