//! The attention weightings: against the published implementations, with parameters by formula, and against `f64`.

use serde_json::Value;
use viewfuse::check::compare::Comparator;
use viewfuse::check::oracle::{Matrix, WidePose};
use viewfuse::check::poses::{Random, pose_of};
use viewfuse::nn::initialisation;
use viewfuse_core::attention::{
    EMBEDDING, FlatEmbedding, FourierEmbedding, LearnedCrossAttention, Linear, POSE_FEATURES, PoseEmbedding,
    PoseSelfAttention, cross_attention, learned_cross_attention, pose_self_attention, published_cross_attention,
};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;

const VARIANTS: [&str; 5] =
    ["paper_fourier", "paper_flat", "cross_attention", "learned_cross_attention", "relative_pose_self_attention"];
const SELF: &str = "relative_pose_self_attention";

/// A layer from rows `first..first + O` of the named tensors.
fn layer<const I: usize, const O: usize>(weight: (&str, usize), bias: Option<&str>, first: usize) -> Linear<I, O> {
    let flat = initialisation::tensor(weight.0, &[weight.1, I]);
    let bias = bias.map(|name| initialisation::tensor(name, &[weight.1]));
    Linear {
        weight: std::array::from_fn(|row| std::array::from_fn(|column| flat[(first + row) * I + column])),
        bias: std::array::from_fn(|row| bias.as_ref().map_or(0.0, |bias| bias[first + row])),
    }
}

fn named<const I: usize, const O: usize>(name: &str) -> Linear<I, O> {
    layer((&format!("{name}.weight"), O), Some(&format!("{name}.bias")), 0)
}

fn fourier() -> FourierEmbedding {
    FourierEmbedding { first: named("paper.0"), second: named("paper.2"), third: named("paper.4") }
}

fn flat() -> FlatEmbedding {
    FlatEmbedding { first: named("paper_flat.0"), second: named("paper_flat.2") }
}

fn learned() -> LearnedCrossAttention {
    let tensor = |name: &str| layer((&format!("learned_cross_attention.{name}.weight"), POSE_FEATURES), None, 0);
    LearnedCrossAttention { query: tensor("query_layer"), key: tensor("key_layer") }
}

fn self_attention() -> PoseSelfAttention {
    let (weight, bias) =
        (format!("{SELF}.multihead_attention.in_proj_weight"), format!("{SELF}.multihead_attention.in_proj_bias"));
    let part = |first: usize| layer((&weight, 3 * POSE_FEATURES), Some(&bias), first * POSE_FEATURES);
    PoseSelfAttention {
        query: part(0),
        key: part(1),
        value: part(2),
        output: named(&format!("{SELF}.multihead_attention.out_proj")),
        logit: named(&format!("{SELF}.weight_calculation_layer")),
    }
}

