//! The compressed `.ply` of PlayCanvas and SuperSplat: 256 Gaussians share the ranges of a row of the element `chunk`;
//! a row of `vertex` has position, rotation, scales and colour packed into a word each, and a row of `sh`, where there
//! is one, the spherical harmonics as bytes.

use std::path::Path;

use glam::DVec3;
use viewfuse_core::gaussian::{REST_COUNTS, SH_0};

use super::place::{GaussianPlace, RawGaussian};
use super::splat::logit;
use super::{GaussianScene, refused};
use crate::ply::{PlyElement, PlyHeader, PlyType};
use crate::scene::{FileFault, FilePlace, SceneError};

/// Gaussians that share a chunk.
const CHUNK: usize = 256;
/// The words of a Gaussian.
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// The least and greatest values of a chunk: positions, logarithms of scales and, in newer files, colours.
const RANGES: [&str; 3] = ["", "scale_", ""];
const AXES: [[&str; 3]; 3] = [["x", "y", "z"], ["x", "y", "z"], ["r", "g", "b"]];

/// Whether a header is that of such a file.
pub(super) fn is_of(header: &PlyHeader<'_>) -> bool {
    let is_packed = |element: &PlyElement| element.property(WORDS[0]).is_some();
    header.elements.iter().any(|element| element.name == "vertex" && is_packed(element))
}

/// Where a number is in a row.
fn offset(path: &Path, element: &PlyElement, name: &str, kind: PlyType) -> Result<usize, SceneError> {
    let property = element.property(name).filter(|property| property.kind == kind);
    let missing = || FilePlace::file(path).fault(FileFault::MissingKey(format!("property {name}")));
    property.map(|property| property.offset).ok_or_else(missing)
}

pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    header: &PlyHeader<'_>,
    place: &GaussianPlace<'_>,
) -> Result<GaussianScene, SceneError> {
    let (chunk, chunks) = header.rows(bytes, "chunk")?;
    let (vertex, vertices) = header.rows(bytes, "vertex")?;
    let (chunk_size, size) = (chunk.row_size.unwrap_or(1).max(1), vertex.row_size.unwrap_or(1).max(1));
    let has_colours = chunk.property("min_r").is_some();
    let range_count = if has_colours { 3 } else { 2 };
    let mut offsets = [[[0; 3]; 2]; 3];
    for (range, offsets) in offsets.iter_mut().enumerate().take(range_count) {
        for (end, offsets) in ["min", "max"].iter().zip(offsets) {
            for (axis, place) in AXES[range].iter().zip(offsets) {
                *place = offset(path, chunk, &format!("{end}_{}{axis}", RANGES[range]), PlyType::Float)?;
            }
        }
    }
    let mut words = [0; 4];
    for (name, place) in WORDS.iter().zip(&mut words) {
        *place = offset(path, vertex, name, PlyType::Whole(4))?;
    }
    let count = vertices.len() / size;
    if chunks.len() / chunk_size < count.div_ceil(CHUNK) {
        return Err(refused(path, "a compressed .ply with too few chunks for its Gaussians"));
    }
    let mut gaussians = Vec::with_capacity(count);
    for (index, row) in vertices.chunks_exact(size).enumerate() {
        let chunk = &chunks[index / CHUNK * chunk_size..][..chunk_size];
        // A share of a range.
        let lerp = |range: usize, axis: usize, share: f64| {
            let [least, most] = offsets[range].map(|end| f64::from(f32::from_bits(word(chunk, end[axis]))));
            least + share * (most - least)
        };
        let [position, rotation, scale, colour] = words.map(|at| word(row, at));
        let (position, scale) = (eleven_ten_eleven(position), eleven_ten_eleven(scale));
        let colour = [24, 16, 8, 0].map(|shift| f64::from(colour >> shift & 255) / 255.0);
        let shown = |axis: usize| if has_colours { lerp(2, axis, colour[axis]) } else { colour[axis] };
        let raw = RawGaussian {
            position: DVec3::new(lerp(0, 0, position[0]), lerp(0, 1, position[1]), lerp(0, 2, position[2])),
            log_scales: [0, 1, 2].map(|axis| lerp(1, axis, scale[axis])),
            rotation: without_greatest(rotation),
            opacity: logit(colour[3]),
            f_dc: [0, 1, 2].map(|channel| (shown(channel) as f32 - 0.5) / SH_0),
        };
        gaussians.push(place.gaussian(index, &raw)?);
    }
    let (degree, f_rest) = harmonics(path, bytes, header, count)?;
    Ok(GaussianScene { gaussians, degree, f_rest, is_antialiased: false })
}

/// The element `sh`: a byte a coefficient, from -4 to 4, in the order of `f_rest`.
fn harmonics(path: &Path, bytes: &[u8], header: &PlyHeader<'_>, count: usize) -> Result<(u32, Vec<f32>), SceneError> {
    if !header.elements.iter().any(|element| element.name == "sh") {
        return Ok((0, Vec::new()));
    }
    let (element, rows) = header.rows(bytes, "sh")?;
    let width = element.properties.len();
    let degree = REST_COUNTS.iter().position(|rest| 3 * *rest as usize == width && width > 0);
    let are_bytes = element.properties.iter().all(|property| property.kind == PlyType::Whole(1));
    match degree {
        Some(degree) if are_bytes && rows.len() == count * width => {
            let value = |byte: &u8| match *byte {
                0 => -4.0,
                255 => 4.0,
                byte => ((f32::from(byte) + 0.5) / 256.0 - 0.5) * 8.0,
            };
            Ok((degree as u32, rows.iter().map(value).collect()))
        }
        _ => Err(refused(path, "a compressed .ply whose element sh has not 9, 24 or 45 bytes for each Gaussian")),
    }
}

fn word(row: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])
}

/// Three shares of 11, 10 and 11 bits.
fn eleven_ten_eleven(word: u32) -> [f64; 3] {
    [f64::from(word >> 21) / 2047.0, f64::from(word >> 11 & 1023) / 1023.0, f64::from(word & 2047) / 2047.0]
}

/// A quaternion `w, x, y, z` from all but its greatest number, whose index is in the highest two bits.
fn without_greatest(word: u32) -> [f32; 4] {
    let greatest = (word >> 30) as usize;
    let mut parts =
        [20, 10, 0].map(|shift| ((word >> shift & 1023) as f32 / 1023.0 - 0.5) * std::f32::consts::SQRT_2).into_iter();
    let mut rotation = [0.0; 4];
    let rest = (0..4).filter(|index| *index != greatest);
    rest.zip(&mut parts).for_each(|(index, value)| rotation[index] = value);
    let square: f32 = rotation.iter().map(|value| value * value).sum();
    rotation[greatest] = (1.0 - square).max(0.0).sqrt();
    rotation
}
