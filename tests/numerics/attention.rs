//! The attention weightings, with parameters by deterministic initialisation: against the published implementations,
//! and at their ends.

use safetensors::SafeTensors;
use std::convert::Infallible;
use viewfuse::check::poses::Random;
use viewfuse::check::verify::verify;
use viewfuse::device::cpu::Cpu;
use viewfuse::job::progress::Silent;
use viewfuse::nn::initialisation;
use viewfuse::weighting::attention::AttentionModel;
use viewfuse::weighting::sources::{SourcePoses, SourceWeights};
use viewfuse_core::attention::published_cross_attention;
use viewfuse_core::pose::Pose;
use viewfuse_tests::places::data;

/// The quantities of the file that exceed their tolerance, and how many there are in all.
fn exceeded(path: &std::path::Path) -> (Vec<String>, usize) {
    let report = verify(path, &Cpu, &Silent).expect("reference values");
    let wrong = report.quantities.iter().filter(|quantity| !quantity.passes()).map(|quantity| quantity.name.clone());
    (wrong.collect(), report.quantities.len())
}

/// Five variants and an embedding, of five sources and four targets; each number counts.
#[test]
fn all_variants_agree_with_the_published_code() {
    let bytes = std::fs::read(data("attention.safetensors")).expect("the file");
    assert_eq!(exceeded(&data("attention.safetensors")), (Vec::new(), 6));
    let tensors = SafeTensors::deserialize(&bytes).expect("tensors");
    let end = bytes.as_ptr_range().end as usize;
    let folder = tempfile::tempdir().expect("a folder");
    for (name, view) in tensors.iter().filter(|(name, _)| name.starts_with("attention_weights.")) {
        // The tensor's last number, with another exponent.
        let mut changed = bytes.clone();
        let place = bytes.len() - (end - view.data().as_ptr_range().end as usize) - 1;
        changed[place] ^= 1;
        let path = folder.path().join("changed.safetensors");
        std::fs::write(&path, changed).expect("a file");
        let variant = name.replace("attention_weights.", "attention: ");
        assert_eq!(exceeded(&path), (vec![variant], 6));
    }
}

type Weigh = Box<dyn Fn(&SourcePoses, &Pose) -> SourceWeights>;

fn variants() -> [Weigh; 5] {
    let tensors = |name: &str, shape: &[usize]| Ok::<_, Infallible>(initialisation::tensor(name, shape));
    let learned = [
        AttentionModel::fourier(&mut { tensors }),
        AttentionModel::flat(&mut { tensors }),
        AttentionModel::learned_cross(&mut { tensors }),
        AttentionModel::pose_self(&mut { tensors }),
    ];
    let [fourier, flat, cross, pose_self] = learned.map(|model| {
        let Ok(model) = model;
        Box::new(move |sources: &SourcePoses, target: &Pose| model.weigh(sources, target)) as Weigh
    });
    [fourier, flat, cross, pose_self, Box::new(published_cross_attention)]
}

#[test]
fn a_single_source_has_all_the_weight_and_far_ones_stay_finite() {
    let mut random = Random::new(53);
    for (variant, weigh) in variants().iter().enumerate() {
        let mut weights = |count: usize, scale: f64| {
            let sources: Vec<Pose> = (0..count).map(|_| random.pose(scale)).collect();
            let weights = weigh(&SourcePoses::new(&sources).expect("sources"), &random.pose(scale));
            weights.values()[..count].to_vec()
        };
        assert_eq!(weights(1, 1.0), [1.0], "{variant}");
        for scale in [1.0e3, 1.0e10, 1.0e25] {
            let weights = weights(4, scale);
            let sum: f32 = weights.iter().sum();
            assert!(weights.iter().all(|w| *w >= 0.0) && (sum - 1.0).abs() < 1.0e-6, "{variant} {scale}: {weights:?}");
        }
    }
}
