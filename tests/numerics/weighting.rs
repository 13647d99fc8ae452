//! Every formula weighting against `f64` on the same poses, with the derived bound, and what must not change it.

use crate::relative_units;
use viewfuse::check::oracle::{Matrix, WidePose, evaluate, normalised, schemes};
use viewfuse::check::poses::{Random, looking_at_origin, pose_of, ring, rotation_about};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{AngleKind, Formula, ROWS, Scheme, SchemeError, weigh};

/// Weights below this may be cut off: `exp` knows no subnormals.
const NEGLIGIBLE: f64 = 4.0e-38;
const COUNTS: [usize; 7] = [1, 2, 3, 5, 8, 16, 32];

fn weights(scheme: Scheme, sources: &[Pose], target: &Pose) -> Vec<f32> {
    let sources = Sources::<32>::new(sources).expect("between 1 and 32 sources");
    let weights = weigh(scheme, &sources, target);
    weights.values()[..weights.count() as usize].to_vec()
}

/// Largest error in units of `2^-24`, after asserting the simplex and the bound of each weight.
#[track_caller]
fn check(scheme: Scheme, sources: &[Pose], target: &Pose) -> f64 {
    let actual = weights(scheme, sources, target);
    let (expected, bounds) = evaluate(scheme, sources, target);
    let sum: f64 = actual.iter().map(|w| f64::from(*w)).sum();
    assert!((sum - 1.0).abs() <= sources.len() as f64 / 16_777_216.0, "{scheme}: sum {sum}");
    let mut worst = 0.0_f64;
    for view in 0..sources.len() {
        let (a, e, bound) = (actual[view], expected[view], bounds[view]);
        assert!(a.is_finite() && a >= 0.0, "{scheme}[{view}] = {a}");
        if (f64::from(a) - e).abs() <= NEGLIGIBLE {
            continue;
        }
        let units = relative_units(a, e);
        assert!(units <= bound, "{scheme}[{view}] = {a:e}, not {e:e}: {units:.1} units, bound {bound:.1}");
        worst = worst.max(units);
    }
    worst
}

/// Checks every formula on many scenes and prints the worst error of each.
#[track_caller]
fn check_all(what: &str, scenes: &[(Vec<Pose>, Pose)]) {
    for scheme in schemes() {
        let worst = scenes.iter().map(|(sources, target)| check(scheme, sources, target)).fold(0.0, f64::max);
        println!("{what}: {scheme}: {worst:.1} units of 2^-24");
    }
}

#[test]
fn every_formula_is_checked() {
    for row in ROWS {
        assert!(schemes().iter().any(|scheme| scheme.formula() == row.formula), "{} is in no check", row.name);
    }
}

#[test]
fn random_poses_of_all_sizes() {
    let mut random = Random::new(11);
    for scale in [1.0e-20, 1.0e-7, 1.0e-3, 0.1, 1.0, 3.0, 100.0, 1.0e7, 1.0e12, 1.0e18, 1.0e20, 1.0e29] {
        let scenes: Vec<_> = COUNTS
            .iter()
            .flat_map(|count| [*count; 40])
            .map(|count| ((0..count).map(|_| random.pose(scale)).collect(), random.pose(scale)))
            .collect();
        check_all(&format!("random, scale {scale:e}"), &scenes);
    }
}

/// Two sources at nearly the distance of subnormal numbers: one at the target's place, one beside it.
#[test]
fn subnormal_distances_count() {
    let at = |x: f32| pose_of(&rotation_about([0.0, 0.0, 1.0], 0.0), [f64::from(x), 0.0, 0.0]);
    for x in [1.0e-45, 1.0e-40, 1.0e-38, 1.0e-31, 1.0e-29] {
        let found =
            weights(Scheme::error(0.5, AngleKind::FullRotation).expect("a scheme"), &[at(0.0), at(x)], &at(0.0));
        assert!(found[0] > 0.999_99 && found[1] < 1.0e-5, "{x:e}: {found:?}");
    }
}

/// The squares of nearly equal distances differ by less than they are rounded by.
#[test]
fn cameras_on_a_shell_far_away() {
    let mut random = Random::new(15);
    for radius in [10.0, 100.0, 1.0e3, 3.0e3, 1.0e4] {
        let scenes: Vec<_> = (0..400)
            .map(|index| {
                let sources = (0..COUNTS[index % 7]).map(|_| {
                    let (direction, beyond) = (normalised(random.vector()), random.log_range(1.0e-8, 1.0e-3));
                    pose_of(&random.rotation(), direction.map(|along| along * radius * (1.0 + beyond)))
                });
                (sources.collect::<Vec<_>>(), Pose::IDENTITY)
            })
            .collect();
        check_all(&format!("shell of radius {radius:e}"), &scenes);
    }
}

