//! Learned attention with 8 bits a weight: within its bound of the exact weights, whatever the poses and the
//! parameters.

use viewfuse::weighting::attention::AttentionModel;
use viewfuse::weighting::attention::quantised::{Change, change_bound, quantised, rust_source};
use viewfuse_core::Vec3;
use viewfuse_core::attention::quantised::{QuantisedAttention, SourceKeys, quantised_attention};
use viewfuse_core::attention::{FourierEmbedding, Linear, pose_features};
use viewfuse_core::fuse::{Reading, fuse_readings, fuse_views};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weights::Weights;
use viewfuse_tests::places::repository;

const VIEWS: usize = 8;
/// What the weights of the other way of computing may be off by themselves.
const ARITHMETIC: f64 = 2.0e-6;

fn learned(model: &str) -> FourierEmbedding {
    let path = repository().join(format!("host/models/{model}_attention.safetensors"));
    match AttentionModel::open(&path).expect("learned attention") {
        AttentionModel::Fourier(embedding) => embedding,
        other => panic!("of another kind: {other:?}"),
    }
}

/// Random numbers in `[-1, 1]`.
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 8_388_608.0 - 1.0
    }

    /// A camera at a distance, that looks at the origin.
    fn pose(&mut self, distance: f32) -> Pose {
        loop {
            let centre = Vec3::new(self.next(), self.next(), self.next());
            let length = centre.length();
            if let (0.3..1.0, Ok(pose)) = (length, Pose::look_at(centre * (distance / length), Vec3::ZERO, Vec3::Z)) {
                return pose;
            }
        }
    }

    fn sources(&mut self, distance: f32) -> Sources<VIEWS> {
        let poses: Vec<Pose> = (0..VIEWS).map(|_| self.pose(distance)).collect();
        Sources::new(&poses).expect("sources")
    }
}

fn layer<const I: usize, const O: usize>(layer: &Linear<I, O>, x: &[f64]) -> Vec<f64> {
    let row = |(row, bias): (&[f32; I], &f32)| {
        f64::from(*bias) + row.iter().zip(x).map(|(weight, x)| f64::from(*weight) * x).sum::<f64>()
    };
    layer.weight.iter().zip(&layer.bias).map(row).collect()
}

/// The weights in `f64`, by the definition.
fn exact(embedding: &FourierEmbedding, sources: &Sources<VIEWS>, target: &Pose) -> Vec<f64> {
    let rectified = |x: Vec<f64>| x.into_iter().map(|x| x.max(0.0)).collect::<Vec<f64>>();
    let embed = |pose: &Pose| {
        let features = pose_features(pose.centre_world(), -pose.forward_world()).map(f64::from);
        let hidden = rectified(layer(&embedding.second, &rectified(layer(&embedding.first, &features))));
        layer(&embedding.third, &hidden)
    };
    let query = embed(target);
    let logits: Vec<f64> = (0..sources.count())
        .map(|view| query.iter().zip(embed(sources.pose(view))).map(|(a, b)| a * b).sum::<f64>() / 128.0_f64.sqrt())
        .collect();
    let largest = logits.iter().fold(f64::NEG_INFINITY, |largest, logit| largest.max(*logit));
    let sum: f64 = logits.iter().map(|logit| (logit - largest).exp()).sum();
    logits.iter().map(|logit| (logit - largest).exp() / sum).collect()
}

fn difference(weights: &Weights<VIEWS>, exact: &[f64]) -> f64 {
    weights.values().iter().zip(exact).fold(0.0, |most, (weight, exact)| most.max((f64::from(*weight) - exact).abs()))
}

/// The most that weights change, and the most that they may, over many draws.
fn most(embedding: &FourierEmbedding, used: &QuantisedAttention, distance: f32, draws: usize) -> (f64, Change, usize) {
    let told = quantised(embedding);
    let (mut random, mut seen, mut broken) = (Draws(7), 0.0_f64, 0);
    let mut bound = Change { logit: 0.0, weight: 0.0 };
    for _ in 0..draws {
        let (sources, target) = (random.sources(distance), random.pose(distance));
        let change = difference(&quantised_attention(used, &sources, &target), &exact(embedding, &sources, &target));
        let allowed = change_bound(embedding, &told, &sources, &target);
        broken += usize::from(!(change <= allowed.weight + ARITHMETIC));
        seen = seen.max(change);
        bound = Change { logit: bound.logit.max(allowed.logit), weight: bound.weight.max(allowed.weight) };
    }
    (seen, bound, broken)
}

#[test]
fn weights_change_within_the_bound() {
    for model in ["pixelnerf_cars", "genvs_cars"] {
        let embedding = learned(model);
        for distance in [1.3, 4.0] {
            let (seen, bound, broken) = most(&embedding, &quantised(&embedding), distance, 60);
            println!("{model}, cameras at {distance}: weights change by {seen:.5} at most, bound {bound:.5?}");
            assert_eq!(broken, 0, "{model}: of 60 draws");
            assert!(seen > 1.0e-7, "nothing was rounded");
            assert!(seen < 0.02, "{model}: {seen}");
            assert!(bound.weight < 0.05, "{model}: the bound is of no use: {bound:?}");
        }
    }
}

/// The bound can be broken: by parameters other than those that it was computed for.
#[test]
fn other_parameters_break_the_bound() {
    let embedding = learned("pixelnerf_cars");
    let mut broken = quantised(&embedding);
    for weight in broken.second.weight.as_flattened_mut().as_flattened_mut().as_flattened_mut().as_flattened_mut() {
        *weight = weight.saturating_mul(3);
    }
    let (_, _, count) = most(&embedding, &broken, 1.3, 20);
    assert!(count > 0, "none of 20 draws");
}

