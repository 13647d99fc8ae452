//! nerfstudio's `camera_path.json`, as its viewer exports it.
//!
//! `camera_path[]` holds for each frame `camera_to_world` (16 numbers, row-major, OpenGL axes) and `fov`, the full
//! vertical opening angle in degrees; `render_width` and `render_height` are the size of all frames, `fps` the frames
//! per second.
//!
//! The viewer's world is that of nerfstudio's training: oriented, centred and scaled by its data parser, which writes
//! what it did to `dataparser_transforms.json` in the folder of the run. If that file is beside the path, it is undone,
//! together with `applied_transform` and `applied_scale` of the scene's `transforms.json`; otherwise the poses are
//! taken as they are.

use std::f64::consts::PI;
use std::path::Path;

use super::RawPath;
use crate::Scene;
use crate::parser_world::ParserWorld;
use crate::scene::check::size;
use crate::scene::json::Object;
use crate::scene::reader::{PoseForm, RawIntrinsics, RawPose, RawView};
use crate::scene::{FaultLocation, IntrinsicsFault, SceneError};

/// The key by which such a file is recognised.
pub(super) const KEY: &str = "camera_path";

pub(super) fn read(path: &Path, top: &Object<'_>, scene: &Scene) -> Result<RawPath, SceneError> {
    let place = |key: &str| FaultLocation::Key(key.to_owned());
    let required = |key: &str| {
        top.number(key)?.ok_or_else(|| SceneError::MissingKey { path: path.to_path_buf(), key: key.to_owned() })
    };
    if let Some(kind) = top.get("camera_type")
        && kind.as_str() != Some("perspective")
    {
        let (key, value) = ("camera_type".to_owned(), kind.to_string());
        return Err(SceneError::Distorted { path: path.to_path_buf(), key, value });
    }
    let [width, height] = size(path, place("render_height"), required("render_width")?, required("render_height")?)?;
    let world = ParserWorld::beside(path, scene)?;
    let mut views = Vec::new();
    for (index, value) in top.array(KEY)?.iter().enumerate() {
        let key = format!("{KEY}[{index}]");
        let frame = Object::new(path, &key, value)?;
        let pose_key = frame.full("camera_to_world");
        let mut matrix = frame.numbers::<16>("camera_to_world")?;
        if let Some(world) = &world {
            world.undo(&mut matrix);
        }
        let missing = || SceneError::MissingKey { path: path.to_path_buf(), key: frame.full("fov") };
        let angle = frame.number("fov")?.ok_or_else(missing)? * PI / 180.0;
        if !(angle > 0.0 && angle < PI) {
            let (path, place, fault) =
                (path.to_path_buf(), FaultLocation::Key(frame.full("fov")), IntrinsicsFault::Angle { angle });
            return Err(SceneError::Intrinsics { path, place, fault });
        }
        let focal = 0.5 * f64::from(height) / (0.5 * angle).tan();
        let intrinsics = RawIntrinsics {
            focal: [focal; 2],
            principal: [width, height].map(|side| 0.5 * f64::from(side)),
            size: Some([width, height]),
            lens: None,
            path: path.to_path_buf(),
            place: FaultLocation::Key(key),
            size_place: place("render_width"),
        };
        let pose = RawPose {
            matrix,
            form: PoseForm::WorldFromOpenGl,
            path: path.to_path_buf(),
            place: FaultLocation::Key(pose_key),
        };
        views.push(RawView::new(String::new(), None, pose, Some(intrinsics)));
    }
    Ok(RawPath { views, frames_per_second: top.number("fps")? })
}
