//! What a photograph states of its camera (EXIF): the focal length in pixels, and which camera it was.
//!
//! Of the sources of a focal length the first that is plausible counts:
//!
//! ```text
//! focal plane   FocalLength in millimetres by FocalPlaneXResolution, for a photograph that still has its size
//! 35 mm         FocalLengthIn35mmFilm by the diagonal: 43.27 mm for the picture's diagonal in pixels (CIPA DCG-001)
//! ```
//!
//! With a digital zoom (DigitalZoomRatio) none counts: some cameras state the lens's focal length all the same.

use exif::{In, Reader, Tag, Value};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Diagonal of 36 mm by 24 mm, in millimetres.
const FULL_FRAME_DIAGONAL: f64 = 43.266_615_305_567_87;

/// Plausible focal lengths, in diagonals of the picture.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.15..=20.0;

/// Most that the focal plane's value may differ from the 35 mm equivalent, as a share of it: past rounding, its
/// resolution is that of another size of the picture.
const MAX_DIFFERENCE: f64 = 0.1;

/// A zoom below this is rounding.
const MIN_DIGITAL_ZOOM: f64 = 1.02;

/// What a photograph states of its camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exif {
    /// Focal length in pixels of the photograph as it is stored.
    pub focal: Option<f64>,
    /// Make, model and lens, as far as they are stated: photographs of one text are of one camera.
    pub camera: Option<String>,
    /// Focal length in millimetres: a zoom lens has several.
    pub millimetres: Option<f64>,
    /// Width and height that it had when it was taken, or when a program last wrote them.
    pub size: Option<[f64; 2]>,
    /// How many times a digital zoom enlarged it, above 1.
    pub digital_zoom: Option<f64>,
}

impl Exif {
    /// Reads what a file of this size in pixels states; nothing where it has no readable EXIF.
    pub fn read(path: &Path, size: [u32; 2]) -> Exif {
        let Ok(file) = File::open(path) else { return Exif::default() };
        let Ok(fields) = Reader::new().read_from_container(&mut BufReader::new(file)) else { return Exif::default() };
        let number = |tag| number(&fields.get_field(tag, In::PRIMARY)?.value);
        let text = |tag| Some(fields.get_field(tag, In::PRIMARY)?.display_value().to_string().replace('"', ""));
        let names: Vec<String> = [Tag::Make, Tag::Model, Tag::LensModel].into_iter().filter_map(text).collect();
        let millimetres = number(Tag::FocalLength).filter(|length| *length > 0.0);
        let stored = [Tag::PixelXDimension, Tag::PixelYDimension].map(number);
        let has_its_size = stored == size.map(|side| Some(f64::from(side)));
        let plane = Plane {
            millimetres,
            // 3 stands for centimetres, 2 and nothing for inches.
            unit: if number(Tag::FocalPlaneResolutionUnit) == Some(3.0) { 10.0 } else { 25.4 },
            resolution: number(Tag::FocalPlaneXResolution).filter(|_| has_its_size),
        };
        let digital_zoom = number(Tag::DigitalZoomRatio).filter(|ratio| *ratio > MIN_DIGITAL_ZOOM);
        let focal = focal(&plane, number(Tag::FocalLengthIn35mmFilm), size);
        Exif {
            focal: focal.filter(|_| digital_zoom.is_none()),
            camera: (!names.is_empty()).then(|| names.join(" ")),
            millimetres,
            size: stored[0].zip(stored[1]).map(|(width, height)| [width, height]),
            digital_zoom,
        }
    }
}

/// What is stated of the focal plane.
struct Plane {
    millimetres: Option<f64>,
    /// Millimetres of the resolution's unit.
    unit: f64,
    /// Pixels of the photograph for each unit.
    resolution: Option<f64>,
}

