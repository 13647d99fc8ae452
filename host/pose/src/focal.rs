//! The cameras of photographs before the work: which photographs share one, and its focal length with where it comes
//! from.

use crate::exif::Exif;
use crate::intake::Photo;
use crate::solution::{CameraGuess, SolvedApart};

/// Most that a known focal length may change, as a share of it.
const MAX_KNOWN_CHANGE: f64 = 0.15;

/// With a focal length for each photograph a tenth of the loss goes where autofocus moved the lens (cup), half and more
/// where some were taken with a zoom of 1.4: shares that are left were 0.87 to 1 and 0.16 to 0.74.
const MAX_SHARED_LOSS: f64 = 0.8;
/// Photographs whose focal lengths differ by less are of one zoom: found one by one, those of a zoom spread by a tenth.
const MIN_ZOOM: f64 = 1.15;

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
    /// Of an unknown focal length, how many times as long as the shortest one that is unknown.
    pub zoom: f64,
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
        let of_size = |size: [u32; 2]| photos.iter().filter(move |photo| photo.size == size).map(|photo| &photo.exif);
        Cameras::by(photos, |photo| match (given, photo.exif.focal) {
            (None, Some(_)) if is_odd(&photo.exif, of_size(photo.size)) => unknown(photo),
            (Some(given), _) => {
                let focal = given * longest(photo.size) / longest(photos[0].size);
                (Some(focal), FocalSource::Given, String::new())
            }
            (None, Some(focal)) => (Some(focal), FocalSource::Exif, camera_of(&photo.exif, focal)),
            (None, None) => unknown(photo),
        })
    }

    /// The cameras where what is known of focal lengths does not count: photographs of one size are of one camera, but
    /// of those that EXIF tells apart.
    pub(crate) fn of_unknown(photos: &[Photo]) -> Cameras {
        Cameras::by(photos, |photo| {
            let (focal, source, key) = unknown(photo);
            let Exif { camera, millimetres, .. } = &photo.exif;
            (focal, source, format!("{key} {camera:?} {millimetres:?}"))
        })
    }

    /// `about` has a photograph's focal length, where it comes from, and what tells its camera from others.
    fn by(photos: &[Photo], about: impl Fn(&Photo) -> (Option<f64>, FocalSource, String)) -> Cameras {
        let mut groups: Vec<(String, CameraGroup)> = Vec::new();
        let mut of_photo = Vec::with_capacity(photos.len());
        for (index, photo) in photos.iter().enumerate() {
            let (focal, source, key) = about(photo);
            let key = format!("{:?} {key}", photo.size);
            let place = groups.iter().position(|(known, _)| *known == key).unwrap_or(groups.len());
            if place == groups.len() {
                let zoom = photo.exif.digital_zoom.filter(|_| focal.is_none()).unwrap_or(1.0);
                groups.push((key, CameraGroup { focal, source, size: photo.size, photos: Vec::new(), zoom }));
            }
            groups[place].1.photos.push(index);
            of_photo.push(place);
        }
        let mut groups: Vec<CameraGroup> = groups.into_iter().map(|(_, group)| group).collect();
        let unknown = groups.iter().filter(|group| group.focal.is_none()).map(|group| group.zoom);
        if let Some(shortest) = unknown.reduce(f64::min) {
            groups.iter_mut().filter(|group| group.focal.is_none()).for_each(|group| group.zoom /= shortest);
        }
        Cameras { groups, of_photo }
    }

    /// The cameras where photographs of one size, whose focal length is unknown, were taken with several: one for each.
    /// `found` are solutions with one. `None` if none of them says so.
    pub(crate) fn by_zoom<'a>(&self, found: impl Iterator<Item = &'a SolvedApart>) -> Option<Cameras> {
        let telling = found.filter(|apart| apart.loss < MAX_SHARED_LOSS);
        // The most photographs, and of as many the clearest.
        let apart = telling.max_by_key(|apart| {
            (apart.focal.iter().flatten().count(), std::cmp::Reverse((apart.loss * 1.0e6) as u64))
        })?;
        let groups: Vec<CameraGroup> = self.groups.iter().flat_map(|group| zooms(group, &apart.focal)).collect();
        if groups.len() == self.groups.len() {
            return None;
        }
        let mut of_photo = vec![0; self.of_photo.len()];
        for (index, group) in groups.iter().enumerate() {
            group.photos.iter().for_each(|photo| of_photo[*photo] = index);
        }
        Some(Cameras { groups, of_photo })
    }

    /// Whether what is known of focal lengths is not what photographs show, as with a digital zoom or after a crop: with
    /// a focal length for each the loss is far less, and two or more of them lie a zoom apart from two or more others, as
    /// shares of what is known (a single one is that of a wrong pose, perhaps); or all solutions have another one. `guesses` are those of the jobs; of each solution what the photographs say with a focal
    /// length each, and the cameras' focal lengths in pixels of the photographs.
    pub(crate) fn are_contradicted(&self, guesses: &[CameraGuess], solved: &[(Option<&SolvedApart>, &[f64])]) -> bool {
        let is_apart = |apart: &SolvedApart| {
            let share = |(photo, focal): (usize, &Option<f64>)| {
                let guess = guesses[self.of_photo[photo]];
                focal.filter(|_| !guess.is_guess).map(|focal| focal / guess.focal)
            };
            let mut shares: Vec<f64> = apart.focal.iter().enumerate().filter_map(share).collect();
            shares.sort_by(f64::total_cmp);
            let is_gap = |at: usize| shares[at] >= MIN_ZOOM * shares[at - 1];
            apart.loss < MAX_SHARED_LOSS && (2..shares.len().saturating_sub(1)).any(is_gap)
        };
        let is_changed = |focal: &[f64]| self.changed_focal(focal).is_some();
        solved.iter().filter_map(|(apart, _)| *apart).any(is_apart)
            || !solved.is_empty() && solved.iter().all(|(_, focal)| is_changed(focal))
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
            CameraGuess {
                focal: scale * group.focal.unwrap_or(guess * group.zoom * longest(group.size)),
                is_guess: group.focal.is_none(),
            }
        };
        self.groups.iter().map(guessed).collect()
    }
}

