//! What two sources are good for: neither can be held out, so that only other scenes tell.

use serde::Serialize;
use viewfuse_core::camera::Camera;
use viewfuse_scene::rig::Rig;

/// What pictures from between two whole photographs have, by the angle up to which they are apart, and how many pairs
/// were measured (`host/results/training_free.md`, "Two sources").
const PHOTOGRAPHS: [(f32, Measured); 3] = [
    (15.0, Measured { psnr: [23.1, 34.9], pairs: 6 }),
    (25.0, Measured { psnr: [20.0, 25.8], pairs: 5 }),
    (f32::INFINITY, Measured { psnr: [13.0, 19.9], pairs: 10 }),
];
/// The same of objects with silhouettes, whatever the angle: two silhouettes leave a shape open.
const OBJECTS: Measured = Measured { psnr: [15.2, 18.8], pairs: 9 };

/// The field that the pictures were of: of others nothing was measured.
const MEASURED: &str = "training-free";

/// Two sources.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// The angle between them, seen from what they look at, degrees.
    pub degrees: f32,
    /// Whether they show an object with silhouettes.
    pub has_silhouettes: bool,
    /// What pictures from between such pairs have.
    pub measured: Measured,
}

/// What was measured on pairs of other scenes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Least and greatest score, decibels.
    pub psnr: [f64; 2],
    /// How many pairs.
    pub pairs: u32,
}

impl Pair {
    /// Of the cameras of two sources; `None` of any other number, and for fields of which nothing was measured.
    pub(super) fn of(field: &str, cameras: &[Camera], has_silhouettes: bool) -> Option<Pair> {
        let degrees = Rig::of(cameras).median_gap(cameras).filter(|_| cameras.len() == 2 && field == MEASURED)?;
        let (_, photographs) = PHOTOGRAPHS.into_iter().find(|(most, _)| degrees <= *most)?;
        Some(Pair { degrees, has_silhouettes, measured: if has_silhouettes { OBJECTS } else { photographs } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;
    use viewfuse_core::camera::Pinhole;
    use viewfuse_core::pose::Pose;

    /// Cameras around a point, at these angles.
    fn around(degrees: &[f32]) -> Vec<Camera> {
        let at = |degrees: &f32| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let pose = Pose::look_at(Vec3::new(3.0 * sine, 0.0, 3.0 * cosine), Vec3::ZERO, Vec3::Y).expect("a pose");
            Camera { pose, pinhole: Pinhole::new([16.0; 2], [8.0; 2], 16, 16).expect("a pinhole") }
        };
        degrees.iter().map(at).collect()
    }

    #[test]
    fn what_two_photographs_are_good_for_falls_with_the_angle_between_them() {
        let greatest = |degrees: f32, has_silhouettes: bool| {
            let pair = Pair::of(MEASURED, &around(&[0.0, degrees]), has_silhouettes).expect("a pair");
            assert!((pair.degrees - degrees).abs() < 0.01, "{pair:?}");
            pair.measured.psnr[1]
        };
        assert!(greatest(10.0, false) > greatest(20.0, false) && greatest(20.0, false) > greatest(40.0, false));
        assert_eq!(greatest(10.0, true), greatest(40.0, true));
        assert_eq!(Pair::of(MEASURED, &around(&[0.0, 10.0, 20.0]), false), None);
        assert_eq!(Pair::of("plane-sweep", &around(&[0.0, 10.0]), false), None);
    }
}