/// The focal length in pixels.
fn focal(plane: &Plane, equivalent: Option<f64>, size: [u32; 2]) -> Option<f64> {
    let diagonal = size.map(f64::from)[0].hypot(f64::from(size[1]));
    let is_plausible = |focal: &f64| PLAUSIBLE.contains(&(focal / diagonal));
    let of_plane = plane.millimetres.zip(plane.resolution).map(|(length, density)| length * density / plane.unit);
    let of_film = equivalent.map(|length| length / FULL_FRAME_DIAGONAL * diagonal).filter(is_plausible);
    let agrees = |focal: &f64| of_film.is_none_or(|film| (focal / film - 1.0).abs() <= MAX_DIFFERENCE);
    of_plane.filter(is_plausible).filter(agrees).or(of_film)
}

fn number(value: &Value) -> Option<f64> {
    let number = match value {
        Value::Rational(all) => all.first()?.to_f64(),
        Value::Short(all) => f64::from(*all.first()?),
        Value::Long(all) => f64::from(*all.first()?),
        // Not of the standard's types for these, and written all the same.
        Value::SRational(all) => all.first()?.to_f64(),
        Value::Float(all) => f64::from(*all.first()?),
        Value::Double(all) => *all.first()?,
        _ => return None,
    };
    number.is_finite().then_some(number).filter(|number| *number > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_type_are_read() {
        let ratio = exif::SRational { num: 54, denom: 2 };
        for value in [
            Value::Short(vec![27]),
            Value::Long(vec![27]),
            Value::Rational(vec![exif::Rational { num: 54, denom: 2 }]),
            Value::SRational(vec![ratio]),
            Value::Float(vec![27.0]),
            Value::Double(vec![27.0]),
        ] {
            assert_eq!(number(&value), Some(27.0), "{value:?}");
        }
        for value in [Value::Double(vec![f64::NAN]), Value::Float(vec![-1.0]), Value::Double(Vec::new())] {
            assert_eq!(number(&value), None, "{value:?}");
        }
    }

    /// EXIF of short numbers, as a TIFF file.
    fn tiff(tags: &[(u16, u16)]) -> Vec<u8> {
        let mut bytes = b"MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0".to_vec();
        bytes.extend((tags.len() as u16).to_be_bytes());
        for (tag, value) in tags {
            bytes.extend(tag.to_be_bytes());
            bytes.extend([0, 3, 0, 0, 0, 1]);
            bytes.extend(value.to_be_bytes());
            bytes.extend([0, 0]);
        }
        bytes.extend([0; 4]);
        bytes
    }

    #[test]
    fn with_a_digital_zoom_no_focal_length_is_known() {
        let folder = tempfile::tempdir().expect("a folder");
        let (film, zoom) = ((0xa405, 27), 0xa404);
        let read = |tags: &[(u16, u16)]| {
            let path = folder.path().join("photograph.tif");
            std::fs::write(&path, tiff(tags)).expect("a file");
            let Exif { focal, digital_zoom, .. } = Exif::read(&path, [400, 300]);
            (focal.map(f64::round), digital_zoom)
        };
        assert_eq!(read(&[film]), (Some(312.0), None));
        assert_eq!(read(&[(zoom, 1), film]), (Some(312.0), None), "no zoom");
        assert_eq!(read(&[(zoom, 2), film]), (None, Some(2.0)));
    }

    #[test]
    fn the_focal_plane_counts_where_it_agrees() {
        let plane = |resolution| Plane { millimetres: Some(50.0), unit: 25.4, resolution };
        let size = [3000, 2000];
        let near = |value: Option<f64>, expected: f64| (value.unwrap_or_default() - expected).abs() < 0.5;
        // 36 mm for 3000 pixels: 2116.7 pixels an inch.
        let density = 3000.0 / 36.0 * 25.4;
        assert!(near(focal(&plane(Some(density)), Some(50.0), size), 4166.7));
        assert!(near(focal(&plane(Some(density)), None, size), 4166.7));
        let of_film = 50.0 / FULL_FRAME_DIAGONAL * 3000.0_f64.hypot(2000.0);
        assert!(near(focal(&plane(Some(2.0 * density)), Some(50.0), size), of_film), "it is of another size");
        assert!(near(focal(&plane(None), Some(50.0), size), of_film));
        assert_eq!(focal(&plane(None), None, size), None);
        assert_eq!(focal(&plane(Some(1.0)), None, size), None, "a focal length of two pixels");
    }
}
