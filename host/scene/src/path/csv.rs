//! A table of poses: comma-separated values with a line of column names first, in any order.
//!
//! | columns | what |
//! |---|---|
//! | `name` | name of the picture; may be left out |
//! | `x y z` | the camera's centre, with one of the next two |
//! | `qw qx qy qz` | rotation from the camera to the world, camera axes x right, y down, z forward; of any length |
//! | `look_x look_y look_z` | the point that is in the middle of the picture; upright by the scene's cameras |
//! | `m00 m01 m02 m03 m10 .. m23` | instead: the camera-to-world matrix, row-major, the same camera axes |
//! | `fx fy cx cy width height` | intrinsics in pixels; left out, those of the scene's first photograph |

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use viewfuse_core::camera::Camera;

use super::{RawPath, stem_of};
use crate::Scene;
use crate::rig::Rig;
use crate::scene::check::size;
use crate::scene::files::number;
use crate::scene::reader::{PoseForm, RawIntrinsics, RawPose, RawView};
use crate::scene::{FaultLocation, SceneError};

/// For the error of a wrong column.
const COLUMNS: &str =
    "name; x y z with qw qx qy qz or look_x look_y look_z, or m00 m01 .. m23; fx fy cx cy width height";

const CENTRE: [&str; 3] = ["x", "y", "z"];
const ROTATION: [&str; 4] = ["qw", "qx", "qy", "qz"];
const LOOK: [&str; 3] = ["look_x", "look_y", "look_z"];
const MATRIX: [&str; 12] = ["m00", "m01", "m02", "m03", "m10", "m11", "m12", "m13", "m20", "m21", "m22", "m23"];
const INTRINSICS: [&str; 6] = ["fx", "fy", "cx", "cy", "width", "height"];
const NAME: &str = "name";

/// The columns of a table: a name and its place.
struct Columns {
    places: BTreeMap<String, usize>,
}

/// How the poses of a table are stated.
#[derive(Clone, Copy)]
enum Form {
    Matrix,
    Rotation,
    Look,
}

impl Columns {
    /// # Errors
    /// What is wrong with the names.
    fn of(names: &csv::StringRecord) -> Result<Columns, String> {
        let mut places = BTreeMap::new();
        for (place, name) in names.iter().enumerate() {
            let name = name.trim();
            let groups: [&[&str]; 6] = [&[NAME], &CENTRE, &ROTATION, &LOOK, &MATRIX, &INTRINSICS];
            if !groups.iter().any(|group| group.contains(&name)) {
                return Err(format!("there is no column {name:?}"));
            }
            if places.insert(name.to_owned(), place).is_some() {
                return Err(format!("column {name:?} is there twice"));
            }
        }
        Ok(Columns { places })
    }

    fn has(&self, group: &[&str]) -> bool {
        group.iter().any(|name| self.places.contains_key(*name))
    }

    /// # Errors
    /// Which column is missing, or which ones exclude each other.
    fn form(&self) -> Result<Form, String> {
        let given = [self.has(&MATRIX), self.has(&ROTATION), self.has(&LOOK)];
        let form = match given {
            [true, false, false] => Form::Matrix,
            [false, true, false] => Form::Rotation,
            [false, false, true] => Form::Look,
            [false, false, false] => return Err("no column says where the cameras look".to_owned()),
            _ => return Err("the poses are stated in more than one way".to_owned()),
        };
        if matches!(form, Form::Matrix) && self.has(&CENTRE) {
            return Err("the centres are stated in more than one way".to_owned());
        }
        let needed: &[&[&str]] = match form {
            Form::Matrix => &[&MATRIX],
            Form::Rotation => &[&CENTRE, &ROTATION],
            Form::Look => &[&CENTRE, &LOOK],
        };
        let intrinsics: &[&str] = if self.has(&INTRINSICS) { &INTRINSICS } else { &[] };
        match needed.iter().copied().chain([intrinsics]).flatten().find(|name| !self.places.contains_key(**name)) {
            Some(name) => Err(format!("column {name:?} is missing")),
            None => Ok(form),
        }
    }
}

