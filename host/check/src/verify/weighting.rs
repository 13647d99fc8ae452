//! `weighting.json`: weights of the published formulas.

use super::{Measure, Quantity, Report, VerifyError};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::MAX_SOURCES;

/// Relative difference from the official `f64` weights that passes: our own error is some 1e-6 (see
/// `viewfuse_core::weighting`), and the official formula's on `f32` poses of nearly equal cameras is as large.
const TOLERANCE: f64 = 1.0e-5;
#[derive(Deserialize)]
struct File {
    cases: Vec<Case>,
    #[serde(default)]
    extreme: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    src: Vec<Vec<f32>>,
    tgt: Vec<f32>,
    official: BTreeMap<String, Value>,
}

pub(super) fn verify(path: &Path, json: &Value) -> Result<Report, VerifyError> {
    let content = |place: &str, message: String| VerifyError::Content {
        path: path.to_path_buf(),
        place: place.to_owned(),
        message,
    };
    // Other JSON, as that of a scene, is no damaged file of weights.
    if json.get("cases").is_none() {
        return Err(VerifyError::Unknown { path: path.to_path_buf() });
    }
    let file = File::deserialize(json).map_err(|error| content("top level", error.to_string()))?;
    if file.cases.is_empty() {
        return Err(content("cases", "holds no reference values".to_owned()));
    }
    // Distance from the simplex that passes: the rounding of a sum of as many terms as the file has sources.
    let most_sources = file.cases.iter().chain(&file.extreme).map(|case| case.src.len()).max().unwrap_or(1);
    let simplex_tolerance = most_sources as f64 / 16_777_216.0;
    let mut agreement: BTreeMap<String, Quantity> = BTreeMap::new();
    let mut simplex: BTreeMap<String, Quantity> = BTreeMap::new();
    let mut not_covered: Vec<String> = Vec::new();
    for (case, is_extreme) in file.cases.iter().map(|c| (c, false)).chain(file.extreme.iter().map(|c| (c, true))) {
        let poses: Vec<Pose> = case
            .src
            .iter()
            .map(|matrix| pose(matrix))
            .collect::<Result<_, _>>()
            .map_err(|message| content(&format!("case '{}', src", case.name), message))?;
        let target = pose(&case.tgt).map_err(|message| content(&format!("case '{}', tgt", case.name), message))?;
        let sources = Sources::<MAX_SOURCES>::new(&poses)
            .map_err(|error| content(&format!("case '{}', src", case.name), error.to_string()))?;
        for (method, official) in &case.official {
            let Some(weighting) = scheme_of(method) else {
                if !not_covered.contains(method) {
                    not_covered.push(method.clone());
                }
                continue;
            };
            let weights = weighting.weigh(&sources, &target);
            let ours = || weights.values()[..poses.len()].iter().map(|&weight| f64::from(weight));
            let on_simplex = simplex.entry(method.clone()).or_insert_with(|| {
                Quantity::new(format!("{method}: on the simplex"), Measure::Absolute, simplex_tolerance)
            });
            let negative: f64 = ours().map(|weight| (-weight).max(0.0)).sum();
            on_simplex.compare(ours().sum::<f64>(), 1.0, || case.name.clone());
            on_simplex.compare(negative, 0.0, || case.name.clone());
            if is_extreme {
                continue;
            }
            let reference =
                numbers(&official["f64"]).or_else(|| numbers(&official["f32"])).filter(|r| r.len() == poses.len());
            let Some(reference) = reference else {
                return Err(content(
                    &format!("case '{}', {method}", case.name),
                    "no list of weights, one a source".into(),
                ));
            };
            agreement
                .entry(method.clone())
                .or_insert_with(|| Quantity::new(format!("{method} ({weighting})"), Measure::Relative, TOLERANCE))
                .compare_all(ours(), reference, &case.name);
        }
    }
    // Weights on the simplex alone agree with nothing.
    if agreement.is_empty() {
        return Err(content("cases", "holds no reference values".to_owned()));
    }
    let quantities = agreement.into_values().chain(simplex.into_values()).collect();
    Ok(Report { path: path.to_path_buf(), quantities, not_covered })
}

/// The name here of a method of the published code.
fn scheme_of(method: &str) -> Option<Weighting> {
    let name = match method {
        "baseline_mean" => "mean".to_owned(),
        "distance" => "distance:power=1".to_owned(),
        "distance_squared" => "distance:power=2".to_owned(),
        "distance_cubed" => "distance:power=3".to_owned(),
        "l1_weighing" => "l1".to_owned(),
        "f_norm_weighting" => "frobenius".to_owned(),
        "rel_cam_poses_l2" | "rel_cam_poses_f_norm" => "relative-frobenius".to_owned(),
        _ => match method.split_once('=')? {
            ("error_weighing_alpha", alpha) => format!("error:alpha={alpha},angle=full"),
            ("distance_gaussian_b", beta) => format!("gaussian:beta={beta}"),
            _ => return None,
        },
    };
    Weighting::open(&name).ok()
}

/// A camera-to-world matrix, row-major, in OpenGL axes.
pub(super) fn pose(matrix: &[f32]) -> Result<Pose, String> {
    let numbers: &[f32; 16] = matrix.try_into().map_err(|_| format!("a pose has 16 numbers, not {}", matrix.len()))?;
    let rows = std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]));
    Pose::from_opengl(&rows).map_err(|error| format!("not a camera pose: {error}"))
}

/// A list of numbers, or `None` for anything else (the official code failed, or gave NaN).
fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}
