//! The cameras of photographs before the work: which photographs share one, and its focal length with where it comes
//! from.

use crate::exif::Exif;
use crate::intake::Photo;
use crate::solution::CameraGuess;

/// Most that a known focal length may change, as a share of it.
const MAX_KNOWN_CHANGE: f64 = 0.15;

/// Where a focal length comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FocalSource {
    /// The person gave it.
    Given,
    /// The photographs state it.
    Exif,
    /// It is found with the poses.
    Unknown,
}

/// Photographs of one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraGroup {
    /// Focal length in pixels of the upright photograph; `None` if it is unknown.
    pub focal: Option<f64>,
    /// Where it comes from.
    pub source: FocalSource,
    /// Width and height of its photographs.
    pub size: [u32; 2],
    /// The photographs, as indices.
    pub photos: Vec<usize>,
}

/// The cameras of all photographs.
#[derive(Clone, Debug, PartialEq)]
pub struct Cameras {
    /// In the order of their first photographs.
    pub groups: Vec<CameraGroup>,
    /// The camera of each photograph.
    pub of_photo: Vec<usize>,
}

impl Cameras {
    /// Photographs of one size are of one camera; with focal lengths by EXIF, of one size, camera and zoom. `given` is
    /// a focal length in pixels of photographs as large as the first: of others it is scaled with the longest side.
    pub fn of(photos: &[Photo], given: Option<f64>) -> Cameras {
        let longest = |size: [u32; 2]| f64::from(size[0].max(size[1]));
        let mut groups: Vec<(String, CameraGroup)> = Vec::new();
        let mut of_photo = Vec::with_capacity(photos.len());
        for (index, photo) in photos.iter().enumerate() {
            let (focal, source, key) = match (given, photo.exif.focal) {
                (Some(given), _) => {
                    let focal = given * longest(photo.size) / longest(photos[0].size);
                    (Some(focal), FocalSource::Given, String::new())
                }
                (None, Some(focal)) => (Some(focal), FocalSource::Exif, camera_of(&photo.exif, focal)),
                (None, None) => (None, FocalSource::Unknown, "unknown".to_owned()),
            };
            let key = format!("{:?} {key}", photo.size);
            let place = groups.iter().position(|(known, _)| *known == key).unwrap_or(groups.len());
            if place == groups.len() {
                groups.push((key, CameraGroup { focal, source, size: photo.size, photos: Vec::new() }));
            }
            groups[place].1.photos.push(index);
            of_photo.push(place);
        }
        Cameras { groups: groups.into_iter().map(|(_, group)| group).collect(), of_photo }
    }

    /// Of the focal lengths that were found the first that is another one than is known: it, and the known one.
    pub fn changed_focal(&self, found: &[f64]) -> Option<[f64; 2]> {
        let mut known = found.iter().zip(&self.groups).filter_map(|(found, group)| Some([*found, group.focal?]));
        known.find(|[found, known]| (found / known - 1.0).abs() > MAX_KNOWN_CHANGE)
    }

    /// Whether every focal length is known.
    pub fn are_known(&self) -> bool {
        self.groups.iter().all(|group| group.focal.is_some())
    }

    /// The cameras of a job whose photographs are at working size; unknown focal lengths are `guess` longest sides.
    pub(crate) fn guesses(&self, photos: &[Photo], guess: f64) -> Vec<CameraGuess> {
        let guessed = |group: &CameraGroup| {
            let working = group.photos.first().map_or([1, 1], |photo| photos[*photo].working_size);
            let scale = f64::from(working[0]) / f64::from(group.size[0]);
            let longest = f64::from(group.size[0].max(group.size[1]));
            CameraGuess { focal: scale * group.focal.unwrap_or(guess * longest), is_guess: group.focal.is_none() }
        };
        self.groups.iter().map(guessed).collect()
    }
}

/// The camera that photographs state, with a focal length in pixels: a digital zoom changes this, but not the lens.
fn camera_of(Exif { camera, millimetres, .. }: &Exif, focal: f64) -> String {
    format!("{camera:?} {millimetres:?} {focal:.0}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digital_zoom_is_another_camera() {
        let phone = |focal| Exif { focal: Some(focal), camera: Some("phone".to_owned()), millimetres: Some(6.8) };
        let camera = |focal| camera_of(&phone(focal), focal);
        assert_eq!(camera(427.0), camera(427.2));
        assert_ne!(camera(427.0), camera(480.0));
    }

    #[test]
    fn what_is_known_may_change_a_little() {
        let group = |focal| CameraGroup { focal, source: FocalSource::Exif, size: [4, 3], photos: Vec::new() };
        let cameras = Cameras { groups: vec![group(None), group(Some(462.0))], of_photo: Vec::new() };
        assert_eq!(cameras.changed_focal(&[300.0, 470.0]), None);
        assert_eq!(cameras.changed_focal(&[300.0, 296.0]), Some([296.0, 462.0]));
    }
}