#[test]
fn distances_of_very_different_sizes() {
    let mut random = Random::new(12);
    let scenes: Vec<_> = (0..300)
        .map(|i| {
            let sources = (0..COUNTS[i % 7]).map(|_| {
                let s = random.log_range(1.0e-9, 1.0e20);
                random.pose(s)
            });
            (sources.collect::<Vec<_>>(), Pose::IDENTITY)
        })
        .collect();
    check_all("mixed scales", &scenes);
}

#[test]
fn rings_with_and_without_roll() {
    let mut scenes = Vec::new();
    for roll in [0.0, 0.3, 3.0] {
        for count in COUNTS {
            let sources = ring(count, 1.2, 0.5, roll);
            scenes.push((sources.clone(), looking_at_origin([0.4, -1.0, 0.7], 0.0)));
            scenes.push((sources.clone(), looking_at_origin([0.4, -1.0, 0.7], 2.0)));
            scenes.push((sources.clone(), sources[count / 2]));
            scenes.push((ring(count, 800.0, 30.0, roll), looking_at_origin([500.0, 600.0, 30.0], 0.0)));
        }
    }
    check_all("rings", &scenes);
    let uniform =
        weights(Scheme::RELATIVE_FROBENIUS, &ring(8, 1.3, 0.4, 0.0), &looking_at_origin([1.0, 0.5, 0.5], 0.0));
    assert!(uniform.iter().all(|w| (w - 0.125).abs() < 1.0e-6), "uniform on a look-at ring: {uniform:?}");
}

#[test]
fn cameras_that_nearly_coincide() {
    let mut random = Random::new(13);
    let mut scenes = Vec::new();
    for i in 0..600 {
        let rotation = random.rotation();
        let centre = random.vector();
        let sources = (0..COUNTS[i % 7]).map(|_| {
            let angle = random.log_range(1.0e-7, 1.0e-2);
            let distance = random.log_range(1.0e-7, 1.0e-2);
            let turned = multiply(&rotation_about(random.vector(), angle), &rotation);
            let step = normalised(random.vector());
            pose_of(&turned, [0, 1, 2].map(|axis| centre[axis] + distance * step[axis]))
        });
        scenes.push((sources.collect::<Vec<_>>(), pose_of(&rotation, centre)));
    }
    check_all("near-coincident", &scenes);
}

#[test]
fn coinciding_cameras_share_the_weight() {
    let pose = looking_at_origin([1.0, 0.2, 0.3], 0.5);
    let other = looking_at_origin([-1.0, 0.4, 0.3], 0.0);
    for scheme in schemes() {
        assert_eq!(weights(scheme, &[pose; 3], &pose), vec![1.0 / 3.0; 3], "{scheme}");
        check(scheme, &[pose, other, pose], &pose);
        check(scheme, &[pose, other], &other);
        assert_eq!(weights(scheme, &[other], &pose), [1.0], "{scheme}");
    }
}

#[test]
fn angles_near_zero_a_right_angle_and_pi() {
    use std::f64::consts::{FRAC_PI_2, PI};
    let mut random = Random::new(14);
    let (mut axis_near, mut axis_far, mut rotation_near, mut rotation_far) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..60_000 {
        let base = random.rotation();
        let offset = random.log_range(1.0e-7, 1.0);
        let angle = [offset, FRAC_PI_2 + 1.0e-3 * offset, FRAC_PI_2 - offset, PI - offset, PI][i % 5];
        let turned = multiply(&rotation_about(random.vector(), angle), &base);
        let (a, b) = (pose_of(&base, [0.0; 3]), pose_of(&turned, [0.0; 3]));
        let (wide_a, wide_b) = (WidePose::new(&a), WidePose::new(&b));
        let axis = (a.axis_angle(&b), wide_a.axis_angle(&wide_b));
        let rotation = (a.rotation_angle(&b), wide_a.rotation_angle(&wide_b));
        axis_near = axis_near.max(relative_units(axis.0, axis.1));
        axis_far = axis_far.max((f64::from(axis.0) - axis.1).abs());
        // Where the two forms meet they differ by what the rotations are off; either is right there.
        if (rotation.1 - FRAC_PI_2).abs() > 1.0e-5 {
            rotation_near = rotation_near.max(relative_units(rotation.0, rotation.1));
        }
        rotation_far = rotation_far.max((f64::from(rotation.0) - angle).abs());
        assert_eq!(a.axis_angle(&a), 0.0);
        assert_eq!(a.rotation_angle(&a), 0.0);
        assert!((0.0..=std::f32::consts::PI).contains(&rotation.0) && (0.0..=std::f32::consts::PI).contains(&axis.0));
    }
    println!("axis angle: {axis_near:.1} units relative, {axis_far:.2e} rad");
    println!("rotation angle: {rotation_near:.1} units relative, {rotation_far:.2e} rad from the intended angle");
    assert!(axis_near <= 14.0 && axis_far <= 7.0e-7);
    assert!(rotation_near <= 16.5 && rotation_far <= 1.0e-6);
}

