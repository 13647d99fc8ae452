//! Photographs that were probably cropped. Poses suppose that a photograph's middle is where the lens's axis meets it;
//! where one was cut off the middle they are wrong, and neither points nor held-out photographs tell (`poses.md`,
//! "Photographs of several zooms").

use super::Photo;
use viewfuse_job::text::listed;

/// Long side by short side of what cameras take. Squares are among what crops have.
const SHAPES: [f64; 10] =
    [5.0 / 4.0, 4.0 / 3.0, 3.0 / 2.0, 16.0 / 10.0, 16.0 / 9.0, 2.0, 18.5 / 9.0, 19.5 / 9.0, 20.0 / 9.0, 21.0 / 9.0];
/// Sensors are off these by a hundredth.
const MAX_DIFFERENCE: f64 = 0.012;
/// Most photographs that are named.
const MAX_NAMES: usize = 4;

/// The long side of a picture by its short one.
fn shape(size: [f64; 2]) -> f64 {
    size[0].max(size[1]) / size[0].min(size[1]).max(1.0)
}

/// Whether two shapes differ by more than sensors do.
fn differ(a: f64, b: f64) -> bool {
    (a / b).ln().abs() > MAX_DIFFERENCE
}

/// Width and height, however it is turned.
fn turned(size: [u32; 2]) -> [u32; 2] {
    [size[0].max(size[1]), size[0].min(size[1])]
}

/// Whether a photograph has another shape than it states, or a size of its own among these and a shape that no camera
/// has.
fn is_cropped(photo: &Photo, photos: &[Photo]) -> bool {
    let now = shape(photo.size.map(f64::from));
    if let Some(stated) = photo.exif.size {
        return differ(now, shape(stated));
    }
    let of_its_size = photos.iter().filter(|other| turned(other.size) == turned(photo.size)).count();
    of_its_size == 1 && SHAPES.into_iter().all(|shape| differ(now, shape))
}

/// What is said of photographs that were probably cropped.
pub(crate) fn warning(photos: &[Photo]) -> Option<String> {
    let name = |photo: &Photo| format!("{} ({}x{})", photo.file, photo.size[0], photo.size[1]);
    let cropped: Vec<String> = photos.iter().filter(|photo| is_cropped(photo, photos)).map(name).collect();
    (!cropped.is_empty()).then(|| {
        format!(
            "probably cropped: {}. Poses suppose that the middle of a photograph is the lens's: where it was cut off the \
             middle they are wrong, and nothing else tells. Give photographs as they were taken",
            listed(&cropped, MAX_NAMES)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exif::Exif;
    use image::RgbImage;
    use std::path::PathBuf;

    fn photo(name: &str, size: [u32; 2], stated: Option<[f64; 2]>) -> Photo {
        Photo {
            name: name.to_owned(),
            path: PathBuf::new(),
            file: name.to_owned(),
            upright: PathBuf::new(),
            size,
            exif: Exif { size: stated, ..Exif::default() },
            working: PathBuf::new(),
            working_size: size,
            copy: RgbImage::new(1, 1),
            sharpness: 1.0,
        }
    }

    #[test]
    fn crops_have_shapes_of_no_camera_and_sizes_of_their_own() {
        // Sensors: 3:2 in two makes, 4:3 of a phone upright, 16:9, and what an undistorting program leaves of all alike.
        let whole = [[4928, 3264], [6000, 4000], [3024, 4032], [3840, 2160], [1957, 1400], [1957, 1400]];
        let mut photos: Vec<Photo> = whole.iter().map(|size| photo("whole", *size, None)).collect();
        assert_eq!(warning(&photos), None);
        photos.push(photo("cut", [2345, 2011], None));
        photos.push(photo("square", [2011, 2011], None));
        let said = warning(&photos).expect("two crops");
        assert!(said.contains("cropped: cut (2345x2011), square (2011x2011). Poses"), "{said}");
    }

    #[test]
    fn a_photograph_may_state_the_shape_that_it_had() {
        let stated = Some([4032.0, 3024.0]);
        let told = |size| warning(&[photo("a", size, stated)]);
        assert_eq!(told([1008, 756]), None, "smaller");
        assert_eq!(told([756, 1008]), None, "turned");
        assert!(told([1008, 567]).is_some(), "16:9 of 4:3");
        assert_eq!(warning(&[photo("a", [1000, 930], Some([1000.0, 930.0]))]), None, "what it states counts");
    }
}
