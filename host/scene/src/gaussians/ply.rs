//! Reading a PLY file of Gaussians in the layout of the published code.

use std::path::Path;

use glam::DVec3;
use viewfuse_core::gaussian::{REST_COUNTS, SH_0};

use super::place::{GaussianPlace, RawGaussian};
use super::splat::logit;
use super::{Gaussian, GaussianScene, refused};
use crate::ply::{PlyElement, PlyHeader, PlyProperty, PlyType};
use crate::scene::{FileFault, FilePlace, PlyFault, SceneError, SceneFault};

/// The element whose rows are Gaussians.
const ELEMENT: &str = "vertex";

/// The columns that are read, in the order of [`GaussianRow::gaussian`].
const COLUMNS: [&str; 14] = [
    "x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "f_dc_0", "f_dc_1",
    "f_dc_2",
];
/// Columns of no meaning for a picture: the published code writes zeros.
const NORMALS: [&str; 3] = ["nx", "ny", "nz"];
/// The columns of colours where there are no coefficients.
const RGB: [&str; 3] = ["red", "green", "blue"];
/// The standard deviation of mip-splatting's smoothing filter, in the units of the positions.
const FILTER: &str = "filter_3D";

/// What is in the file's rows.
struct GaussianColumns<'a> {
    /// [`COLUMNS`]; without the third scale for flat Gaussians, without coefficients for colours of [`RGB`].
    values: [Option<&'a PlyProperty>; 14],
    rgb: Option<[&'a PlyProperty; 3]>,
    filter: Option<&'a PlyProperty>,
}

impl<'a> GaussianColumns<'a> {
    fn of(path: &Path, element: &'a PlyElement, notes: &mut Vec<String>) -> Result<GaussianColumns<'a>, SceneError> {
        let has = |name: &str| element.property(name).is_some();
        if has("x") && !has("opacity") && !COLUMNS[4..11].iter().any(|name| has(name)) {
            let problem = "a point cloud or a mesh, not Gaussians: it has no scales, rotations and opacities; make \
                           Gaussians of the scene's photographs with `optimise`, or of the points with a trainer";
            return Err(refused(path, problem));
        }
        let rgb = (!has("f_dc_0") && RGB.iter().all(|name| has(name)))
            .then(|| RGB.map(|name| element.property(name).filter(|property| property.kind == PlyType::Whole(1))));
        let rgb = match rgb {
            Some([Some(red), Some(green), Some(blue)]) => Some([red, green, blue]),
            _ => None,
        };
        let is_flat = !has("scale_2") && has("scale_1");
        let mut values = [None; 14];
        for (index, (name, value)) in COLUMNS.iter().zip(&mut values).enumerate() {
            let is_absent = is_flat && *name == "scale_2" || rgb.is_some() && index >= 11;
            *value = if is_absent { None } else { Some(column(path, element, name)?) };
        }
        let filter = if has(FILTER) { Some(column(path, element, FILTER)?) } else { None };
        let is_known = |name: &str| {
            [&COLUMNS[..], &NORMALS, &[FILTER]].concat().contains(&name)
                || name.starts_with("f_rest_")
                || rgb.is_some() && RGB.contains(&name)
        };
        let unknown: Vec<&str> = element
            .properties
            .iter()
            .map(|property| property.name.as_str())
            .filter(|name| !is_known(name))
            .take(8)
            .collect();
        if !unknown.is_empty() {
            notes.push(format!("properties without effect: {} (not known)", unknown.join(", ")));
        }
        if filter.is_some() {
            notes.push("filter_3D: scales and opacities are those of mip-splatting's 3D filter".to_owned());
        }
        if is_flat {
            notes.push("there is no scale_2: flat Gaussians (2DGS), drawn as 3D ones without thickness".to_owned());
        }
        if rgb.is_some() {
            notes.push("colours are red, green and blue of 8 bits: they are the same from everywhere".to_owned());
        }
        Ok(GaussianColumns { values, rgb, filter })
    }
}

pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    header: &PlyHeader<'_>,
    place: &GaussianPlace<'_>,
    notes: &mut Vec<String>,
) -> Result<GaussianScene, SceneError> {
    let (element, rows) = header.rows(bytes, ELEMENT)?;
    let columns = GaussianColumns::of(path, element, notes)?;
    let surplus = header.surplus(bytes);
    if surplus > 0 {
        notes.push(format!("{surplus} bytes behind the rows are not read: the header may count too few of them"));
    }
    // Rows have at least these columns: the lengths are bounded by that of the file.
    let size = element.row_size.unwrap_or(1).max(1);
    let rest_columns = without_padding(rest(path, element)?, rows, size);
    let degree = REST_COUNTS.iter().position(|count| 3 * *count as usize == rest_columns.len());
    // `rest` accepts only these numbers.
    let degree = degree.unwrap_or_default() as u32;
    let mut gaussians = Vec::with_capacity(rows.len() / size);
    let mut f_rest = Vec::with_capacity(rows.len() / size * rest_columns.len());
    for (index, bytes) in rows.chunks_exact(size).enumerate() {
        let row = GaussianRow { path, index, bytes };
        gaussians.push(row.gaussian(&columns, place)?);
        for column in &rest_columns {
            f_rest.push(row.finite(column)? as f32);
        }
    }
    // mip-splatting has a 2D filter, too, under which splats keep their integral.
    Ok(GaussianScene { gaussians, degree, f_rest, is_antialiased: columns.filter.is_some() })
}

/// The columns without those of the greatest degrees that are 0 in all rows: strict readers want them to be there.
fn without_padding<'a>(mut columns: Vec<&'a PlyProperty>, rows: &[u8], size: usize) -> Vec<&'a PlyProperty> {
    for degree in (1..REST_COUNTS.len()).rev() {
        let (count, below) = (REST_COUNTS[degree] as usize, REST_COUNTS[degree - 1] as usize);
        if columns.len() != 3 * count {
            continue;
        }
        let is_of_degree = |index: usize| index % count >= below;
        let of_degree: Vec<_> = columns.iter().enumerate().filter(|(index, _)| is_of_degree(*index)).collect();
        let is_zero = |row: &[u8]| {
            of_degree
                .iter()
                .all(|(_, column)| row[column.offset..column.offset + column.kind.size()].iter().all(|byte| *byte == 0))
        };
        if !rows.chunks_exact(size).all(is_zero) {
            break;
        }
        columns = columns
            .into_iter()
            .enumerate()
            .filter(|(index, _)| !is_of_degree(*index))
            .map(|(_, column)| column)
            .collect();
    }
    columns
}

