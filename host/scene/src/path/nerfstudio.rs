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
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::RawPath;
use crate::Scene;
use crate::scene::check::size;
use crate::scene::files::read_text;
use crate::scene::json::{self, Object};
use crate::scene::reader::{PoseForm, RawIntrinsics, RawPose, RawView};
use crate::scene::{FaultLocation, IntrinsicsFault, SceneError};

/// The key by which such a file is recognised.
pub(super) const KEY: &str = "camera_path";

/// What nerfstudio's data parser did to the scene.
const PARSER: &str = "dataparser_transforms.json";

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
    let world = Similarity::of_parser(path, scene)?;
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

/// `point_parser = scale * (rotation * point_file + offset)`.
struct Similarity {
    rotation: DMat3,
    offset: DVec3,
    scale: f64,
}

impl Similarity {
    /// What the data parser did to the coordinates of the scene's files, if its file is beside the path.
    fn of_parser(path: &Path, scene: &Scene) -> Result<Option<Similarity>, SceneError> {
        let file = path.with_file_name(PARSER);
        if !file.is_file() {
            return Ok(None);
        }
        let value = json::parse(&file, &read_text(&file)?)?;
        let top = Object::new(&file, "", &value)?;
        let (rotation, offset) = affine(&top.rows::<3>("transform")?);
        let missing = || SceneError::MissingKey { path: file.clone(), key: "scale".to_owned() };
        let scale = top.number("scale")?.ok_or_else(missing)?;
        let (applied_rotation, applied_offset, applied_scale) = applied(scene)?;
        // The parser's transform begins at the coordinates before the scene's own transform was applied.
        let rotation = rotation * applied_rotation.inverse();
        let world = Similarity { rotation, offset: offset - rotation * applied_offset, scale: scale / applied_scale };
        let is_usable =
            (world.rotation.determinant() - 1.0).abs() < 1.0e-3 && world.scale > 0.0 && world.scale.is_finite();
        if is_usable { Ok(Some(world)) } else { Err(SceneError::NoSimilarity { path: file }) }
    }

    /// A camera-to-world matrix of the parser's world in the coordinates of the scene's files.
    fn undo(&self, matrix: &mut [f64; 16]) {
        let inverse = self.rotation.inverse();
        let column = |at: usize| DVec3::new(matrix[at], matrix[4 + at], matrix[8 + at]);
        let axes = [0, 1, 2].map(|at| inverse * column(at));
        let centre = inverse * (column(3) / self.scale - self.offset);
        for (at, values) in axes.into_iter().chain([centre]).enumerate() {
            for (row, value) in values.to_array().into_iter().enumerate() {
                matrix[4 * row + at] = value;
            }
        }
    }
}

/// The rotation and the offset of a matrix of three rows.
fn affine(rows: &[[f64; 4]; 3]) -> (DMat3, DVec3) {
    let column = |at: usize| DVec3::new(rows[0][at], rows[1][at], rows[2][at]);
    (DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

/// `applied_transform` and `applied_scale` of the scene's `transforms.json`; those of no change for other layouts.
fn applied(scene: &Scene) -> Result<(DMat3, DVec3, f64), SceneError> {
    let none = (DMat3::IDENTITY, DVec3::ZERO, 1.0);
    let file: PathBuf = if scene.path.is_dir() { scene.path.join("transforms.json") } else { scene.path.clone() };
    if scene.layout != "transforms" || !file.is_file() {
        return Ok(none);
    }
    let value: Value = json::parse(&file, &read_text(&file)?)?;
    let top = Object::new(&file, "", &value)?;
    let (rotation, offset) = match top.get("applied_transform") {
        Some(_) => affine(&top.rows::<3>("applied_transform")?),
        None => (none.0, none.1),
    };
    Ok((rotation, offset, top.number("applied_scale")?.unwrap_or(1.0)))
}
