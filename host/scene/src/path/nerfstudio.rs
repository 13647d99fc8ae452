//! nerfstudio's `camera_path.json`, as its viewer exports it.
//!
//! `camera_path[]` holds for each frame `camera_to_world` (16 numbers, row-major, OpenGL axes) and `fov`, the full
//! vertical opening angle in degrees; `render_width` and `render_height` are the size of all frames, `fps` the frames
//! per second.
//!
//! The viewer's world is that of nerfstudio's training: oriented, centred and scaled by its data parser, which writes
//! what it did to `dataparser_transforms.json` in the folder of the run. If that file is beside the path, it is undone,
//! together with `applied_transform` and `applied_scale` of the scene's `transforms.json`; otherwise the poses are
//! taken as they are, and a warning says so.

use std::f64::consts::PI;
use std::path::Path;

use super::RawPath;
use crate::Scene;
use crate::parser_world::{PARSER, ParserWorld};
use crate::scene::check::size;
use crate::scene::json::Object;
use crate::scene::reader::{PoseForm, RawIntrinsics, RawPose, RawView};
use crate::scene::{FilePlace, IntrinsicsFault, SceneError};

/// The key by which such a file is recognised.
pub(super) const KEY: &str = "camera_path";

pub(super) fn read(path: &Path, top: &Object<'_>, scene: &Scene) -> Result<RawPath, SceneError> {
    if let Some(kind) = top.get("camera_type")
        && kind.as_str() != Some("perspective")
    {
        let fault = IntrinsicsFault::Distorted("camera_type".to_owned(), kind.to_string());
        return Err(FilePlace::file(path).fault(fault));
    }
    let (width, height) = (top.required_number("render_width")?, top.required_number("render_height")?);
    let [width, height] = size(&FilePlace::key(path, "render_height"), width, height)?;
    let world = ParserWorld::beside(path, scene)?;
    let mut views = Vec::new();
    for (index, value) in top.array(KEY)?.iter().enumerate() {
        let key = format!("{KEY}[{index}]");
        let frame = Object::new(path, &key, value)?;
        let numbers = frame.numbers::<16>("camera_to_world")?;
        let mut matrix = std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]));
        if let Some(world) = &world {
            matrix = world.undo(&matrix);
        }
        let angle = frame.required_number("fov")? * PI / 180.0;
        if !(angle > 0.0 && angle < PI) {
            return Err(FilePlace::key(path, frame.full("fov")).fault(IntrinsicsFault::Angle(angle)));
        }
        let focal = 0.5 * f64::from(height) / (0.5 * angle).tan();
        let intrinsics = RawIntrinsics {
            size_place: FilePlace::key(path, "render_width"),
            ..RawIntrinsics::centred(focal, [width, height], FilePlace::key(path, &key))
        };
        let place = FilePlace::key(path, frame.full("camera_to_world"));
        let pose = RawPose { matrix, form: PoseForm::WorldFromOpenGl, place };
        views.push(RawView::new(String::new(), None, pose, Some(intrinsics)));
    }
    let warning = world.is_none().then(|| {
        format!(
            "{}: the viewer's cameras are in the world of nerfstudio's training, turned, moved and scaled, unless that was \
             switched off; put the run's {PARSER} beside the file",
            path.display()
        )
    });
    Ok(RawPath { views, frames_per_second: top.number("fps")?, warning })
}
