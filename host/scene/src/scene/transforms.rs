//! NeRF's `transforms.json`, as the Blender scenes, instant-ngp and nerfstudio write it.
//!
//! `frames[]` holds for each photograph `file_path` (relative to the JSON file; Blender's without extension) and
//! `transform_matrix`, camera-to-world in OpenGL axes. Intrinsics are at the top level or in a frame, which takes
//! precedence: `fl_x fl_y cx cy w h`, or `camera_angle_x`/`camera_angle_y`, the full opening angles in radians. A
//! missing `fl_y` is `fl_x`, a missing `cx`, `cy` the centre of the image, missing `w`, `h` the photograph's size.
//! Their image coordinates are COLMAP's, with pixel centres at halves, as ours.
//!
//! The lens is `camera_model` (or `is_fisheye`) with the coefficients that it has ([`super::camera_models`]); other
//! lenses and coefficients are refused.
//! `mask_path` names a frame's mask, `train_filenames` and the like the splits of the scene. Without `transforms.json`,
//! `transforms_train.json`, `transforms_val.json` and `transforms_test.json` are one scene with splits; if there are
//! several of them, each view's name begins with its split. A missing photograph of `images` is searched in `images_2`,
//! `images_4` and so on. Frames whose photograph is missing are skipped, with one warning.
//!
//! `applied_transform`, `applied_scale`, `scale`, `offset` and `aabb_scale` describe transformations that were applied
//! or settings of a particular trainer; the poses are read as they are written. `depth_file_path` is ignored, with a
//! warning, and so is what changes pictures in other programs; all keys that are not read are listed.

pub(crate) mod frame;
mod keys;

use std::path::{Path, PathBuf};

use super::error::{SceneError, SceneFault};
use super::fault::FilePlace;
use super::files;
use super::json::{self, Object};
use super::missing::Missing;
use super::reader::{RawScene, RawView, Reader};
use super::split::Split;
use frame::{Listed, Lists, TransformsFrame};
use keys::Keys;

/// Name of the file of a whole scene.
const FILE_NAME: &str = "transforms.json";

/// Files of the splits of a scene.
const PARTS: [(&str, Split); 3] = [
    ("transforms_train.json", Split::Train),
    ("transforms_val.json", Split::Validation),
    ("transforms_test.json", Split::Test),
];

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
        let file = path.join(FILE_NAME);
        if file.is_file() {
            return Ok(Some(file));
        }
        Ok(match &parts(path)[..] {
            [] => None,
            [(file, _)] => Some(file.clone()),
            _ => Some(path.to_path_buf()),
        })
    }

    fn read(&self, found: &Path) -> Result<RawScene, SceneError> {
        if !found.is_dir() {
            let split = PARTS.iter().find(|(name, _)| found.ends_with(name)).map(|(_, split)| *split);
            return read(found, split);
        }
        let mut scene = RawScene::default();
        let mut empty = None;
        for (file, split) in parts(found) {
            let part = match read(&file, Some(split)) {
                // A benchmark's photographs for validation and tests are often not kept.
                Err(error) if split != Split::Train && is_without_photographs(&error) => {
                    let file = file.display();
                    scene.warnings.push(format!("{file}: none of its photographs is there: '{split}' has no views"));
                    empty.get_or_insert(error);
                    continue;
                }
                part => part?,
            };
            let named = |view: RawView| RawView { name: format!("{split}_{}", view.name), ..view };
            scene.views.extend(part.views.into_iter().map(named));
            scene.warnings.extend(part.warnings);
            scene.conventions.extend(part.conventions);
            scene.unused.extend(part.unused);
        }
        match empty {
            Some(error) if scene.views.is_empty() => Err(error),
            _ => Ok(scene),
        }
    }
}

/// Whether all photographs of a file are missing, and none of its names is found at another place.
fn is_without_photographs(error: &SceneError) -> bool {
    matches!(*error.fault, SceneFault::PoseWithoutImage(_))
}

/// The existing files of a scene's splits.
fn parts(folder: &Path) -> Vec<(PathBuf, Split)> {
    PARTS.map(|(name, split)| (folder.join(name), split)).into_iter().filter(|(file, _)| file.is_file()).collect()
}

/// All views of a file, in the order of its frames.
fn read(path: &Path, split: Option<Split>) -> Result<RawScene, SceneError> {
    let value = json::parse(path, &files::read_text(path)?)?;
    let top = Object::new(path, "", &value)?;
    let frames = top.array("frames")?;
    if frames.is_empty() {
        return Err(FilePlace::file(path).fault(SceneFault::NoViews("frames[]")));
    }
    let mut lists = Lists::new(path, &top)?;
    let mut keys = Keys::new(&top);
    let mut scene = RawScene::default();
    let mut missing = Missing::default();
    let mut depth_count = 0;
    for (index, value) in frames.iter().enumerate() {
        let key = format!("frames[{index}]");
        let frame = TransformsFrame { path, scopes: [Object::new(path, &key, value)?, top.clone()], key };
        keys.add(&frame.scopes[0]);
        depth_count += usize::from(frame.has_depth());
        match frame.view(&mut lists)? {
            Listed::View(mut view) => {
                missing.found();
                view.split = view.split.or(split);
                scene.views.push(*view);
            }
            Listed::Missing(place, image) => missing.missed(place, image),
        }
    }
    scene.warnings.extend(missing.warning(path)?);
    scene.warnings.extend(lists.warning(path));
    scene.warnings.extend(keys.warnings(path));
    scene.conventions.extend(keys.convention());
    scene.unused.extend(keys.unused(path));
    if depth_count > 0 {
        scene.warnings.push(format!(
            "{}: {depth_count} of {} frames name a depth image (depth_file_path); depth images are not used",
            path.display(),
            frames.len()
        ));
    }
    Ok(scene)
}