#[test]
fn a_row_is_rounded_to_its_own_scale() {
    let embedding = learned("genvs_cars");
    let layer = quantised(&embedding).second;
    let scales = layer.scale.as_flattened();
    for (output, (row, scale)) in embedding.second.weight.iter().zip(scales).enumerate() {
        let block = layer.weight[output / 4].as_flattened().as_flattened();
        let levels: Vec<i8> = block.iter().map(|four| four[output % 4]).collect();
        assert_eq!(levels.iter().map(|level| level.unsigned_abs()).max(), Some(127), "the largest weight");
        for (weight, level) in row.iter().zip(levels) {
            assert!((weight - scale * f32::from(level)).abs() <= 0.5001 * scale);
        }
    }
    assert_eq!(layer.bias.as_flattened(), embedding.second.bias);
}

#[test]
fn every_further_target_has_the_weights_of_its_own_call() {
    let parameters = quantised(&learned("pixelnerf_cars"));
    let mut random = Draws(3);
    let sources = random.sources(1.3);
    let keys = SourceKeys::new(&parameters, &sources);
    for _ in 0..20 {
        let target = random.pose(1.3);
        assert_eq!(keys.weigh(&parameters, &target), quantised_attention(&parameters, &sources, &target));
    }
}

#[test]
fn weights_are_weights_whatever_the_parameters_and_the_poses() {
    let mut random = Draws(5);
    let (sources, target) = (random.sources(2.0), random.pose(2.0));
    let equal = quantised_attention(&QuantisedAttention::ZERO, &sources, &target);
    assert_eq!(equal, Weights::mean(VIEWS as u32));
    let right = quantised(&learned("pixelnerf_cars"));
    let mut huge = right;
    huge.first.scale = [[f32::MAX; 4]; 16];
    let mut undefined = right;
    undefined.second.bias[3][1] = f32::NAN;
    undefined.key.scale[5][2] = f32::INFINITY;
    for parameters in [right, huge, undefined] {
        for distance in [0.0, 1.0e-20, 1.0, 1.0e12, 1.0e29] {
            let far = Sources::<VIEWS>::from_array([random.pose(1.0 + distance); VIEWS], 5);
            let weights = quantised_attention(&parameters, &far, &random.pose(1.0 + distance));
            let sum: f32 = weights.values().iter().sum();
            assert!(weights.values().iter().all(|weight| *weight >= 0.0) && (sum - 1.0).abs() < 1.0e-6, "{weights:?}");
        }
    }
}

#[test]
fn the_source_is_rust() {
    let parameters = quantised(&learned("pixelnerf_cars"));
    let source = rust_source(&parameters, "a file\nof two lines");
    assert!(source.starts_with("// The attention weighting of a file of two lines with 8 bits"), "{}", &source[..80]);
    // Every weight is in it, in order.
    let inside = source.split_once("first: ").and_then(|(_, rest)| rest.split_once("scale: ")).expect("a layer").0;
    let numbers: Vec<i8> = inside
        .split(|character: char| !character.is_ascii_digit() && character != '-')
        .filter_map(|word| word.parse().ok())
        .collect();
    assert_eq!(numbers, parameters.first.weight.as_flattened().as_flattened().as_flattened().as_flattened());
}

fn readings_equal_numbers<T: Reading>(readings: [[T; 5]; VIEWS], weights: &Weights<VIEWS>) {
    let numbers = readings.map(|view| view.map(Reading::number));
    assert_eq!(fuse_readings(weights, &readings).map(f32::to_bits), fuse_views(weights, &numbers).map(f32::to_bits));
}

#[test]
fn readings_are_fused_as_their_numbers() {
    let weights = Weights::from_scores(&[0.3, 1.0, 0.0, 2.5, 0.1, 0.7, 0.9, 4.0], 7);
    let whole = |view: usize, channel: usize| (view * 7919 + channel * 104_729) as u32;
    let row = |view: usize| std::array::from_fn(|channel| whole(view, channel));
    let words: [[u32; 5]; VIEWS] = std::array::from_fn(row);
    readings_equal_numbers(words.map(|view| view.map(|word| word as u8)), &weights);
    readings_equal_numbers(words.map(|view| view.map(|word| word as u16)), &weights);
    readings_equal_numbers(words.map(|view| view.map(|word| word as i16)), &weights);
    let ends = [[i16::MIN, i16::MAX, 0, -1, 1]; VIEWS];
    assert_eq!(fuse_readings(&Weights::mean(1), &ends), [-32_768.0, 32_767.0, 0.0, -1.0, 1.0]);
}

/// So far away numbers overflow on the way: nothing is known of weights then, and the bound says so.
#[test]
fn where_numbers_overflow_nothing_is_promised() {
    let embedding = learned("pixelnerf_cars");
    let parameters = quantised(&embedding);
    let mut draws = Draws(5);
    for (distance, is_known) in [(1.3, true), (1.0e6, true), (1.0e21, false), (1.0e28, false)] {
        let poses: Vec<Pose> = (0..VIEWS).map(|_| draws.pose(distance)).collect();
        let sources = Sources::<VIEWS>::new(&poses).expect("sources");
        let change = change_bound(&embedding, &parameters, &sources, &draws.pose(distance));
        assert_eq!(change.logit.is_finite(), is_known, "{distance}: {change:?}");
        assert!(is_known || change.weight == 1.0, "{distance}: {change:?}");
    }
}
