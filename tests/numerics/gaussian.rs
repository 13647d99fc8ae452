//! Gaussians: the narrowest, spherical harmonics, and what cannot be drawn.

use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::gaussian::{
    DILATION, GaussianBlock, ProjectedGaussian, axes, colour_along, opacity, project, project_as,
};
use viewfuse_core::pose::Pose;
use viewfuse_core::random::uniform;

const NEAR: f32 = 0.1;

fn camera(pose: Pose) -> CameraBlock {
    let pinhole = Pinhole::new([131.25, 97.5], [70.3, 41.8], 160, 90).expect("a usable camera");
    Camera { pose, pinhole }.block(0)
}

/// A needle across the diagonal of the image: the difference of products of variances would be off by a tenth or
/// negative.
#[test]
fn a_needle_keeps_its_width() {
    let camera = camera(Pose::IDENTITY);
    let quarter = std::f32::consts::FRAC_PI_8;
    let gaussian = GaussianBlock {
        position: [0.0, 0.0, 1.0],
        opacity: 3.0,
        log_scales: [2.5, -20.0, -20.0],
        rotation: [quarter.cos(), 0.0, 0.0, quarter.sin()],
        ..GaussianBlock::default()
    };
    let projected = project(&gaussian, &camera, NEAR);
    // Across the needle the covariance is the dilation alone. Its image lies along the two focal lengths.
    let across = projected.conic.map(f64::from);
    let [u, v] = [131.25_f64, 97.5];
    let (x, y) = (v / u.hypot(v), -u / u.hypot(v));
    let inverse = across[0] * x * x + 2.0 * across[1] * x * y + across[2] * y * y;
    assert!((inverse * f64::from(DILATION) - 1.0).abs() < 1.0e-4, "{inverse} for {across:?}");
}

#[test]
fn what_can_not_be_drawn_covers_nothing() {
    let camera = camera(Pose::IDENTITY);
    let good =
        GaussianBlock { position: [0.0, 0.0, 2.0], opacity: 2.0, log_scales: [-2.0; 3], ..GaussianBlock::default() };
    assert!(project(&good, &camera, NEAR).opacity > 0.8);
    // A quaternion that is none is no rotation: the Gaussian is round, and drawn.
    for rotation in [[0.0; 4], [f32::NAN, 0.0, 0.0, 1.0], [f32::INFINITY; 4]] {
        assert_eq!(axes(rotation), [Vec3::X, Vec3::Y, Vec3::Z]);
        assert_eq!(project(&GaussianBlock { rotation, ..good }, &camera, NEAR), project(&good, &camera, NEAR));
    }
    // Of any length: the smallest and the largest numbers.
    for (length, of) in [(1.4e-45, [1.0, 1.0, 0.0, 0.0]), (1.0e-41, [1.0; 4]), (3.0e38, [1.0; 4])] {
        let (found, unit) = (axes(of.map(|number: f32| number * length)), axes(of));
        for (a, b) in found.into_iter().zip(unit) {
            assert!(a.distance(b) < 1e-6, "{length:e} {of:?}: {found:?}");
        }
    }
    let broken = [
        GaussianBlock { position: [0.0, 0.0, -2.0], ..good },
        GaussianBlock { position: [0.0, 0.0, 0.05], ..good },
        GaussianBlock { position: [f32::NAN, 0.0, 2.0], ..good },
        GaussianBlock { position: [0.0, 0.0, f32::NAN], ..good },
        GaussianBlock { opacity: -6.0, ..good },
        GaussianBlock { opacity: f32::NAN, ..good },
        GaussianBlock { opacity: f32::NEG_INFINITY, ..good },
        GaussianBlock { log_scales: [80.0; 3], ..good },
        GaussianBlock { log_scales: [f32::INFINITY, 0.0, 0.0], ..good },
        // The exponential of NaN is 0: it would be a Gaussian without thickness.
        GaussianBlock { log_scales: [f32::NAN, -2.0, -2.0], ..good },
        GaussianBlock { log_scales: [-2.0, f32::NAN, -2.0], ..good },
        GaussianBlock { log_scales: [-2.0, -2.0, f32::NAN], ..good },
    ];
    for (gaussian, is_antialiased) in broken.iter().flat_map(|gaussian| [(gaussian, false), (gaussian, true)]) {
        let projected = project_as(gaussian, &camera, NEAR, is_antialiased);
        assert_eq!((projected, projected.pixels(160, 90)), (ProjectedGaussian::default(), [0; 4]), "{gaussian:?}");
        assert_eq!(projected.alpha(70.0, 40.0), 0.0);
    }
    assert_eq!(project(&good, &camera, NEAR).alpha(f32::NAN, 1.0), 0.0);
    assert_eq!(
        [opacity(f32::NAN), opacity(f32::NEG_INFINITY), opacity(f32::INFINITY), opacity(0.0)],
        [0.0, 0.0, 1.0, 0.5]
    );
    // Behind the left edge nothing is covered, however the image coordinates are rounded.
    let aside = GaussianBlock { position: [-40.0, 0.0, 2.0], ..good };
    let [left, right, _, _] = project(&aside, &camera, NEAR).pixels(160, 90);
    assert_eq!((left, right), (0, 0));
}

