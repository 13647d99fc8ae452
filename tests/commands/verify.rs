//! `viewfuse verify` on reference values computed here in `f64`, right and wrong.

use super::{assert_refused, done, number_of, run};
use serde_json::{Value, json};
use viewfuse_tests::command::safetensors;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    right_weights_pass, wrong_weights_do_not, a_weight_that_is_no_number_does_not_pass,
    a_file_without_weights_is_no_reference, metrics_right_and_wrong, scores_of_the_official_codes,
    scores_that_are_not_the_official_codes, an_infinite_reference_says_nothing, one_file_of_several_may_be_broken,
];

/// Scores and distances by the official codes; see `tests/data/metrics.md`.
const REFERENCE: &[u8] = include_bytes!("../data/metrics/reference.safetensors");

/// Weights of two sources with these errors: proportional to `1 / (e + 1e-6)`.
fn weights(errors: [f64; 2]) -> [f64; 2] {
    let shares = errors.map(|error| 1.0 / (error + 1.0e-6));
    shares.map(|share| share / (shares[0] + shares[1]))
}

/// The target stands at the origin. One source is 1 away and turned by a right angle about y, the other is 3 away and
/// rolled by 30 degrees: the full angle counts the roll, the angle between the axes would not.
fn weighting() -> Value {
    let (sine, cosine) = (0.5, 3.0_f64.sqrt() / 2.0);
    let turned = json!([0, 0, 1, 1, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1]);
    let rolled = json!([cosine, -sine, 0, 0, sine, cosine, 0, 3, 0, 0, 1, 0, 0, 0, 0, 1]);
    let target = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let official = json!({
        "distance": { "f64": weights([1.0, 3.0]) },
        "distance_cubed": { "f64": weights([1.0, 27.0]) },
        "error_weighing_alpha=1": { "f64": weights([1.0 / 2.0, 1.0 / 6.0]) },
        "error_weighing_alpha=0.5": { "f64": weights([1.0 / 4.0 + 1.0 / 6.0, 1.0 / 12.0 + 1.0 / 2.0]) },
        "a_method_of_the_future": { "f64": [0.5, 0.5] },
    });
    json!({ "cases": [{ "name": "by hand", "src": [turned, rolled], "tgt": target, "official": official }] })
}

/// The reference is refused: exit code 1, and the quantity's row says so. Nothing is written.
#[track_caller]
fn assert_exceeded(folder: &Folder, file: &str, quantity: &str) {
    let outcome = run(folder, &format!("verify {file}"));
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), ""), "{}", outcome.stdout);
    let exceeded: Vec<&str> = outcome.stdout.lines().filter(|line| line.contains("EXCEEDED")).collect();
    assert!(exceeded.len() == 1 && exceeded[0].trim().starts_with(quantity), "{}", outcome.stdout);
}

fn right_weights_pass() {
    let folder = Folder::new();
    folder.write("weighting.json", weighting().to_string());
    let printed = done(&folder, "verify weighting.json");
    assert!(printed.contains("8 of 8 quantities within tolerance"), "{printed}");
    assert!(printed.contains("not computed by this version: a_method_of_the_future"), "{printed}");
    assert!(!printed.contains("EXCEEDED"), "{printed}");
}

fn wrong_weights_do_not() {
    let folder = Folder::new();
    for method in ["distance", "distance_cubed", "error_weighing_alpha=1", "error_weighing_alpha=0.5"] {
        let mut reference = weighting();
        let number = &mut reference["cases"][0]["official"][method]["f64"][1];
        *number = json!(number_of(number) + 1.0e-3);
        folder.write("weighting.json", reference.to_string());
        assert_exceeded(&folder, "weighting.json", method);
    }
}

/// Weights on the simplex alone agree with nothing.
fn a_file_without_weights_is_no_reference() {
    let folder = Folder::new();
    for official in [json!({}), json!({ "a_method_of_the_future": { "f64": [0.5, 0.5] } })] {
        let mut reference = weighting();
        reference["extreme"] = reference["cases"].clone();
        reference["cases"][0]["official"] = official;
        folder.write("weighting.json", reference.to_string());
        let outcome = run(&folder, "verify weighting.json");
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""));
        assert!(outcome.stderr.contains("holds no reference values"), "{outcome:?}");
    }
    for other in [json!({ "frames": [] }), json!([{ "name": "by hand" }]), json!(3)] {
        folder.write("other.json", other.to_string());
        let line = "other.json: holds no reference values that this version knows";
        assert_refused(&folder, "verify other.json", &[line]);
    }
}

/// JSON has no NaN: the official code's is `null`, which is no number to agree with.
fn a_weight_that_is_no_number_does_not_pass() {
    let folder = Folder::new();
    for bad in [json!(null), json!("NaN")] {
        let mut reference = weighting();
        reference["cases"][0]["official"]["distance"]["f64"][0] = bad;
        folder.write("weighting.json", reference.to_string());
        let outcome = run(&folder, "verify weighting.json");
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""));
        assert!(outcome.stderr.contains("weighting.json: case 'by hand', distance: no list of weights"), "{outcome:?}");
    }
}