/// One line of the table.
struct Row<'a> {
    path: &'a Path,
    line: usize,
    columns: &'a Columns,
    cells: &'a csv::StringRecord,
}

impl Row<'_> {
    fn place(&self) -> FaultLocation {
        FaultLocation::Line(self.line)
    }

    /// The numbers of these columns, which are there.
    fn numbers<const N: usize>(&self, names: [&str; N]) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for (value, name) in numbers.iter_mut().zip(names) {
            let cell = self.columns.places.get(name).and_then(|place| self.cells.get(*place)).unwrap_or_default();
            *value = number(self.path, self.line, cell.trim())?;
        }
        Ok(numbers)
    }

    /// The camera-to-world matrix, row-major; `up` is the direction that is up in the pictures.
    fn matrix(&self, form: Form, up: DVec3) -> Result<[f64; 16], SceneError> {
        if matches!(form, Form::Matrix) {
            let rows = self.numbers(MATRIX)?;
            return Ok(std::array::from_fn(|index| rows.get(index).copied().unwrap_or(f64::from(index == 15))));
        }
        let centre = DVec3::from_array(self.numbers(CENTRE)?);
        let rotation = if matches!(form, Form::Rotation) {
            let [w, x, y, z] = self.numbers(ROTATION)?;
            DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
        } else {
            let forward = (DVec3::from_array(self.numbers(LOOK)?) - centre).normalize();
            let right = forward.cross(up).normalize();
            DMat3::from_cols(right, forward.cross(right), forward)
        };
        // A zero quaternion and a view straight along `up` give no numbers here, and no pose.
        let columns = [rotation.x_axis, rotation.y_axis, rotation.z_axis, centre];
        let entry = |index: usize| if index < 12 { columns[index % 4][index / 4] } else { f64::from(index == 15) };
        Ok(std::array::from_fn(entry))
    }

    fn intrinsics(&self) -> Result<Option<RawIntrinsics>, SceneError> {
        if !self.columns.has(&INTRINSICS) {
            return Ok(None);
        }
        let [fx, fy, cx, cy, width, height] = self.numbers(INTRINSICS)?;
        Ok(Some(RawIntrinsics {
            focal: [fx, fy],
            principal: [cx, cy],
            size: Some(size(self.path, self.place(), width, height)?),
            lens: None,
            path: self.path.to_path_buf(),
            place: self.place(),
            size_place: self.place(),
        }))
    }
}

pub(super) fn read(path: &Path, text: &str, scene: &Scene) -> Result<RawPath, SceneError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let not_a_table = |error: csv::Error| {
        let place =
            error.position().map_or(FaultLocation::File, |position| FaultLocation::Line(position.line() as usize));
        SceneError::Table { path: path.to_path_buf(), place, reason: error.to_string() }
    };
    let names = reader.headers().map_err(not_a_table)?;
    let place = FaultLocation::Line(names.position().map_or(1, |position| position.line() as usize));
    let wrong =
        |problem| SceneError::Columns { path: path.to_path_buf(), place: place.clone(), problem, columns: COLUMNS };
    let columns = Columns::of(names).map_err(wrong)?;
    let form = columns.form().map_err(wrong)?;
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let up = Rig::of(&cameras).up.as_dvec3();
    let mut views = Vec::new();
    for cells in reader.records() {
        let cells = &cells.map_err(not_a_table)?;
        let line = cells.position().map_or(0, |position| position.line() as usize);
        let row = Row { path, line, columns: &columns, cells };
        let pose = RawPose {
            matrix: row.matrix(form, up)?,
            form: PoseForm::WorldFromOpenCv,
            path: path.to_path_buf(),
            place: row.place(),
        };
        let name = columns.places.get(NAME).and_then(|place| cells.get(*place)).map(stem_of);
        views.push(RawView::new(name.unwrap_or_default(), None, pose, row.intrinsics()?));
    }
    Ok(RawPath { views, frames_per_second: None })
}