/// Of every rectangle: where it is false no pixel has an opacity, and where all are far it is false.
#[test]
fn what_is_not_reached_has_no_opacity() {
    let (mut refused, mut reached, mut needless) = (0, 0, 0);
    for draw in 0..4000 {
        let random = |sample: u32| uniform(7, draw, sample);
        // From balls to needles of one to a thousand, at all angles, inside of the rectangle and far outside.
        let (angle, long) = (std::f32::consts::TAU * random(0), 10.0_f32.powf(3.0 * random(1)));
        let (sine, cosine) = angle.sin_cos();
        let (first, second) = (1.0 / (long * long), 1.0 / (0.5 + random(2)));
        let conic = [
            first * cosine * cosine + second * sine * sine,
            (first - second) * sine * cosine,
            first * sine * sine + second * cosine * cosine,
        ];
        let mean = [12.0 + 80.0 * (random(3) - 0.5) * random(4), 12.0 + 80.0 * (random(5) - 0.5) * random(6)];
        let splat = ProjectedGaussian { mean, conic, opacity: 0.004 + 0.99 * random(7), ..Default::default() };
        let (columns, rows) = ([8, 8 + (8.0 * random(8)) as u32], [8, 8 + (8.0 * random(9)) as u32]);
        let pixels = (rows[0]..=rows[1]).flat_map(|row| (columns[0]..=columns[1]).map(move |column| (column, row)));
        let is_seen = pixels.into_iter().any(|(column, row)| splat.alpha(column as f32 + 0.5, row as f32 + 0.5) > 0.0);
        let reaches = splat.reaches(columns, rows);
        assert!(reaches || !is_seen, "{splat:?} {columns:?} {rows:?}");
        (refused, reached) = (refused + u32::from(!reaches), reached + u32::from(reaches));
        needless += u32::from(reaches && !is_seen);
    }
    // A needle may pass between pixels' centres.
    assert!(refused > 1000 && reached > 500 && needless * 5 < reached, "{refused} {reached} {needless}");
}

/// The harmonics are orthonormal on the sphere: by a product rule that is exact for polynomials of the degree.
#[test]
fn spherical_harmonics_are_orthonormal() {
    let value = |index: usize, direction: Vec3| {
        if index == 0 {
            return 0.282_094_79;
        }
        let rest: Vec<f32> = (0..45).map(|other| f32::from(u8::from(other == index - 1))).collect();
        // Around a level that keeps the colour above 0.
        f64::from(colour_along([16.0 / 0.282_094_8, 0.0, 0.0], &rest[..], 3, direction)[0]) - 16.5
    };
    let (points, circle) = ([-0.861_136_311_6_f64, -0.339_981_043_6, 0.339_981_043_6, 0.861_136_311_6], 12);
    let shares = [0.347_854_845_1, 0.652_145_154_9, 0.652_145_154_9, 0.347_854_845_1];
    let mut products = [[0.0_f64; 16]; 16];
    for (height, share) in points.iter().zip(shares) {
        for step in 0..circle {
            let angle = std::f64::consts::TAU * (f64::from(step) + 0.25) / f64::from(circle);
            let radius = (1.0 - height * height).sqrt();
            let direction = Vec3::new((radius * angle.cos()) as f32, (radius * angle.sin()) as f32, *height as f32);
            let values: [f64; 16] = std::array::from_fn(|index| value(index, 3.0 * direction));
            for row in 0..16 {
                for column in 0..16 {
                    products[row][column] +=
                        share * std::f64::consts::TAU / f64::from(circle) * values[row] * values[column];
                }
            }
        }
    }
    for (row, products) in products.iter().enumerate() {
        for (column, product) in products.iter().enumerate() {
            let expected = f64::from(u8::from(row == column));
            assert!((product - expected).abs() < 2.0e-5, "{row} {column}: {product}");
        }
    }
    // The published signs: y and x are negative, z is positive; and a place on top of the mean has degree 0 alone.
    let one = |index: usize, direction: Vec3| value(index, direction).signum();
    assert_eq!([one(1, Vec3::Y), one(2, Vec3::Z), one(3, Vec3::X)], [-1.0, 1.0, -1.0]);
    assert_eq!(colour_along([0.0; 3], &[9.0; 45], 3, Vec3::ZERO), [0.5; 3]);
    assert_eq!(colour_along([-9.0, 0.0, 9.0], &[0.0; 0], 0, Vec3::X)[0], 0.0);
}
