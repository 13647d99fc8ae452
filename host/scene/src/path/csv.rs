//! A table of poses: comma-separated values with a line of column names first, in any order.
//!
//! | columns | what |
//! |---|---|
//! | `name` | name of the picture; may be missing |
//! | `x y z` | the camera's centre, with one of the next two |
//! | `qw qx qy qz` | rotation from the camera to the world, camera axes x right, y down, z forward; of any length |
//! | `look_x look_y look_z` | the point that is in the middle of the picture; upright by the scene's cameras |
//! | `m00 m01 m02 m03 m10 .. m23` | instead: the camera-to-world matrix, row-major, the same camera axes |
//! | `fx fy cx cy width height` | intrinsics in pixels; without them, those of the scene's first photograph |

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
use crate::scene::{FileFault, FilePlace, SceneError};

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
struct PoseColumns {
    places: BTreeMap<String, usize>,
}

/// How the poses of a table are stated.
#[derive(Clone, Copy)]
enum Form {
    Matrix,
    Rotation,
    Look,
}

impl PoseColumns {
    fn of(names: &csv::StringRecord) -> Result<PoseColumns, String> {
        let mut places = BTreeMap::new();
        for (place, name) in names.iter().enumerate() {
            let name = name.trim();
            let groups: [&[&str]; 6] = [&[NAME], &CENTRE, &ROTATION, &LOOK, &MATRIX, &INTRINSICS];
            if !groups.iter().any(|group| group.contains(&name)) {
                let separated = if name.contains(';') { ": columns are separated by commas" } else { "" };
                return Err(format!("there is no column {name:?}{separated}"));
            }
            if places.insert(name.to_owned(), place).is_some() {
                return Err(format!("column {name:?} is there twice"));
            }
        }
        Ok(PoseColumns { places })
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
struct PoseRow<'a> {
    path: &'a Path,
    line: usize,
    columns: &'a PoseColumns,
    cells: &'a csv::StringRecord,
}

impl PoseRow<'_> {
    fn place(&self) -> FilePlace {
        FilePlace::line(self.path, self.line)
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
    fn matrix(&self, form: Form, up: DVec3) -> Result<[[f64; 4]; 4], SceneError> {
        const LAST: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
        if matches!(form, Form::Matrix) {
            let [a, b, c, d, e, f, g, h, i, j, k, l] = self.numbers(MATRIX)?;
            return Ok([[a, b, c, d], [e, f, g, h], [i, j, k, l], LAST]);
        }
        let centre = DVec3::from_array(self.numbers(CENTRE)?);
        let rotation = if matches!(form, Form::Rotation) {
            let [w, x, y, z] = self.numbers(ROTATION)?;
            let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
            if !rotation.is_finite() {
                return Err(self.no_pose("qw qx qy qz are no rotation: their length is 0 or no number"));
            }
            DMat3::from_quat(rotation)
        } else {
            let direction = |vector: DVec3, why: &str| vector.try_normalize().ok_or_else(|| self.no_pose(why));
            let look = DVec3::from_array(self.numbers(LOOK)?);
            let forward = direction(look - centre, "the camera stands at the point that it is to look at")?;
            let right = direction(forward.cross(up), "the camera looks straight up or down: state its rotation")?;
            DMat3::from_cols(right, forward.cross(right), forward)
        };
        let row = |row: usize| [rotation.x_axis, rotation.y_axis, rotation.z_axis, centre].map(|column| column[row]);
        Ok([row(0), row(1), row(2), LAST])
    }

    fn no_pose(&self, why: &str) -> SceneError {
        self.place().fault(FileFault::Row(why.to_owned()))
    }

    fn intrinsics(&self) -> Result<Option<RawIntrinsics>, SceneError> {
        if !self.columns.has(&INTRINSICS) {
            return Ok(None);
        }
        let [fx, fy, cx, cy, width, height] = self.numbers(INTRINSICS)?;
        let size = Some(size(&self.place(), width, height)?);
        Ok(Some(RawIntrinsics { size, ..RawIntrinsics::of_photograph([fx, fy], [cx, cy], self.place()) }))
    }
}

pub(super) fn read(path: &Path, text: &str, scene: &Scene) -> Result<RawPath, SceneError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let not_a_table = |error: csv::Error| {
        let line = error.position().map(|position| position.line() as usize);
        let place = line.map_or_else(|| FilePlace::file(path), |line| FilePlace::line(path, line));
        place.fault(FileFault::Table(error.to_string()))
    };
    let names = reader.headers().map_err(not_a_table)?;
    let line = names.position().map_or(1, |position| position.line() as usize);
    let wrong = |problem| FilePlace::line(path, line).fault(FileFault::Columns(problem, COLUMNS));
    let columns = PoseColumns::of(names).map_err(wrong)?;
    let form = columns.form().map_err(wrong)?;
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let up = Rig::of(&cameras).up.as_dvec3();
    let (mut views, mut lines) = (Vec::new(), BTreeMap::new());
    for cells in reader.records() {
        let cells = &cells.map_err(not_a_table)?;
        let line = cells.position().map_or(0, |position| position.line() as usize);
        let row = PoseRow { path, line, columns: &columns, cells };
        let pose = RawPose { matrix: row.matrix(form, up)?, form: PoseForm::WorldFromOpenCv, place: row.place() };
        let name = columns.places.get(NAME).and_then(|place| cells.get(*place)).map(stem_of);
        let name = name.unwrap_or_default();
        if let Some(earlier) = lines.insert(name.clone(), line).filter(|_| !name.is_empty()) {
            let twice = format!("name {name:?} is that of line {earlier}, too");
            return Err(row.place().fault(FileFault::Row(twice)));
        }
        views.push(RawView::new(name, None, pose, row.intrinsics()?));
    }
    Ok(RawPath { views, ..RawPath::default() })
}
