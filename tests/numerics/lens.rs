//! Lenses: the formulas by another hand (figures of OpenCV 5.0.0's `projectPoints` and `fisheye::projectPoints`), and
//! that what is distorted is undistorted, over whole pictures.

use serde::Deserialize;
use viewfuse::check::poses::Random;
use viewfuse_core::lens::{Lens, LensBlock, LensError, MAX_COEFFICIENT, Projection};

/// Points before the camera, at depth 1.
const POINTS: [[f64; 2]; 5] = [[0.0, 0.0], [0.3, -0.2], [-0.55, 0.4], [0.1, 0.7], [-0.8, -0.6]];

/// A camera model with coefficients `k1 .. k6 p1 p2` and nerfstudio's `k4`, and where OpenCV projects [`POINTS`] with a
/// focal length of 1: `cv2.projectPoints(points, 0, 0, I, [k1, k2, p1, p2, k3, k4, k5, k6])`,
/// `cv2.fisheye.projectPoints(..., [k1, k2, k3, k4])`. With nerfstudio's coefficient: fractions of Python's, by its and
/// Metashape's formula.
#[derive(Deserialize)]
struct Case {
    model: String,
    is_fisheye: bool,
    coefficients: [f64; 9],
    expected: [[f64; 2]; 5],
}

impl Case {
    fn lens(&self) -> Lens {
        let projection = if self.is_fisheye { Projection::Fisheye } else { Projection::Perspective };
        Lens::new(projection, self.coefficients).expect("a lens")
    }
}

