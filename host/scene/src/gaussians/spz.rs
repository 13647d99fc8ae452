//! `.spz`, Niantic's format: gzip around a header of 16 bytes and one array after the other of positions (fixed point
//! of 24 bits), opacities, colours, logarithms of the standard deviations, quaternions and spherical harmonics.
//!
//! Its axes are right, up, back where those of a `.ply` are right, down, front: y and z change their sign.

use std::io::{Read, Write};
use std::path::Path;

use flate2::read::GzDecoder;
use flate2::{Compression, GzBuilder};
use glam::DVec3;
use viewfuse_core::gaussian::{REST_COUNTS, opacity};

use super::harmonics::signs_without_yz;
use super::place::{GaussianPlace, RawGaussian};
use super::splat::{logit, unit};
use super::{Gaussian, GaussianScene, MAX_DEGREE, refused};
use crate::SceneFrame;
use crate::scene::SceneError;

const MAGIC: [u8; 4] = *b"NGSP";
const HEADER: usize = 16;
/// The version that all readers read.
const WRITTEN: u32 = 2;
/// Most Gaussians of a file: what the format's own library reads.
const MAX_COUNT: u32 = 10_000_000;
/// A colour's coefficient of degree 0 at the ends of a byte's range is half of the reciprocal.
const COLOUR: f32 = 0.15;
/// The flag of a scene whose splats keep their integral when they are dilated.
const ANTIALIASED: u8 = 1;
/// The comment in the header of what viewfuse writes.
const COMMENT: &str = "viewfuse";
/// Bytes behind the arrays from which on a file is no such file.
const MAX_SURPLUS: u64 = 1 << 20;
/// The greatest share of Gaussians that are smaller or larger than the format holds: of the room in a thousandth of its
/// unit, where it was 0.32, a view lost 0.8 dB; at 0.12 0.4 dB.
const MAX_BEYOND: f64 = 0.1;
/// Levels of a magnitude in the quaternions of version 3.
const MAGNITUDE: u32 = (1 << 9) - 1;

/// Whether viewfuse wrote a file, which its header says: in the coordinates of a scene's files.
pub(super) fn is_by_viewfuse(bytes: &[u8]) -> bool {
    let mut stream = GzDecoder::new(bytes);
    let begun = stream.read(&mut [0]);
    begun.is_ok() && stream.header().and_then(|header| header.comment()) == Some(COMMENT.as_bytes())
}

pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    place: &GaussianPlace<'_>,
    notes: &mut Vec<String>,
) -> Result<GaussianScene, SceneError> {
    let damaged = || refused(path, "not a readable .spz file: it is damaged or ends too early");
    let mut stream = GzDecoder::new(bytes);
    let mut take = |size: usize| {
        let mut part = Vec::new();
        let outcome = stream.by_ref().take(size as u64).read_to_end(&mut part);
        let is_whole = outcome.is_ok() && part.len() == size;
        if is_whole { Ok(part) } else { Err(damaged()) }
    };
    let header = take(HEADER)?;
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let (version, count, degree) = (word(4), word(8), u32::from(header[12]));
    let (fraction, flags) = (header[13], header[14]);
    if header[..4] != MAGIC {
        return Err(refused(path, "a file compressed by gzip that is no .spz"));
    }
    if !(2..=3).contains(&version) || degree > MAX_DEGREE || fraction > 24 {
        let problem = format!(
            ".spz of version {version}, degree {degree}, {fraction} bits of fraction: versions 2 and 3, degrees 0 to \
             {MAX_DEGREE}, 24 bits at most are read; convert it to .ply with splat-transform or SuperSplat"
        );
        return Err(refused(path, &problem));
    }
    if flags & !ANTIALIASED != 0 {
        // Extensions stand before the arrays, and may change what those mean.
        let problem =
            format!(".spz with extensions (flags {flags:#x}), which are not read: convert it to .ply with its program");
        return Err(refused(path, &problem));
    }
    if count > MAX_COUNT {
        return Err(refused(path, &format!(".spz announces {count} Gaussians; {MAX_COUNT} are read")));
    }
    let (count, rest_count) = (count as usize, REST_COUNTS[degree as usize] as usize);
    let rotation_size = if version == 2 { 3 } else { 4 };
    let (positions, alphas, colours) = (take(9 * count)?, take(count)?, take(3 * count)?);
    let (scales, rotations, harmonics) =
        (take(3 * count)?, take(rotation_size * count)?, take(3 * rest_count * count)?);
    // The checksum stands at the end.
    match std::io::copy(&mut stream.take(MAX_SURPLUS), &mut std::io::sink()) {
        Ok(0) => {}
        Ok(surplus) if surplus < MAX_SURPLUS => notes.push(format!("{surplus} bytes behind the arrays are not read")),
        _ => return Err(damaged()),
    }
    let mut gaussians = Vec::with_capacity(count);
    for index in 0..count {
        let fixed = |axis: usize| {
            let at = 9 * index + 3 * axis;
            let value = i32::from_le_bytes([0, positions[at], positions[at + 1], positions[at + 2]]) >> 8;
            f64::from(value) / f64::from(1_u32 << fraction)
        };
        let rotation = &rotations[rotation_size * index..][..rotation_size];
        let [x, y, z, w] = if version == 2 { first_three(rotation) } else { smallest_three(rotation) };
        let three = |of: &[u8]| [of[3 * index], of[3 * index + 1], of[3 * index + 2]];
        let raw = RawGaussian {
            position: DVec3::new(fixed(0), -fixed(1), -fixed(2)),
            log_scales: three(&scales).map(|byte| f64::from(byte) / 16.0 - 10.0),
            rotation: [w, x, -y, -z],
            opacity: logit(f64::from(alphas[index]) / 255.0),
            f_dc: three(&colours).map(|byte| (f32::from(byte) / 255.0 - 0.5) / COLOUR),
        };
        gaussians.push(place.gaussian(index, &raw)?);
    }
    // The channel is the inner axis.
    let signs = signs_without_yz();
    let rest = (0..3 * rest_count * count).map(|at| {
        let (index, channel, coefficient) = (at / (3 * rest_count), at / rest_count % 3, at % rest_count);
        let byte = harmonics[3 * rest_count * index + 3 * coefficient + channel];
        signs[coefficient] * (f32::from(byte) - 128.0) / 128.0
    });
    Ok(GaussianScene { gaussians, degree, f_rest: rest.collect(), is_antialiased: flags & ANTIALIASED != 0 })
}