/// Three pairs of pictures of 2 x 1 pixels: 10 apart everywhere, equal, and black against white.
fn metrics(psnr: [f64; 3]) -> Vec<u8> {
    let shape: &[usize] = &[3, 1, 2, 3];
    let prediction = [[110_u8; 6], [7; 6], [0; 6]].concat();
    let truth = [[100_u8; 6], [7; 6], [255; 6]].concat();
    let psnr: Vec<u8> = psnr.iter().flat_map(|value| value.to_le_bytes()).collect();
    safetensors(&[("pred", "U8", shape, prediction), ("truth", "U8", shape, truth), ("psnr", "F64", &[3], psnr)])
}

fn metrics_right_and_wrong() {
    let folder = Folder::new();
    let right = [10.0 * (255.0_f64 * 255.0 / 100.0).log10(), f64::INFINITY, 0.0];
    folder.write("metrics.safetensors", metrics(right));
    let printed = done(&folder, "verify metrics.safetensors");
    assert!(printed.contains("1 of 1 quantities within tolerance"), "{printed}");
    for (pair, wrong) in [(0, right[0] + 1.0e-3), (1, 100.0), (2, 1.0e-3), (0, f64::NAN), (1, f64::NAN)] {
        let mut psnr = right;
        psnr[pair] = wrong;
        folder.write("metrics.safetensors", metrics(psnr));
        assert_exceeded(&folder, "metrics.safetensors", "PSNR");
    }
    // One bad file among good ones fails the run, and the good one is still reported.
    folder.write("weighting.json", weighting().to_string());
    let outcome = run(&folder, "verify metrics.safetensors weighting.json");
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stdout.contains("0 of 1 quantities") && outcome.stdout.contains("8 of 8 quantities"));
}

/// Networks by formula with the heads that are published, and sets of points.
fn scores_of_the_official_codes() {
    let folder = Folder::new();
    folder.write("metrics.safetensors", REFERENCE);
    let printed = done(&folder, "verify metrics.safetensors --device cpu");
    assert!(printed.contains("7 of 7 quantities within tolerance"), "{printed}");
    assert!(!printed.contains("not computed"), "{printed}");
}

/// Every number of the file counts: a head's, a point's, a score.
fn scores_that_are_not_the_official_codes() {
    let folder = Folder::new();
    for (tensor, change, quantity) in [
        ("lpips_lin2.model.1.weight", 1.0, "LPIPS (alex)"),
        ("dists_beta", 1.0, "DISTS"),
        ("dists", 1.0e-6, "DISTS"),
        ("frechet_x", 1.0, "Frechet distance"),
        ("frechet_lowrank", 0.01, "Frechet distance, few points"),
        ("ssim_gaussian", 1.0e-6, "SSIM (Gaussian)"),
    ] {
        folder.write("metrics.safetensors", changed(tensor, change));
        assert_exceeded(&folder, "metrics.safetensors", quantity);
    }
}

/// The reference with the last number of a tensor increased.
fn changed(tensor: &str, change: f64) -> Vec<u8> {
    let mut bytes = REFERENCE.to_vec();
    let header_len = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let header: Value = serde_json::from_slice(&bytes[8..8 + header_len]).expect("a header");
    let end = 8 + header_len + header[tensor]["data_offsets"][1].as_u64().expect("an offset") as usize;
    if header[tensor]["dtype"] == "F64" {
        let number = bytes[..end].last_chunk_mut::<8>().expect("a number");
        *number = (f64::from_le_bytes(*number) + change).to_le_bytes();
    } else {
        let number = bytes[..end].last_chunk_mut::<4>().expect("a number");
        *number = (f32::from_le_bytes(*number) + change as f32).to_le_bytes();
    }
    bytes
}

/// A tolerance that is a share of the largest number, which is infinite.
fn an_infinite_reference_says_nothing() {
    let folder = Folder::new();
    let mut bytes = std::fs::read(viewfuse_tests::places::data("genvs_small.safetensors")).expect("a reference");
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let header: Value = serde_json::from_slice(&bytes[8..8 + length]).expect("a header");
    let [first, last] =
        [0, 1].map(|end| header["volume_value"]["data_offsets"][end].as_u64().expect("a place") as usize);
    let values = &mut bytes[8 + length..][first..last];
    values.chunks_exact_mut(4).for_each(|value| value.copy_from_slice(&7.0_f32.to_le_bytes()));
    values[..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    folder.write("genvs.safetensors", bytes);
    assert_exceeded(&folder, "genvs.safetensors --device cpu", "GeNVS volumes");
}

fn one_file_of_several_may_be_broken() {
    let folder = Folder::new();
    folder.write("weighting.json", weighting().to_string()).write("broken.json", "[");
    let outcome = run(&folder, "verify broken.json weighting.json none.json");
    assert!(outcome.stdout.contains("8 of 8 quantities within tolerance"), "{}", outcome.stdout);
    assert!(outcome.code == Some(1) && outcome.stderr.contains("broken.json"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("none.json"), "{}", outcome.stderr);
}