fn weights(variant: &str, poses: &[Pose], target: &Pose) -> Vec<f32> {
    let sources = Sources::<8>::new(poses).expect("up to 8 sources");
    let weights = match variant {
        "paper_fourier" => cross_attention(&fourier(), &sources, target),
        "paper_flat" => cross_attention(&flat(), &sources, target),
        "cross_attention" => published_cross_attention(&sources, target),
        "learned_cross_attention" => learned_cross_attention(&learned(), &sources, target),
        _ => pose_self_attention(&self_attention(), &sources, target),
    };
    weights.values()[..poses.len()].to_vec()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

fn poses(value: &Value) -> Vec<Pose> {
    let pose = |value: &Value| {
        let entries = numbers(value);
        let matrix = std::array::from_fn(|row| std::array::from_fn(|column| entries[row * 4 + column] as f32));
        Pose::from_opengl(&matrix).expect("a pose")
    };
    value.as_array().into_iter().flatten().map(pose).collect()
}

#[test]
fn all_five_variants_agree_with_the_published_code() {
    let reference: Value = serde_json::from_str(include_str!("../data/attention.json")).expect("JSON");
    let (sources, targets) = (poses(&reference["sources"]), poses(&reference["targets"]));
    assert_eq!((sources.len(), targets.len()), (5, 4));
    let tolerance = Comparator { absolute: 1.0e-5, relative: 1.0e-5 };
    for variant in VARIANTS {
        let mut worst = 0.0_f64;
        for (index, target) in targets.iter().enumerate() {
            let rows = reference["weights"][variant].as_array().expect("[source][target]");
            let expected: Vec<f64> = rows.iter().map(|row| numbers(row)[index]).collect();
            let actual = weights(variant, &sources, target);
            tolerance.compare_varying(&actual, &expected).unwrap_or_else(|error| panic!("{variant}: {error}"));
            actual.iter().zip(&expected).for_each(|(a, e)| worst = worst.max((f64::from(*a) - e).abs()));
        }
        println!("{variant}: {worst:.1e} from the published weights");
    }
    let embedding = fourier();
    for (target, expected) in targets.iter().zip(reference["paper_fourier_embedding"].as_array().expect("embeddings")) {
        let actual = embedding.embed(target);
        tolerance.compare_varying(&actual, &numbers(expected)).unwrap_or_else(|error| panic!("embedding: {error}"));
    }
}

fn apply<const I: usize, const O: usize>(layer: &Linear<I, O>, x: &[f64], relu: bool) -> Vec<f64> {
    let row = |o: usize| f64::from(layer.bias[o]) + (0..I).map(|i| f64::from(layer.weight[o][i]) * x[i]).sum::<f64>();
    (0..O).map(row).map(|y| if relu { y.max(0.0) } else { y }).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn softmax(logits: &[f64]) -> Vec<f64> {
    let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logits.iter().map(|l| (l - largest).exp()).sum();
    logits.iter().map(|l| (l - largest).exp() / sum).collect()
}

fn features(centre: [f64; 3], backward: [f64; 3]) -> Vec<f64> {
    let mut features = centre.to_vec();
    for k in 0..6 {
        let angles = centre.map(|c| 1.5 * f64::from(1 << k) * c);
        features.extend(angles.map(f64::sin));
        features.extend(angles.map(f64::cos));
    }
    features.extend(backward);
    features
}

fn own_features(pose: &Pose) -> Vec<f64> {
    let wide = WidePose::new(pose);
    features(wide.centre, wide.axes[2].map(|c| -c))
}

fn flat_entries(pose: &Pose) -> Vec<f64> {
    pose.to_opengl().iter().flatten().map(|entry| f64::from(*entry)).collect()
}

/// Features of `S^-1 T` in OpenGL axes.
fn relative(source: &Pose, target: &Pose) -> Vec<f64> {
    let (s, t) = (WidePose::new(source), WidePose::new(target));
    let gl: Matrix = [s.axes[0], s.axes[1].map(|c| -c), s.axes[2].map(|c| -c)];
    let offset = viewfuse::check::oracle::minus(t.centre, s.centre);
    let project = |v: [f64; 3]| gl.map(|axis| viewfuse::check::oracle::dot(axis, v));
    features(project(offset), project(t.axes[2].map(|c| -c)))
}

/// The logits of a variant in `f64`.
fn oracle(variant: &str, sources: &[Pose], target: &Pose) -> Vec<f64> {
    let scale = (EMBEDDING as f64).sqrt();
    match variant {
        "paper_fourier" => {
            let e = fourier();
            let embed = |pose: &Pose| {
                apply(&e.third, &apply(&e.second, &apply(&e.first, &own_features(pose), true), true), false)
            };
            sources.iter().map(|s| dot(&embed(target), &embed(s)) / scale).collect()
        }
        "paper_flat" => {
            let e = flat();
            let embed = |pose: &Pose| apply(&e.second, &apply(&e.first, &flat_entries(pose), true), false);
            sources.iter().map(|s| dot(&embed(target), &embed(s)) / scale).collect()
        }
        "cross_attention" => sources.iter().map(|s| dot(&own_features(target), &own_features(s))).collect(),
        "learned_cross_attention" => {
            let p = learned();
            let query = apply(&p.query, &own_features(target), false);
            sources.iter().map(|s| dot(&query, &apply(&p.key, &own_features(s), false))).collect()
        }
        _ => {
            let p = self_attention();
            let rows: Vec<_> = sources.iter().map(|s| relative(s, target)).collect();
            let keys: Vec<_> = rows.iter().map(|x| apply(&p.key, x, false)).collect();
            let values: Vec<_> = rows.iter().map(|x| apply(&p.value, x, false)).collect();
            let logit = |x: &Vec<f64>| {
                let query = apply(&p.query, x, false);
                let mut attended = vec![0.0; POSE_FEATURES];
                for head in 0..3 {
                    let part = head * 14..(head + 1) * 14;
                    let scores: Vec<f64> =
                        keys.iter().map(|k| dot(&query[part.clone()], &k[part.clone()]) / 14.0_f64.sqrt()).collect();
                    for (share, value) in softmax(&scores).iter().zip(&values) {
                        part.clone().for_each(|feature| attended[feature] += share * value[feature]);
                    }
                }
                apply(&p.logit, &apply(&p.output, &attended, false), false)[0]
            };
            rows.iter().map(logit).collect()
        }
    }
}

#[test]
fn all_variants_agree_with_f64() {
    let mut random = Random::new(51);
    for variant in VARIANTS {
        let mut worst = 0.0_f64;
        for case in 0..60 {
            let scale = [0.3, 1.0, 2.0][case % 3];
            let sources: Vec<Pose> = (0..1 + case % 8).map(|_| random.pose(scale)).collect();
            let target = random.pose(scale);
            let logits = oracle(variant, &sources, &target);
            let expected = softmax(&logits);
            let actual = weights(variant, &sources, &target);
            // Arguments of the highest sine are rounded at 48 times the centre: a few 1e-6 in a feature, which the
            // layers carry to the logit.
            let size = logits.iter().fold(1.0_f64, |size, logit| size.max(logit.abs()));
            let tolerance = Comparator { absolute: 1.0e-30, relative: 4.0e-5 + 4.0e-6 * size };
            tolerance.compare(&actual, &expected).unwrap_or_else(|error| panic!("{variant}: {error}"));
            actual.iter().zip(&expected).for_each(|(a, e)| worst = worst.max((f64::from(*a) - e).abs()));
        }
        println!("{variant}: {worst:.1e} from f64");
    }
}

#[test]
fn relative_self_attention_ignores_the_world() {
    let mut random = Random::new(52);
    for _ in 0..40 {
        let rotation = random.rotation();
        let shift = random.vector();
        let moved = |pose: &Pose| {
            let wide = WidePose::new(pose);
            let turn = |v: [f64; 3]| rotation.map(|row| viewfuse::check::oracle::dot(row, v));
            let axes = wide.axes.map(turn);
            let centre = turn(wide.centre);
            let columns: Matrix = std::array::from_fn(|row| std::array::from_fn(|column| axes[column][row]));
            pose_of(&columns, std::array::from_fn(|axis| centre[axis] + shift[axis]))
        };
        let sources: Vec<Pose> = (0..5).map(|_| random.pose(1.0)).collect();
        let target = random.pose(1.0);
        let before: Vec<f64> = weights(SELF, &sources, &target).iter().map(|w| f64::from(*w)).collect();
        let after = weights(SELF, &sources.iter().map(moved).collect::<Vec<_>>(), &moved(&target));
        // Centres are rounded to 2e-7; the highest frequency makes 1e-5 of it.
        let tolerance = Comparator { absolute: 0.0, relative: 1.0e-4 };
        tolerance.compare_varying(&after, &before).unwrap_or_else(|error| panic!("{error}"));
        let shifted: Vec<Pose> = (0..5).map(|view| sources[(view + 2) % 5]).collect();
        let permuted: Vec<f64> = (0..5).map(|view| before[(view + 2) % 5]).collect();
        tolerance
            .compare_varying(&weights(SELF, &shifted, &target), &permuted)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn a_single_source_has_all_the_weight_and_far_ones_stay_finite() {
    let mut random = Random::new(53);
    for variant in VARIANTS {
        assert_eq!(weights(variant, &[random.pose(1.0)], &random.pose(1.0)), [1.0], "{variant}");
        for scale in [1.0e3, 1.0e10, 1.0e25] {
            let sources: Vec<Pose> = (0..4).map(|_| random.pose(scale)).collect();
            let actual = weights(variant, &sources, &random.pose(scale));
            let sum: f32 = actual.iter().sum();
            assert!(actual.iter().all(|w| *w >= 0.0) && (sum - 1.0).abs() < 1.0e-6, "{variant} {scale}: {actual:?}");
        }
    }
}
