//! The world of nerfstudio's training: oriented, centred and scaled by its data parser, which writes what it did to
//! `dataparser_transforms.json` in the folder of the run ([`ParserWorld`]). Camera paths and Gaussians that lie beside
//! that file are in this world.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use crate::Scene;
use crate::scene::files::read_text;
use crate::scene::json::{self, Object};
use crate::scene::{FilePlace, SceneError, SceneFault};

/// What nerfstudio's data parser did to the scene.
pub(crate) const PARSER: &str = "dataparser_transforms.json";

/// `point_parser = scale * (rotation * point_file + offset)`.
#[derive(Clone, Debug)]
pub(crate) struct ParserWorld {
    rotation: DMat3,
    offset: DVec3,
    /// A length of the scene's files in the parser's world.
    pub(crate) scale: f64,
}

impl ParserWorld {
    /// What the data parser did to the coordinates of the scene's files, if its file is beside the path.
    pub(crate) fn beside(path: &Path, scene: &Scene) -> Result<Option<ParserWorld>, SceneError> {
        let file = path.with_file_name(PARSER);
        if !file.is_file() {
            return Ok(None);
        }
        let value = json::parse(&file, &read_text(&file)?)?;
        let top = Object::new(&file, "", &value)?;
        let (rotation, offset) = affine(&top.rows::<3>("transform")?);
        let scale = top.required_number("scale")?;
        let (applied_rotation, applied_offset, applied_scale) = applied(scene)?;
        // The parser's transform begins at the coordinates before the scene's own transform was applied.
        let rotation = rotation * applied_rotation.inverse();
        let world = ParserWorld { rotation, offset: offset - rotation * applied_offset, scale: scale / applied_scale };
        let is_usable =
            (world.rotation.determinant() - 1.0).abs() < 1.0e-3 && world.scale > 0.0 && world.scale.is_finite();
        if is_usable { Ok(Some(world)) } else { Err(FilePlace::file(file).fault(SceneFault::NoSimilarity)) }
    }

    /// A camera-to-world matrix of the parser's world in the coordinates of the scene's files.
    pub(crate) fn undo(&self, matrix: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
        let inverse = self.file_from_parser();
        let column = |at: usize| DVec3::new(matrix[0][at], matrix[1][at], matrix[2][at]);
        let columns = [inverse * column(0), inverse * column(1), inverse * column(2), self.point(column(3))];
        let row = |row: usize| columns.map(|column| column[row]);
        [row(0), row(1), row(2), matrix[3]]
    }

    /// A point of the parser's world in the coordinates of the scene's files.
    pub(crate) fn point(&self, point_parser: DVec3) -> DVec3 {
        self.file_from_parser() * (point_parser / self.scale - self.offset)
    }

    /// The rotation from the parser's world to the scene's files.
    pub(crate) fn file_from_parser(&self) -> DMat3 {
        self.rotation.inverse()
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
    let value = json::parse(&file, &read_text(&file)?)?;
    let top = Object::new(&file, "", &value)?;
    let (rotation, offset) = match top.get("applied_transform") {
        Some(_) => affine(&top.rows::<3>("applied_transform")?),
        None => (none.0, none.1),
    };
    Ok((rotation, offset, top.number("applied_scale")?.unwrap_or(1.0)))
}