/// A quaternion `x, y, z, w` of version 2: `x, y, z`.
fn first_three(bytes: &[u8]) -> [f32; 4] {
    let [x, y, z] = [0, 1, 2].map(|at| f32::from(bytes[at]) / 127.5 - 1.0);
    [x, y, z, (1.0 - x * x - y * y - z * z).max(0.0).sqrt()]
}

/// A quaternion `x, y, z, w` of version 3: all but the greatest, whose index is in the highest two bits.
fn smallest_three(bytes: &[u8]) -> [f32; 4] {
    let mut word = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let greatest = (word >> 30) as usize;
    let mut rotation = [0.0; 4];
    for index in (0..4).rev().filter(|index| *index != greatest) {
        let magnitude = std::f32::consts::FRAC_1_SQRT_2 * (word & MAGNITUDE) as f32 / MAGNITUDE as f32;
        rotation[index] = if word & (MAGNITUDE + 1) == 0 { magnitude } else { -magnitude };
        word >>= 10;
    }
    let square: f32 = rotation.iter().map(|value| value * value).sum();
    rotation[greatest] = (1.0 - square).max(0.0).sqrt();
    rotation
}

/// The file's bytes. As many bits of a position as its greatest coordinate leaves are its fraction.
///
/// # Errors
/// What the format cannot hold.
pub(super) fn bytes(scene: &GaussianScene, frame: &SceneFrame) -> Result<Vec<u8>, String> {
    let place = |position: [f32; 3]| frame.file(glam::Vec3::from(position).as_dvec3()) * DVec3::new(1.0, -1.0, -1.0);
    let greatest = scene
        .gaussians
        .iter()
        .map(|gaussian| place(gaussian.position).abs().max_element())
        .fold(0.0, f64::max)
        .max(1.0e-9);
    let fraction = (f64::from((1 << 23) - 1) / greatest).log2().floor().min(23.0);
    if fraction < 0.0 {
        return Err(format!(".spz has no room for the coordinate {greatest:e}"));
    }
    // What is too thin in one direction looks the same; in two, it looks thicker than it is.
    let is_beyond = |gaussian: &&Gaussian| {
        let mut log_scales = gaussian.log_scales;
        log_scales.sort_by(f32::total_cmp);
        !(-10.0..=5.9).contains(&(f64::from(log_scales[1]) + frame.scale.ln()))
    };
    let beyond = scene.gaussians.iter().filter(is_beyond).count() as f64 / scene.gaussians.len().max(1) as f64;
    if beyond > MAX_BEYOND {
        return Err(format!(
            ".spz holds standard deviations from 4.5e-5 to 370; {:.0} % of the Gaussians here are smaller or larger",
            100.0 * beyond
        ));
    }
    let [mut positions, mut alphas, mut colours, mut scales, mut rotations, mut harmonics] =
        std::array::from_fn(|_| Vec::new());
    let byte = |value: f32| value.round() as u8;
    let (rest_count, signs) = (REST_COUNTS[scene.degree.min(MAX_DEGREE) as usize] as usize, signs_without_yz());
    for (index, gaussian) in scene.gaussians.iter().enumerate() {
        for coordinate in place(gaussian.position).to_array() {
            let fixed = (coordinate * fraction.exp2()).round() as i32;
            positions.extend(&fixed.to_le_bytes()[..3]);
        }
        alphas.push(byte(opacity(gaussian.opacity) * 255.0));
        colours.extend(gaussian.f_dc.map(|value| byte((value * COLOUR + 0.5) * 255.0)));
        scales.extend(gaussian.log_scales.map(|value| byte((value + frame.scale.ln() as f32 + 10.0) * 16.0)));
        let [w, x, y, z] = unit(gaussian.rotation);
        // w is not stored, and not negative.
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        rotations.extend([x, -y, -z].map(|value| byte((sign * value + 1.0) * 127.5)));
        for at in 0..3 * rest_count {
            let (coefficient, channel) = (at / 3, at % 3);
            let rest = scene.f_rest.get(3 * rest_count * index + rest_count * channel + coefficient);
            harmonics.push(byte(signs[coefficient] * rest.copied().unwrap_or_default() * 128.0 + 128.0));
        }
    }
    let flags = if scene.is_antialiased { ANTIALIASED } else { 0 };
    let mut stream = GzBuilder::new().comment(COMMENT).write(Vec::new(), Compression::default());
    let mut write = || {
        stream.write_all(&MAGIC)?;
        stream.write_all(&WRITTEN.to_le_bytes())?;
        stream.write_all(&(scene.gaussians.len() as u32).to_le_bytes())?;
        stream.write_all(&[scene.degree as u8, fraction as u8, flags, 0])?;
        [&positions, &alphas, &colours, &scales, &rotations, &harmonics]
            .iter()
            .try_for_each(|part| stream.write_all(part))
    };
    write().map_err(|cause| cause.to_string())?;
    stream.finish().map_err(|cause| cause.to_string())
}