/// The property of this name, a `float` or a `double`.
fn column<'a>(path: &Path, element: &'a PlyElement, name: &str) -> Result<&'a PlyProperty, SceneError> {
    let (place, key) = (FilePlace::file(path), format!("property {name}"));
    match element.property(name) {
        None => Err(place.fault(FileFault::MissingKey(key))),
        Some(PlyProperty { kind: PlyType::Whole(_), .. }) => {
            Err(place.fault(FileFault::WrongType(key, "float or double")))
        }
        Some(property) => Ok(property),
    }
}

/// The properties `f_rest_0`, `f_rest_1` and so on: none, 9, 24 or 45.
fn rest<'a>(path: &Path, element: &'a PlyElement) -> Result<Vec<&'a PlyProperty>, SceneError> {
    let count = element.properties.iter().filter(|property| property.name.starts_with("f_rest_")).count();
    if !REST_COUNTS.iter().any(|degree| 3 * *degree as usize == count) {
        return Err(FilePlace::file(path).fault(SceneFault::Ply(PlyFault::RestCount(count))));
    }
    (0..count).map(|index| column(path, element, &format!("f_rest_{index}"))).collect()
}

/// A row of the file.
struct GaussianRow<'a> {
    path: &'a Path,
    index: usize,
    bytes: &'a [u8],
}

impl GaussianRow<'_> {
    fn gaussian(&self, columns: &GaussianColumns<'_>, place: &GaussianPlace<'_>) -> Result<Gaussian, SceneError> {
        let values = &columns.values;
        let value = |index: usize| values[index].map_or(Ok(0.0), |column| self.finite(column));
        let scale = |index: usize| values[index].map_or(Ok(f64::NEG_INFINITY), |column| self.logarithm(column, false));
        let position = [0, 1, 2].map(|index| values[index].map_or(0.0, |column| self.value(column)));
        let mut raw = RawGaussian {
            position: DVec3::from(position),
            opacity: values[3].map_or(Ok(0.0), |column| self.logarithm(column, true))?,
            log_scales: [scale(4)?, scale(5)?, scale(6)?],
            rotation: [value(7)? as f32, value(8)? as f32, value(9)? as f32, value(10)? as f32],
            f_dc: match columns.rgb {
                Some(rgb) => rgb.map(|column| (f32::from(self.bytes[column.offset]) / 255.0 - 0.5) / SH_0),
                None => [value(11)? as f32, value(12)? as f32, value(13)? as f32],
            },
        };
        if let Some(filter) = columns.filter {
            raw.smooth(self.finite(filter)?);
        }
        place.gaussian(self.index, &raw)
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
        let key = format!("{ELEMENT}[{}].{}", self.index, property.name);
        FilePlace::key(self.path, key).fault(FileFault::NotFinite(value.to_string()))
    }
}

impl RawGaussian {
    /// Convolves it with a Gaussian of this standard deviation; its integral remains.
    fn smooth(&mut self, deviation: f64) {
        let mut log_share = 0.0;
        for log_scale in &mut self.log_scales {
            let wider = 0.5 * ((2.0 * *log_scale).exp() + deviation * deviation).ln();
            log_share += *log_scale - wider;
            *log_scale = wider;
        }
        // No width at all, and no filter.
        let share = if log_share.is_nan() { 1.0 } else { log_share.exp() };
        self.opacity = logit(share / (1.0 + (-self.opacity).exp()));
    }
}