/// Poses whose axes are as long as is allowed: their angles are those of the directions.
#[test]
fn lengths_of_axes_are_no_angles() {
    let mut random = Random::new(15);
    let mut worst = 0.0_f64;
    for _ in 0..20_000 {
        let base = random.rotation();
        let turned = multiply(&rotation_about(random.vector(), random.log_range(1.0e-5, 1.5)), &base);
        let scaled = |rotation: &Matrix, scale: f64| rotation.map(|row| row.map(|number| scale * number));
        let scale = 1.0 + random.range(-4.0e-4, 4.0e-4);
        let (a, b) = (pose_of(&scaled(&base, scale), [0.0; 3]), pose_of(&turned, [0.0; 3]));
        let (wide_a, wide_b) = (WidePose::new(&a), WidePose::new(&b));
        let unit = f64::from(f32::EPSILON) / 2.0;
        let of_lengths = 6.0 * wide_a.length_difference(&wide_b);
        for (found, exact) in
            [(a.axis_angle(&b), wide_a.axis_angle(&wide_b)), (a.rotation_angle(&b), wide_a.rotation_angle(&wide_b))]
        {
            worst = worst.max((f64::from(found) - exact).abs() / unit / (18.5 * exact + of_lengths));
        }
    }
    println!("largest share of the bound: {worst:.2}");
    assert!(worst <= 1.0);
    // A source that is only scaled looks where the target looks, another one does not.
    let scaled = pose_of(&[[1.0004, 0.0, 0.0], [0.0, 1.0004, 0.0], [0.0, 0.0, 1.0004]], [0.0, 0.0, 1.0]);
    let turned = pose_of(&rotation_about([0.0, 1.0, 0.0], 1.0e-3), [1.0, 0.0, 0.0]);
    assert_eq!(scaled.axis_angle(&Pose::IDENTITY), 0.0);
    let scheme = Scheme::error(1.0, AngleKind::PrincipalAxis).expect("a scheme");
    let [straight, aside] = weights(scheme, &[scaled, turned], &Pose::IDENTITY)[..] else { panic!("two weights") };
    assert!((straight - 0.9969).abs() < 1.0e-4 && (aside - 0.0031).abs() < 1.0e-4, "{straight} {aside}");
}

#[test]
fn opposite_axes_are_pi_apart() {
    let a = Pose::IDENTITY;
    let b = pose_of(&[[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], [0.0; 3]);
    let rolled = pose_of(&[[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], [0.0; 3]);
    assert_eq!(a.axis_angle(&b), std::f32::consts::PI);
    assert_eq!(a.rotation_angle(&b), std::f32::consts::PI);
    assert_eq!(a.axis_angle(&rolled), 0.0);
    assert_eq!(a.rotation_angle(&rolled), std::f32::consts::PI);
}

#[test]
fn parameters_out_of_range_are_refused() {
    for alpha in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
        assert_eq!(Scheme::error(alpha, AngleKind::FullRotation), Err(SchemeError::Parameter(Formula::Error)));
    }
    for beta in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(Scheme::gaussian(beta), Err(SchemeError::Parameter(Formula::Gaussian)));
    }
    for power in [0, 4] {
        assert_eq!(Scheme::distance(power), Err(SchemeError::Choice(Formula::Distance)));
    }
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            product[row][column] = (0..3).map(|k| a[row][k] * b[k][column]).sum();
        }
    }
    product
}
