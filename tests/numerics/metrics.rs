//! Metrics through networks' eyes: LPIPS, DISTS and Inception beside plain PyTorch, and what they must be whatever the
//! network. The parameters are by formula: no trained ones are needed.

use image::RgbImage;
use image::imageops::crop_imm;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use viewfuse::device::cpu::Cpu;
use viewfuse::evaluate::metrics::convention::Convention;
use viewfuse::evaluate::metrics::dists::Dists;
use viewfuse::evaluate::metrics::features::Inception;
use viewfuse::evaluate::metrics::frechet::frechet_distance;
use viewfuse::evaluate::metrics::heads::{published_dists, published_lpips};
use viewfuse::evaluate::metrics::kernel::kernel_distance;
use viewfuse::evaluate::metrics::lpips::{Lpips, LpipsTrunk};
use viewfuse::evaluate::metrics::trunk::{Convolution, InceptionKind, Pooling, Step, inception, tensors, vgg16};
use viewfuse::evaluate::metrics::{MetricError, Metrics, Scored, Scorer};
use viewfuse::nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse::nn::initialisation;
use viewfuse_core::metrics::{mean_squared_error, psnr, ssim};

/// What networks in `f32` may differ by, of the score.
const TOLERANCE: f64 = 1.0e-4;

fn data(name: &str) -> PathBuf {
    viewfuse_tests::places::data("metrics").join(name)
}

fn picture(name: &str) -> RgbImage {
    image::open(data(&format!("{name}.png"))).expect("a picture").into_rgb8()
}

fn pair(name: &str) -> [RgbImage; 2] {
    ["pred", "truth"].map(|side| picture(&format!("{name}_{side}")))
}

fn expected(name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(data("networks.json")).expect("the reference values");
    let values: Value = serde_json::from_str(&text).expect("JSON");
    values[name].as_array().expect("a list").iter().map(|value| value.as_f64().expect("a number")).collect()
}

/// Parameters by formula, the names behind a prefix; `change` may change them.
fn checkpoint(
    shapes: Vec<TensorShape>,
    prefix: &'static str,
    change: impl Fn(&TensorShape, &mut Vec<f32>) + Send + Sync + 'static,
) -> Checkpoint {
    Checkpoint::computed("made", shapes, BTreeMap::new(), move |tensor| {
        let mut values = initialisation::tensor(&format!("{prefix}{}", tensor.name), &tensor.shape);
        change(tensor, &mut values);
        values
    })
}

fn trunk(steps: &[Step<Convolution>], prefix: &'static str) -> Checkpoint {
    checkpoint(tensors(steps, 3).0, prefix, |_, _| {})
}

fn lpips(kind: LpipsTrunk) -> Lpips<Cpu> {
    let heads = published_lpips(kind).expect("heads");
    Lpips::new(&Cpu, kind, &trunk(&kind.steps(), ""), &heads).expect("the network")
}

fn dists() -> Dists<Cpu> {
    let vgg = trunk(&vgg16(Pooling::L2), "vgg16.");
    Dists::new(&Cpu, &vgg, &published_dists().expect("weights")).expect("the network")
}

/// An Inception with as many classes.
fn inception_of(classes: usize) -> Checkpoint {
    let kind = if classes == 1008 { InceptionKind::Fid } else { InceptionKind::Torchvision };
    let mut shapes = tensors(&inception(kind), 3).0;
    shapes.push(TensorShape { name: "fc.weight".to_owned(), shape: vec![classes, 2048] });
    shapes.push(TensorShape { name: "Mixed_5b.branch1x1.bn.num_batches_tracked".to_owned(), shape: Vec::new() });
    checkpoint(shapes, "", |_, _| {})
}

#[track_caller]
fn assert_relative(ours: f64, expected: f64) {
    assert!((ours - expected).abs() <= TOLERANCE * expected.abs(), "{ours} is not {expected}");
}