/// A group's photographs by focal lengths that were found one by one, the shortest first: where two that follow one
/// another are a zoom apart, another camera begins. Photographs without one join the most.
fn zooms(group: &CameraGroup, focal: &[Option<f64>]) -> Vec<CameraGroup> {
    let mut known: Vec<(f64, usize)> =
        group.photos.iter().filter_map(|photo| Some((focal.get(*photo).copied().flatten()?, *photo))).collect();
    if group.source != FocalSource::Unknown || known.is_empty() {
        return vec![group.clone()];
    }
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut parts: Vec<Vec<(f64, usize)>> =
        known.chunk_by(|a, b| b.0 < MIN_ZOOM * a.0).map(<[(f64, usize)]>::to_vec).collect();
    let middle = |part: &[(f64, usize)]| part[part.len() / 2].0;
    let shortest = middle(&parts[0]);
    let zooms: Vec<f64> = parts.iter().map(|part| middle(part) / shortest).collect();
    let is_unknown = |photo: &&usize| known.iter().all(|(_, known)| known != *photo);
    let rest: Vec<(f64, usize)> = group.photos.iter().filter(is_unknown).map(|photo| (0.0, *photo)).collect();
    if let Some(most) = parts.iter_mut().max_by_key(|part| part.len()) {
        most.extend(rest);
    }
    let of_part = |(part, zoom): (Vec<(f64, usize)>, f64)| {
        let mut photos: Vec<usize> = part.into_iter().map(|(_, photo)| photo).collect();
        photos.sort_unstable();
        CameraGroup { photos, zoom: zoom * group.zoom, ..group.clone() }
    };
    parts.into_iter().zip(zooms).map(of_part).collect()
}

fn longest(size: [u32; 2]) -> f64 {
    f64::from(size[0].max(size[1]))
}

fn unknown(photo: &Photo) -> (Option<f64>, FocalSource, String) {
    // Zooms of a few per cent more are the same.
    let zoom = photo.exif.digital_zoom.map_or(0.0, |zoom| (zoom.ln() / MIN_ZOOM.ln()).round());
    (None, FocalSource::Unknown, format!("unknown {zoom}"))
}

