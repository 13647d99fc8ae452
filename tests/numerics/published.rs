//! Against numbers of the published implementations: weights of every scheme, PSNR and SSIM.
//!
//! `VIEWFUSE_WEIGHTING_JSON` names another file of the same format to check instead of the excerpt kept here.

use serde_json::Value;
use std::path::PathBuf;
use viewfuse::check::compare::Comparator;
use viewfuse_core::metrics::{mean_squared_error, psnr, ssim};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{AngleKind, Scheme, weigh};
use viewfuse_tests::places::data;

/// The scheme that a published name means.
fn scheme(name: &str) -> Scheme {
    let number = |text: &str| text.parse::<f32>().unwrap_or_else(|_| panic!("{name}: no number"));
    let built = match name {
        "baseline_mean" => Ok(Scheme::MEAN),
        "distance" => Scheme::distance(1),
        "distance_squared" => Scheme::distance(2),
        "distance_cubed" => Scheme::distance(3),
        "l1_weighing" => Ok(Scheme::L1),
        "f_norm_weighting" => Ok(Scheme::FROBENIUS),
        "rel_cam_poses_l2" | "rel_cam_poses_f_norm" => Ok(Scheme::RELATIVE_FROBENIUS),
        _ => {
            if let Some(alpha) = name.strip_prefix("error_weighing_alpha=") {
                Scheme::error(number(alpha), AngleKind::FullRotation)
            } else if let Some(beta) = name.strip_prefix("distance_gaussian_b=") {
                Scheme::gaussian(number(beta))
            } else {
                panic!("unknown method {name}")
            }
        }
    };
    built.unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn reference() -> Value {
    let path = std::env::var_os("VIEWFUSE_WEIGHTING_JSON").map_or_else(|| data("weighting.json"), PathBuf::from);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn array(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_else(|| panic!("not an array: {value}"))
}

/// All numbers of an array; `None` if it is something else or holds something else (NaN, an error's text).
fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn pose(value: &Value) -> Pose {
    let entries = numbers(value).expect("16 numbers");
    let mut matrix = [[0.0_f32; 4]; 4];
    entries.iter().enumerate().for_each(|(i, entry)| matrix[i / 4][i % 4] = *entry as f32);
    Pose::from_opengl(&matrix).expect("a pose")
}

fn ours(case: &Value, scheme: Scheme) -> Vec<f32> {
    let poses: Vec<Pose> = array(&case["src"]).iter().map(pose).collect();
    let sources = Sources::<32>::new(&poses).expect("up to 32 sources");
    let weights = weigh(scheme, &sources, &pose(&case["tgt"]));
    weights.values()[..poses.len()].to_vec()
}

#[test]
fn every_published_scheme_agrees() {
    let reference = reference();
    let cases = array(&reference["cases"]);
    assert!(cases.len() >= 5);
    let first = cases[0]["official"].as_object().expect("methods by name");
    assert_eq!(first.len(), 15);
    for name in first.keys() {
        let scheme = scheme(name);
        let mut worst = 0.0_f64;
        for case in cases {
            let actual = ours(case, scheme);
            let published = &case["official"][name];
            let wide = numbers(&published["f64"]);
            // The relative pose was never published in f64.
            assert!(wide.is_some() || scheme == Scheme::RELATIVE_FROBENIUS, "{name}");
            let expected = wide.or_else(|| numbers(&published["f32"])).expect("numbers");
            // The poses are rounded to f32: a Gaussian's logit of 40 loses 40 * 4 * 2^-24 to that alone.
            let tolerance = Comparator { absolute: 0.0, relative: 1.0e-5 };
            let result = tolerance.compare(&actual, &expected);
            let at = result.unwrap_or_else(|error| panic!("{name} on {}: {error}", case["name"]));
            worst = worst.max((f64::from(at.actual) / at.expected - 1.0).abs());
        }
        println!("{name}: {worst:.2e} relative");
    }
}

#[test]
fn extreme_poses_give_weights_where_the_published_code_gives_nan() {
    let reference = reference();
    let (mut repaired, mut pairs) = (0, 0);
    for case in array(&reference["extreme"]) {
        for (name, published) in case["official"].as_object().expect("methods by name") {
            let actual = ours(case, scheme(name));
            let sum: f64 = actual.iter().map(|w| f64::from(*w)).sum();
            assert!(actual.iter().all(|w| w.is_finite() && *w >= 0.0), "{name} on {}: {actual:?}", case["name"]);
            assert!((sum - 1.0).abs() <= actual.len() as f64 / 16_777_216.0, "{name} on {}: {actual:?}", case["name"]);
            pairs += 1;
            repaired += i32::from(numbers(&published["f32"]).is_none());
            // Where f64 survives and no angle or offset decides, it is the limit that ours gives, too.
            if let (Some(expected), true) = (numbers(&published["f64"]), !name.starts_with("error")) {
                let tolerance = Comparator { absolute: 1.0e-6, relative: 1.0e-5 };
                let result = tolerance.compare(&actual, &expected);
                assert!(result.is_ok(), "{name} on {}: {actual:?} {expected:?}", case["name"]);
            }
        }
    }
    assert_eq!((repaired, pairs), (27, 135));
}

fn picture(name: &str) -> (Vec<u8>, usize, usize) {
    let path = data("metrics").join(format!("{name}.png"));
    let image = image::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).into_rgb8();
    let (width, height) = image.dimensions();
    (image.into_raw(), width as usize, height as usize)
}

#[test]
fn psnr_and_ssim_are_scikit_images() {
    let text = include_str!("../data/metrics/expected.json");
    let expected: Value = serde_json::from_str(text).expect("JSON");
    for pair in array(&expected["pairs"]) {
        let name = pair["name"].as_str().expect("a name");
        let (prediction, width, height) = picture(&format!("{name}_pred"));
        let (truth, ..) = picture(&format!("{name}_truth"));
        let close = |actual: f64, expected: &Value| {
            let expected = expected.as_f64().expect("a number");
            println!("{name}: {actual} for {expected}, {:.1e} relative", (actual / expected - 1.0).abs());
            assert!((actual - expected).abs() <= 1.0e-9 * expected.abs(), "{actual} {expected}");
        };
        close(psnr(&prediction, &truth), &pair["psnr"]);
        close(ssim(&prediction, &truth, width, height, 3).expect("large enough"), &pair["ssim"]);
        assert_eq!(psnr(&truth, &truth), f64::INFINITY);
        assert_eq!(ssim(&truth, &truth, width, height, 3), Some(1.0));
    }
}

#[test]
fn metrics_of_degenerate_pictures() {
    assert_eq!(mean_squared_error(&[], &[]), 0.0);
    assert_eq!(mean_squared_error(&[0, 255], &[255, 0]), 65025.0);
    assert_eq!(psnr(&[0], &[255]), 0.0);
    assert_eq!(ssim(&[0; 42], &[0; 42], 6, 7, 1), None);
    assert_eq!(ssim(&[0; 42], &[0; 42], 7, 6, 1), None);
    assert_eq!(ssim(&[], &[], 7, 7, 0), None);
    assert_eq!(ssim(&[9; 49], &[9; 49], 7, 7, 1), Some(1.0));
    let flat = ssim(&[0; 49], &[255; 49], 7, 7, 1).expect("one window");
    assert!((flat - 6.5025 / (65025.0 + 6.5025)).abs() < 1.0e-12);
}