#[track_caller]
fn assert_refused<T>(outcome: Result<T, MetricError>, parts: &[&str]) {
    let text = outcome.err().expect("a refusal").to_string();
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn lpips_is_pytorchs() {
    for kind in LpipsTrunk::ALL {
        let lpips = lpips(kind);
        for (name, expected) in ["similar", "noisy"].into_iter().zip(expected(kind.metric())) {
            let [prediction, truth] = pair(name);
            let ours = lpips.distance(&Cpu, &prediction, &truth).expect("a distance");
            assert_relative(ours, expected);
            assert_eq!(lpips.distance(&Cpu, &truth, &prediction).expect("a distance"), ours, "the same both ways");
            assert_eq!(lpips.distance(&Cpu, &truth, &truth).expect("a distance"), 0.0);
        }
    }
}

#[test]
fn dists_is_pytorchs() {
    let dists = dists();
    for (name, expected) in ["similar", "noisy"].into_iter().zip(expected("dists")) {
        let [prediction, truth] = pair(name);
        let ours = dists.distance(&Cpu, &prediction, &truth).expect("a distance");
        assert_relative(ours, expected);
        assert!((0.0..=1.0).contains(&ours), "{ours}");
        let back = dists.distance(&Cpu, &truth, &prediction).expect("a distance");
        assert!((back - ours).abs() <= 1.0e-14, "the same both ways: {back} and {ours}");
        assert_eq!(dists.distance(&Cpu, &truth, &truth).expect("a distance"), 0.0);
    }
}

#[test]
fn inceptions_are_pytorchs() {
    let [prediction, truth] = pair("noisy");
    let mut seen = Vec::new();
    for (classes, kind, name) in
        [(1008, InceptionKind::Fid, "inception-fid"), (1000, InceptionKind::Torchvision, "inception-torchvision")]
    {
        let inception = Inception::new(&Cpu, &inception_of(classes)).expect("the network");
        assert_eq!(inception.kind(), kind);
        let features = inception.features(&Cpu, [&prediction]).expect("features");
        let ours: Vec<f64> = features.rows().next().expect("a picture").iter().copied().step_by(31).collect();
        let expected = expected(name);
        assert_eq!((features.count(), features.dimension(), ours.len()), (1, 2048, expected.len()));
        let largest = expected.iter().copied().fold(0.0, f64::max);
        for (place, (ours, expected)) in ours.iter().zip(&expected).enumerate() {
            assert!((ours - expected).abs() <= 1.0e-5 * largest, "{name} {place}: {ours} is not {expected}");
        }
        seen.push(ours);
        if kind == InceptionKind::Fid {
            // Two pictures on each side, whole and cut: a rank of 1 in 2048 dimensions.
            let cut = |picture: &RgbImage| crop_imm(picture, 8, 8, 96, 80).to_image();
            let sets = [&prediction, &truth]
                .map(|picture| inception.features(&Cpu, [picture, &cut(picture)]).expect("features"));
            let distance = frechet_distance(&sets[0], &sets[1]).expect("a distance");
            assert!(distance > 0.0 && frechet_distance(&sets[0], &sets[0]).expect("a distance") < 1.0e-9 * distance);
            assert!(kernel_distance(&sets[0], &sets[1], 0).expect("a distance").is_finite());
        }
    }
    assert_ne!(seen[0], seen[1], "the two kinds pool differently");
}

/// The comparisons above would notice a single wrong weight.
#[test]
fn one_changed_weight_shows() {
    let [prediction, truth] = pair("noisy");
    let shapes = || tensors(&LpipsTrunk::Alex.steps(), 3).0;
    let heads = published_lpips(LpipsTrunk::Alex).expect("heads");
    for changed in ["features.0.weight", "features.3.bias", "features.10.bias"] {
        let trunk = checkpoint(shapes(), "", move |tensor, values| {
            if tensor.name == changed {
                values[7] += 1.0;
            }
        });
        let lpips = Lpips::new(&Cpu, LpipsTrunk::Alex, &trunk, &heads).expect("the network");
        let ours = lpips.distance(&Cpu, &prediction, &truth).expect("a distance");
        let expected = expected("lpips-alex")[1];
        assert!((ours - expected).abs() > 3.0 * TOLERANCE * expected, "{changed}: {ours} is still {expected}");
    }
}

#[test]
fn what_is_no_such_network_is_refused_with_the_reason() {
    let heads = || published_lpips(LpipsTrunk::Alex).expect("heads");
    let with = |change: &dyn Fn(&mut Vec<TensorShape>)| {
        let mut shapes = tensors(&LpipsTrunk::Alex.steps(), 3).0;
        change(&mut shapes);
        Lpips::new(&Cpu, LpipsTrunk::Alex, &checkpoint(shapes, "", |_, _| {}), &heads())
    };
    let classifier = TensorShape { name: "classifier.1.weight".to_owned(), shape: vec![2, 3] };
    assert!(with(&|shapes| shapes.push(classifier.clone())).is_ok(), "torchvision's files have it");
    let without = with(&|shapes| shapes.retain(|tensor| tensor.name != "features.6.bias"));
    assert_refused(without, &["made", "missing: features.6.bias"]);
    let misshapen = with(&|shapes| shapes[0].shape = vec![64, 3, 7, 7]);
    assert_refused(misshapen, &["features.0.weight is [64, 3, 7, 7], not [64, 3, 11, 11]"]);
    let renamed = with(&|shapes| shapes[0].name.push('x'));
    assert_refused(renamed, &["unexpected: features.0.weightx"]);
    let vgg = trunk(&LpipsTrunk::Vgg.steps(), "");
    let of_another = Lpips::new(&Cpu, LpipsTrunk::Vgg, &vgg, &heads());
    assert_refused(of_another, &["published LPIPS heads (alex)", "lin1.model.1.weight is [1, 192, 1, 1]"]);
    assert_refused(Dists::new(&Cpu, &vgg, &heads()), &["missing: alpha, beta"]);
    let of_ten = Inception::new(&Cpu, &inception_of(10));
    assert_refused(of_ten, &["made: is no Inception v3", "fc.weight has 10 classes"]);
    assert_refused(Inception::new(&Cpu, &vgg), &["no tensor fc.weight"]);
}

#[test]
fn pictures_that_cannot_be_compared() {
    let lpips = lpips(LpipsTrunk::Alex);
    let (small, large) = (RgbImage::new(30, 40), RgbImage::new(31, 40));
    assert_refused(lpips.distance(&Cpu, &small, &small), &["30x40 is too small"]);
    assert_eq!(lpips.distance(&Cpu, &large, &large).expect("a distance"), 0.0, "the least that AlexNet can see");
    assert_refused(lpips.distance(&Cpu, &small, &large), &["30x40", "31x40"]);
    // VGG16 of DISTS sees anything.
    let dot = RgbImage::from_pixel(1, 1, [9, 200, 30].into());
    assert_eq!(dists().distance(&Cpu, &dot, &dot).expect("a distance"), 0.0);
}

#[test]
fn conventions_decide_what_is_scored() {
    let [prediction, truth] = pair("noisy");
    let scores = |convention: Convention| -> Vec<Scored> {
        let metrics =
            Metrics { device: &Cpu, convention, lpips: vec![lpips(LpipsTrunk::Alex)], dists: None, inception: None };
        let features = metrics.features([&truth]).expect("no network, no features");
        assert!(features.is_none());
        metrics.score(&prediction, &truth, None).expect("scores")
    };
    let plain = scores(Convention::Plain);
    let names: Vec<&str> = plain.iter().map(|score| score.name).collect();
    assert_eq!(names, ["psnr", "ssim", "psnr-corrected", "lpips-alex"]);
    assert_eq!(plain, scores(Convention::PixelNerf));
    assert!((plain[0].value - 14.97883237598029).abs() < 1.0e-9, "{plain:?}");
    // The published evaluation stretches the prediction; the network sees the photograph as it is.
    let published = scores(Convention::ViewAttention);
    let shown = |picture| Convention::ViewAttention.shown(picture).into_owned();
    let stretched = psnr(&shown(&prediction), &shown(&truth));
    assert_eq!(published[0].value, stretched);
    let seen = lpips(LpipsTrunk::Alex).distance(&Cpu, &shown(&prediction), &truth).expect("a distance");
    assert_eq!(published[3].value, seen);
}

#[test]
fn metrics_of_degenerate_pictures() {
    assert_eq!(mean_squared_error(&[], &[]), 0.0);
    assert_eq!(mean_squared_error(&[0, 255], &[255, 0]), 65025.0);
    assert_eq!((psnr(&[0], &[255]), psnr(&[7], &[7])), (0.0, f64::INFINITY));
    assert_eq!(ssim(&[0; 42], &[0; 42], 6, 7, 1), None);
    assert_eq!(ssim(&[0; 42], &[0; 42], 7, 6, 1), None);
    assert_eq!(ssim(&[], &[], 7, 7, 0), None);
    assert_eq!(ssim(&[9; 49], &[9; 49], 7, 7, 1), Some(1.0));
    // Other lengths are no equal pictures.
    assert!(psnr(&[1, 2, 3, 99], &[1, 2, 3]).is_nan() && psnr(&[1], &[1, 2]).is_nan());
    assert!(mean_squared_error(&[], &[0]).is_nan());
    assert_eq!([ssim(&[9; 49], &[9; 50], 7, 7, 1), ssim(&[9; 50], &[9; 50], 7, 7, 1)], [None; 2]);
    assert_eq!(ssim(&[9; 49], &[9; 49], 7, usize::MAX, 7), None);
    let flat = ssim(&[0; 49], &[255; 49], 7, 7, 1).expect("one window");
    assert!((flat - 6.5025 / (65025.0 + 6.5025)).abs() < 1.0e-12);
}