/// Whether a photograph states another focal length, by a zoom, than most of its lens at the same millimetres, among
/// those of its size: one of them is wrong, or a digital zoom that nothing else tells.
fn is_odd<'a>(exif: &Exif, of_size: impl Iterator<Item = &'a Exif>) -> bool {
    let Exif { focal: Some(focal), camera: Some(_), millimetres: Some(_), .. } = exif else { return false };
    let is_alike = |other: &&Exif| other.camera == exif.camera && other.millimetres == exif.millimetres;
    let stated: Vec<f64> = of_size.filter(is_alike).filter_map(|other| other.focal).collect();
    let near = stated.iter().filter(|other| (focal / **other).max(**other / focal) < MIN_ZOOM).count();
    2 * near < stated.len()
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
        let phone = |focal| Exif {
            focal: Some(focal),
            camera: Some("phone".to_owned()),
            millimetres: Some(6.8),
            ..Exif::default()
        };
        let camera = |focal| camera_of(&phone(focal), focal);
        assert_eq!(camera(427.0), camera(427.2));
        assert_ne!(camera(427.0), camera(480.0));
    }

    #[test]
    fn one_that_states_another_focal_length_of_the_same_lens_is_odd() {
        let stated = |camera: &str, millimetres, focal| Exif {
            focal: Some(focal),
            camera: Some(camera.to_owned()),
            millimetres,
            ..Exif::default()
        };
        let phone = |focal| stated("phone", Some(5.4), focal);
        let all = [phone(700.0), phone(702.0), phone(1400.0), phone(690.0)];
        assert_eq!(all.each_ref().map(|exif| is_odd(exif, all.iter())), [false, false, true, false]);
        // As many of either, other lenses, and what does not say its lens.
        let halves = [phone(700.0), phone(1400.0)];
        assert!(halves.iter().all(|exif| !is_odd(exif, halves.iter())));
        let zoom = [
            stated("camera", Some(24.0), 700.0),
            stated("camera", Some(24.0), 700.0),
            stated("camera", Some(48.0), 1400.0),
        ];
        assert!(zoom.iter().all(|exif| !is_odd(exif, zoom.iter())));
        let silent = [stated("phone", None, 700.0), stated("phone", None, 700.0), stated("phone", None, 1400.0)];
        assert!(silent.iter().all(|exif| !is_odd(exif, silent.iter())));
    }

    #[test]
    fn photographs_of_two_zooms_are_of_two_cameras() {
        let group = |source, photos: &[usize]| CameraGroup {
            focal: None,
            source,
            size: [4, 3],
            photos: photos.to_vec(),
            zoom: 1.0,
        };
        let unknown = group(FocalSource::Unknown, &[0, 1, 2, 3, 4]);
        let cameras = Cameras { groups: vec![unknown], of_photo: vec![0; 5] };
        let apart =
            |loss, focal: [f64; 4]| SolvedApart { loss, focal: focal.map(Some).into_iter().chain([None]).collect() };
        let zoomed = [1009.0, 1434.0, 1022.0, 1404.0];
        let found = [apart(0.96, [900.0; 4]), apart(0.55, zoomed)];
        let by_zoom = cameras.by_zoom(found.iter()).expect("two");
        assert_eq!(by_zoom.of_photo, [0, 1, 0, 1, 1]);
        let [near, far] = &by_zoom.groups[..] else { panic!("{by_zoom:?}") };
        assert_eq!((&near.photos[..], near.zoom), (&[0, 2][..], 1.0));
        assert_eq!((&far.photos[..], far.zoom), (&[1, 3, 4][..], 1434.0 / 1022.0));
        assert_eq!(cameras.by_zoom([apart(0.87, zoomed)].iter()), None, "the loss is nearly the same");
        assert_eq!(cameras.by_zoom([apart(0.6, [871.0, 880.0, 903.0, 960.0])].iter()), None, "no zoom lies between");
        let stated = Cameras { groups: vec![group(FocalSource::Exif, &[0, 1, 2, 3, 4])], ..cameras };
        assert_eq!(stated.by_zoom(found.iter()), None);
    }

    #[test]
    fn what_is_stated_is_contradicted_by_several_focal_lengths() {
        let group = CameraGroup {
            focal: Some(1000.0),
            source: FocalSource::Exif,
            size: [4, 3],
            photos: vec![0, 1, 2, 3],
            zoom: 1.0,
        };
        let cameras = Cameras { groups: vec![group.clone()], of_photo: vec![0; 4] };
        let apart = |loss, focal: [f64; 4]| SolvedApart { loss, focal: focal.map(Some).to_vec() };
        let guesses = |cameras: &Cameras| {
            let is_guess = !cameras.are_known();
            [CameraGuess { focal: 1000.0, is_guess }]
        };
        let is_contradicted = |cameras: &Cameras, apart: &SolvedApart, focal: f64| {
            cameras.are_contradicted(&guesses(cameras), &[(Some(apart), &[focal])])
        };
        let zoomed = [1009.0, 1434.0, 1022.0, 1404.0];
        assert!(is_contradicted(&cameras, &apart(0.55, zoomed), 1000.0));
        assert!(!is_contradicted(&cameras, &apart(0.9, zoomed), 1000.0), "the loss is nearly the same");
        assert!(!is_contradicted(&cameras, &apart(0.6, [1000.0, 1010.0, 1005.0, 3000.0]), 1000.0), "one of them");
        assert!(!is_contradicted(&cameras, &apart(0.55, [1009.0, 1022.0, 1100.0, 1150.0]), 1000.0), "no zoom apart");
        assert!(is_contradicted(&cameras, &apart(0.99, [1300.0; 4]), 1300.0), "another focal length was found");
        let one_of_two: [(Option<&SolvedApart>, &[f64]); 2] = [(None, &[1300.0]), (None, &[1010.0])];
        assert!(!cameras.are_contradicted(&guesses(&cameras), &one_of_two), "one has the known one");
        assert!(!cameras.are_contradicted(&guesses(&cameras), &[]));
        let unknown = Cameras { groups: vec![CameraGroup { focal: None, ..group }], ..cameras };
        assert!(!is_contradicted(&unknown, &apart(0.55, zoomed), 1000.0));
    }

    #[test]
    fn what_is_known_may_change_a_little() {
        let group =
            |focal| CameraGroup { focal, source: FocalSource::Exif, size: [4, 3], photos: Vec::new(), zoom: 1.0 };
        let cameras = Cameras { groups: vec![group(None), group(Some(462.0))], of_photo: Vec::new() };
        assert_eq!(cameras.changed_focal(&[300.0, 470.0]), None);
        assert_eq!(cameras.changed_focal(&[300.0, 296.0]), Some([296.0, 462.0]));
    }
}
