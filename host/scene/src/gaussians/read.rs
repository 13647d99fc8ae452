//! Reading a file of Gaussians.

use std::path::Path;

use glam::DVec3;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_core::pose::MAX_COORDINATE;
use viewfuse_job::files::read_at_most;

use super::{Gaussian, GaussianScene, MAX_LOGARITHM};
use crate::SceneFrame;
use crate::ply::{PlyElement, PlyHeader, PlyProperty, PlyType};
use crate::scene::files::unreadable;
use crate::scene::{FaultLocation, PlyFault, SceneError};

/// The element whose rows are Gaussians.
const ELEMENT: &str = "vertex";
/// Most bytes of a file: 18 million Gaussians of degree 3.
const MAX_BYTES: u64 = 4 << 30;

/// The columns that are read, in the order of [`Row::values`].
const COLUMNS: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

pub(super) fn read(path: &Path, frame: &SceneFrame) -> Result<GaussianScene, SceneError> {
    let bytes = read_at_most(path, MAX_BYTES).map_err(|cause| unreadable(path, cause))?;
    let header = PlyHeader::read(path, &bytes)?;
    let (element, rows) = header.rows(&bytes, ELEMENT)?;
    let columns = COLUMNS.map(|name| column(path, element, name));
    let columns = columns.into_iter().collect::<Result<Vec<_>, _>>()?;
    let rest_columns = rest(path, element)?;
    let degree = REST_COUNTS.iter().position(|count| 3 * *count as usize == rest_columns.len());
    // `rest` accepts only these numbers.
    let degree = degree.unwrap_or_default() as u32;
    // Rows have at least the columns above: the lengths are bounded by that of the file.
    let size = element.row_size.unwrap_or(1).max(1);
    let mut gaussians = Vec::with_capacity(rows.len() / size);
    let mut f_rest = Vec::with_capacity(rows.len() / size * rest_columns.len());
    for (index, bytes) in rows.chunks_exact(size).enumerate() {
        let row = Row { path, index, bytes };
        gaussians.push(row.gaussian(&columns, frame)?);
        for column in &rest_columns {
            f_rest.push(row.finite(column)? as f32);
        }
    }
    Ok(GaussianScene { gaussians, degree, f_rest })
}

/// The property of this name, a `float` or a `double`.
fn column<'a>(path: &Path, element: &'a PlyElement, name: &str) -> Result<&'a PlyProperty, SceneError> {
    let missing = || SceneError::MissingKey { path: path.to_path_buf(), key: format!("property {name}") };
    let property = element.property(name).ok_or_else(missing)?;
    if let PlyType::Whole(_) = property.kind {
        let key = format!("property {name}");
        return Err(SceneError::WrongType { path: path.to_path_buf(), key, expected: "float or double" });
    }
    Ok(property)
}

/// The properties `f_rest_0`, `f_rest_1` and so on: none, 9, 24 or 45.
fn rest<'a>(path: &Path, element: &'a PlyElement) -> Result<Vec<&'a PlyProperty>, SceneError> {
    let count = element.properties.iter().filter(|property| property.name.starts_with("f_rest_")).count();
    if !REST_COUNTS.iter().any(|degree| 3 * *degree as usize == count) {
        let fault = PlyFault::RestCount(count);
        return Err(SceneError::Ply { path: path.to_path_buf(), place: FaultLocation::File, fault });
    }
    (0..count).map(|index| column(path, element, &format!("f_rest_{index}"))).collect()
}

/// A row of the file.
struct Row<'a> {
    path: &'a Path,
    index: usize,
    bytes: &'a [u8],
}

impl Row<'_> {
    fn gaussian(&self, columns: &[&PlyProperty], frame: &SceneFrame) -> Result<Gaussian, SceneError> {
        let [mut x, mut y, mut z] = [0, 1, 2].map(|column| self.value(columns[column]));
        if *frame != SceneFrame::FILE {
            [x, y, z] = frame.world(DVec3::new(x, y, z)).to_array();
        }
        let limit = f64::from(MAX_COORDINATE);
        if ![x, y, z].iter().all(|coordinate| coordinate.abs() <= limit) {
            let [x, y, z] = [0, 1, 2].map(|column| self.value(columns[column]));
            return Err(SceneError::Point { path: self.path.to_path_buf(), place: self.place(""), x, y, z });
        }
        let log_scale = frame.scale.ln();
        let scale = |column: usize| Ok::<_, SceneError>(limited(self.logarithm(columns[column], false)? - log_scale));
        let finite = |column: usize| self.finite(columns[column]).map(|value| value as f32);
        Ok(Gaussian {
            position: [x, y, z].map(|coordinate| coordinate as f32),
            f_dc: [finite(3)?, finite(4)?, finite(5)?],
            opacity: limited(self.logarithm(columns[6], true)?),
            log_scales: [scale(7)?, scale(8)?, scale(9)?],
            rotation: [finite(10)?, finite(11)?, finite(12)?, finite(13)?],
        })
    }

    fn value(&self, property: &PlyProperty) -> f64 {
        let bytes = &self.bytes[property.offset..property.offset + property.kind.size()];
        match property.kind {
            PlyType::Double => f64::from_le_bytes(bytes.try_into().unwrap_or_default()),
            _ => f64::from(f32::from_le_bytes(bytes.try_into().unwrap_or_default())),
        }
    }

    /// A value that is finite as `f32`.
    fn finite(&self, property: &PlyProperty) -> Result<f64, SceneError> {
        let value = self.value(property);
        if (value as f32).is_finite() { Ok(value) } else { Err(self.not_finite(property, value)) }
    }

    /// A logarithm or a logit: not NaN, and not infinite upwards unless `may_be_huge`.
    fn logarithm(&self, property: &PlyProperty, may_be_huge: bool) -> Result<f64, SceneError> {
        let value = self.value(property);
        let is_huge = value == f64::INFINITY && !may_be_huge;
        if value.is_nan() || is_huge { Err(self.not_finite(property, value)) } else { Ok(value) }
    }

    fn not_finite(&self, property: &PlyProperty, value: f64) -> SceneError {
        let (path, word) = (self.path.to_path_buf(), value.to_string());
        SceneError::NotFinite { path, place: self.place(&format!(".{}", property.name)), word }
    }

    fn place(&self, of: &str) -> FaultLocation {
        FaultLocation::Key(format!("{ELEMENT}[{}]{of}", self.index))
    }
}

fn limited(logarithm: f64) -> f32 {
    let most = f64::from(MAX_LOGARITHM);
    logarithm.clamp(-most, most) as f32
}