fn cases() -> Vec<Case> {
    serde_json::from_str(include_str!("../data/lens.json")).expect("JSON")
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A picture of 1600 x 1200 pixels with this focal length: its pixels' normalised coordinates, every 20th of them, the
/// corners among them.
fn picture(focal: f64) -> impl Iterator<Item = [f64; 2]> {
    let rows = (0..=1200).step_by(20);
    rows.flat_map(move |y| (0..=1600).step_by(20).map(move |x| [f64::from(x) - 800.0, f64::from(y) - 600.0]))
        .map(move |pixel| pixel.map(|value| value / focal))
}

#[test]
fn each_model_is_that_of_opencv() {
    for case in cases() {
        for (point, expected) in POINTS.into_iter().zip(case.expected) {
            let found = case.lens().distort(point);
            assert!(distance(found, expected) < 1e-14, "{}: {found:?} instead of {expected:?}", case.model);
        }
    }
}

#[test]
fn what_is_distorted_is_undistorted_over_the_whole_picture() {
    let focal = 1100.0;
    for case in cases() {
        let lens = case.lens();
        let mut worst = (0.0_f64, 0.0_f64);
        for point in picture(focal) {
            assert!(point[0].hypot(point[1]) <= lens.reach(2.0), "{}", case.model);
            let back = lens.undistort(lens.distort(point));
            worst = (worst.0.max(distance(back.point, point) * focal), worst.1.max(back.residual * focal));
        }
        // The promise is 1e-6 pixels.
        assert!(worst.0 < 1e-9 && worst.1 < 1e-9, "{}: {worst:?} pixels", case.model);
    }
}

#[test]
fn the_same_in_single_precision() {
    let focal = 1100.0;
    for case in cases() {
        let (lens, block) = (case.lens(), case.lens().block());
        let mut worst = (0.0_f64, 0.0_f64);
        for point in picture(focal) {
            let exact = lens.distort(point);
            let found = block.distort(point.map(|value| value as f32)).map(f64::from);
            let back = block.undistort(exact.map(|value| value as f32));
            worst.0 = worst.0.max(distance(found, exact) * focal);
            worst.1 = worst.1.max(distance(back.point.map(f64::from), point) * focal);
            assert!(f64::from(back.residual) * focal < 2e-3, "{}: {back:?}", case.model);
        }
        assert!(worst.0 < 1e-3 && worst.1 < 5e-3, "{}: {worst:?} pixels", case.model);
    }
}

#[test]
fn what_no_ideal_point_maps_to_is_told() {
    // This barrel folds at a radius of sqrt(1 / 0.9), where the photograph's is 0.703.
    let barrel = Lens::new(Projection::Perspective, [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    let fold = (1.0_f64 / 0.9).sqrt();
    assert!((barrel.reach(2.0) - fold).abs() < 1e-3, "{}", barrel.reach(2.0));
    let inside = barrel.undistort([0.69, 0.0]);
    assert!(inside.residual < 1e-12 && inside.point[0] < fold, "{inside:?}");
    assert!(barrel.undistort([0.8, 0.0]).residual > 0.09);
    // A fisheye's picture is wider than any ideal one.
    let fisheye = Lens::new(Projection::Fisheye, [0.0; 9]).expect("a lens");
    assert!(fisheye.undistort([1.5, 0.0]).residual < 1e-12);
    assert!(fisheye.undistort([1.8, 0.0]).residual > 0.2);
    for lens in [barrel, fisheye] {
        for point in [[f64::NAN, 0.0], [f64::INFINITY, 1.0], [1e300, -1e300]] {
            let found = lens.undistort(point);
            assert!(!(found.residual < 1.0), "{found:?}");
        }
    }
}

#[test]
fn coefficients_are_checked() {
    for (index, value) in [(0, f64::NAN), (3, f64::INFINITY), (7, 2.0 * MAX_COEFFICIENT), (8, f64::NAN)] {
        let mut coefficients = [0.0; 9];
        coefficients[index] = value;
        let error = Lens::new(Projection::Perspective, coefficients).expect_err("no lens");
        assert_eq!(error, LensError::Coefficient(index));
        assert!(error.to_string().contains(["k1", "", "", "k4", "", "", "", "p2", "k4 (of r^8)"][index]), "{error}");
    }
    let pinhole = Lens::new(Projection::Perspective, [0.0; 9]).expect("a pinhole");
    assert!(pinhole.is_pinhole() && !Lens::new(Projection::Fisheye, [0.0; 9]).expect("a lens").is_pinhole());
    assert_eq!((pinhole.block(), pinhole.distort([0.3, 0.4])), (LensBlock::default(), [0.3, 0.4]));
}

/// Lenses of wide angles, whose folds are near: Newton's method from the point itself would leave the part that grows.
#[test]
fn points_of_wide_lenses_are_found() {
    let mut random = Random::new(3);
    let perspective = |random: &mut Random| {
        let radial = [(0.0, 0.3), (-0.1, 0.1), (-0.03, 0.03)].map(|(from, to)| random.range(from, to));
        (Projection::Perspective, [radial[0], radial[1], radial[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    };
    let fisheye = |random: &mut Random| {
        let [k1, k2, k3, k4] = [0.1, 0.05, 0.02, 0.005].map(|most| random.range(-most, most));
        (Projection::Fisheye, [k1, k2, k3, k4, 0.0, 0.0, 0.0, 0.0, 0.0])
    };
    let mut lenses: Vec<_> =
        (0..200).map(|index| if index % 2 == 0 { perspective(&mut random) } else { fisheye(&mut random) }).collect();
    lenses.push((Projection::Fisheye, [0.0814, 0.04, -0.01785, -0.00475, 0.0, 0.0, 0.0, 0.0, 0.0]));
    lenses.push((Projection::Perspective, [0.29928, 0.01779, -0.02004, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    lenses.push((Projection::Perspective, [0.09406, 0.08508, -0.00387, 0.0, 0.0, 0.0, -0.00034, -0.00096, 0.0]));
    for (projection, coefficients) in lenses {
        let lens = Lens::new(projection, coefficients).expect("a lens");
        // Right before a fold the inverse has no slope.
        let reach = match projection {
            Projection::Fisheye => (0.97 * lens.reach(10.0).atan()).tan(),
            Projection::Perspective => 0.97 * lens.reach(2.0),
        };
        for step in 1..=200 {
            let (radius, angle) = (reach * f64::from(step) / 200.0, f64::from(step));
            let point = [radius * angle.cos(), radius * angle.sin()];
            let found = lens.undistort(lens.distort(point));
            assert!(found.residual < 1e-13, "{projection:?} {coefficients:?}: {point:?}: {found:?}");
            assert!(distance(found.point, point) < 1e-9 * (1.0 + radius), "{coefficients:?}: {point:?}: {found:?}");
            let single = lens.block().undistort(lens.distort(point).map(|value| value as f32));
            assert!(single.residual < 1e-5, "{projection:?} {coefficients:?}: {point:?}: {single:?}");
        }
    }
}

/// Strong lenses of all coefficients, with folds and poles inside the picture: wherever the map is not flat, the point
/// is found, and not one beyond a fold that maps to the same or nearly the same.
#[test]
fn points_of_strong_lenses_are_found() {
    let mut random = Random::new(4);
    const LENSES: usize = 2_000;
    let mut counts = [0; 2];
    for index in 0..LENSES {
        let used: &[usize] = [&[0, 1][..], &[0, 1, 2], &[0, 1, 2, 8], &[0, 1, 2, 6, 7, 8]][index % 4];
        let mut coefficients = [0.0; 9];
        for &at in used {
            let most = [0.6, 0.3, 0.1, 0.0, 0.0, 0.0, 0.01, 0.01, 0.03][at];
            coefficients[at] = random.range(-most, most);
        }
        let lens = Lens::new(Projection::Perspective, coefficients).expect("a lens");
        let reach = 0.9 * lens.reach(4.0);
        let slope = |radius: f64| {
            let [nearer, farther] = [-1.0e-6, 1.0e-6].map(|by| lens.distort([radius + by, 0.0])[0]);
            (farther - nearer) / 2.0e-6
        };
        for step in 1..=40 {
            let (radius, angle) = (reach * f64::from(step) / 40.0, f64::from(step));
            if slope(radius) < 0.2 {
                break;
            }
            let point = [radius * angle.cos(), radius * angle.sin()];
            let bent = lens.distort(point);
            let length = bent[0].hypot(bent[1]).max(1.0);
            let found = lens.undistort(bent);
            assert!(found.residual < 1.0e-14 * length, "{coefficients:?}: {point:?}: {found:?}");
            assert!(distance(found.point, point) < 1.0e-9 * length, "{coefficients:?}: {point:?}: {found:?}");
            let single = lens.block().undistort(bent.map(|value| value as f32));
            assert!(f64::from(single.residual) < 2.0e-6 * length, "{coefficients:?}: {point:?}: {single:?}");
            counts[usize::from(bent[0].hypot(bent[1]) > 1.0)] += 1;
        }
    }
    assert!(counts.into_iter().all(|count| count > 10 * LENSES), "{counts:?}");
}

/// A given point just before the fold, from which a step of Newton's method is too long for any of its shares to help:
/// once more from nearer to the centre.
#[test]
fn points_beside_a_fold_are_found() {
    let lenses = [
        (
            [
                0.2774982654333612, 0.08537490069285678, -0.18263497878211146, 0.0, 0.0, 0.0, 0.0, 0.0,
                -0.11205440654270529,
            ],
            [0.7982011759079441, 0.5986508819309581],
        ),
        (
            [1.6237445832200468, -1.985635777745148, -0.12272469060047664, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.6298486716112182, 0.47238650370841356],
        ),
        (
            [-1.8129639014617083, 2.2825903795919533, -0.7559364281087335, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.6133479677309066, 0.4600109757981799],
        ),
    ];
    for (coefficients, point) in lenses {
        let lens = Lens::new(Projection::Perspective, coefficients).expect("a lens");
        let found = lens.undistort(point);
        assert!(found.residual < 1.0e-13, "{coefficients:?}: {found:?}");
    }
}
