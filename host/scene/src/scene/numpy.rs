//! NumPy's files: arrays (`.npy`, versions 1 to 3) and zip archives of them (`.npz`, stored or deflated).
//!
//! Little-endian floating point numbers of 32 and 64 bits are supported, in C and in Fortran order. The header is a
//! Python literal; only the three keys that NumPy writes are parsed, nothing is evaluated.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use zip::ZipArchive;
use zip::result::ZipError;

use super::bytes;
use super::error::{SceneError, SceneFault};
use super::fault::{FilePlace, NumpyFault};
use super::files::unreadable;

/// The magic number of a file.
const MAGIC: &[u8] = b"\x93NUMPY";
/// Most bytes of a header.
const MAX_HEADER: usize = 1 << 16;
/// Most dimensions of an array.
const MAX_DIMENSIONS: usize = 8;
/// Most bytes of an array in an archive: cameras take some hundred.
const MAX_ENTRY: u64 = 1 << 24;

/// An array of numbers, row-major.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NumpyArray {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// The array of a `.npy` file.
pub(super) fn read_npy(path: &Path) -> Result<NumpyArray, SceneError> {
    let bytes = bytes::read(path)?;
    parse(&bytes).map_err(|fault| FilePlace::file(path).fault(SceneFault::Numpy(fault)))
}

/// The arrays of an `.npz` file for whose name (without `.npy`) `wanted` holds.
pub(super) fn read_npz(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<BTreeMap<String, NumpyArray>, SceneError> {
    let zip_error = |cause: ZipError| FilePlace::file(path).fault(SceneFault::Zip(cause));
    let file = File::open(path).map_err(|cause| unreadable(path, cause))?;
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(zip_error)?;
    let mut arrays = BTreeMap::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(zip_error)?;
        let name = entry.name().map_err(zip_error)?.trim_end_matches(".npy").to_string();
        if !wanted(&name) {
            continue;
        }
        let failed = |fault| FilePlace::key(path, &name).fault(SceneFault::Numpy(fault));
        let mut bytes = Vec::new();
        let read = entry.take(MAX_ENTRY + 1).read_to_end(&mut bytes);
        read.map_err(|cause| zip_error(ZipError::Io(cause)))?;
        if bytes.len() as u64 > MAX_ENTRY {
            return Err(failed(NumpyFault::TooLarge));
        }
        let array = parse(&bytes).map_err(failed)?;
        if arrays.insert(name.clone(), array).is_some() {
            return Err(failed(NumpyFault::Twice));
        }
    }
    Ok(arrays)
}

/// An array from the bytes of a `.npy` file.
fn parse(bytes: &[u8]) -> Result<NumpyArray, NumpyFault> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(NumpyFault::Magic)?;
    let (header, data) = match *rest {
        [1, _, a, b, ..] => split(&rest[4..], u16::from_le_bytes([a, b]).into())?,
        [2 | 3, _, a, b, c, d, ..] => split(&rest[6..], u32::from_le_bytes([a, b, c, d]) as usize)?,
        [version, _, ..] if version > 3 => return Err(NumpyFault::Version(version)),
        _ => return Err(NumpyFault::Truncated),
    };
    let kind = quoted(value_of(header, "descr")?);
    let fortran = match value_of(header, "fortran_order")? {
        text if text.starts_with("False") => false,
        text if text.starts_with("True") => true,
        _ => return Err(NumpyFault::Header("fortran_order")),
    };
    let shape = shape(value_of(header, "shape")?)?;
    let width = match kind {
        "<f8" => 8,
        "<f4" => 4,
        _ => return Err(NumpyFault::Kind(kind.chars().take(16).collect())),
    };
    let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side)).ok_or(NumpyFault::Truncated)?;
    let wanted = count.checked_mul(width).ok_or(NumpyFault::Truncated)?;
    let data = data.get(..wanted).ok_or(NumpyFault::Truncated)?;
    let values: Vec<f64> = match width {
        8 => data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
        _ => data.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect(),
    };
    if let Some(index) = values.iter().position(|value| !value.is_finite()) {
        return Err(NumpyFault::NotFinite(index, values[index]));
    }
    Ok(if fortran { NumpyArray { values: row_major(&values, &shape), shape } } else { NumpyArray { shape, values } })
}

fn split(bytes: &[u8], length: usize) -> Result<(&str, &[u8]), NumpyFault> {
    if length > MAX_HEADER || length > bytes.len() {
        return Err(NumpyFault::Truncated);
    }
    let (header, data) = bytes.split_at(length);
    Ok((std::str::from_utf8(header).map_err(|_| NumpyFault::Header("its text"))?, data))
}

/// The text after a key of the header.
fn value_of<'a>(header: &'a str, key: &'static str) -> Result<&'a str, NumpyFault> {
    let at = ['\'', '"'].iter().find_map(|quote| {
        let quoted = format!("{quote}{key}{quote}");
        header.find(&quoted).map(|at| at + quoted.len())
    });
    let rest = at.and_then(|at| header[at..].trim_start().strip_prefix(':'));
    rest.map(str::trim_start).ok_or(NumpyFault::Header(key))
}

/// The text in quotes that a text begins with; empty if it begins with none.
fn quoted(text: &str) -> &str {
    let quote = text.chars().next().filter(|first| ['\'', '"'].contains(first));
    quote.and_then(|quote| text[1..].split(quote).next()).unwrap_or_default()
}

/// The dimensions in a text like `(20, 17)`.
fn shape(text: &str) -> Result<Vec<usize>, NumpyFault> {
    let fault = || NumpyFault::Header("shape");
    let inside = text.strip_prefix('(').and_then(|rest| rest.split_once(')')).ok_or_else(fault)?.0;
    let sides: Vec<usize> = inside
        .split(',')
        .map(str::trim)
        .filter(|side| !side.is_empty())
        .map(|side| side.parse().map_err(|_| fault()))
        .collect::<Result<_, _>>()?;
    if sides.len() > MAX_DIMENSIONS { Err(fault()) } else { Ok(sides) }
}

/// Numbers in Fortran order (the first index runs fastest) in C order.
fn row_major(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let place = |mut index: usize| {
        let mut from = 0;
        let mut steps: usize = values.len();
        for side in shape.iter().rev() {
            steps /= side;
            from += index % side * steps;
            index /= side;
        }
        from
    };
    (0..values.len()).map(|index| values[place(index)]).collect()
}
