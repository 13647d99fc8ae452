//! The `attention_*` tensors of `genvs_srn.safetensors`: weights of the attention weighters, with deterministic
//! initialisation.

use super::file::File;
use super::weighting::pose;
use super::{Measure, Quantity, Report, VerifyError};
use safetensors::tensor::{Dtype, TensorView};
use std::convert::Infallible;
use viewfuse_core::attention::{EMBEDDING, PoseEmbedding, published_cross_attention};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_nn::initialisation;
use viewfuse_weighting::attention::AttentionModel;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

const TOLERANCE: f64 = 1.0e-5;
const EMBEDDING_TENSOR: &str = "attention_embedding.paper_fourier";

/// Compares the file's quantities.
pub(super) fn verify(file: &File<'_>, report: &mut Report) -> Result<(), VerifyError> {
    if !file.has("attention_src") || !file.has("attention_tgt") {
        return Ok(());
    }
    let content = |name: &str, message: String| file.wrong(&format!("tensor '{name}'"), message);
    let has = |name: &str, count: usize| {
        let numbers =
            |view: &TensorView<'_>| view.dtype() == Dtype::F32 && view.shape().iter().product::<usize>() == count;
        file.tensors.tensor(name).is_ok_and(|view| numbers(&view))
    };
    let poses = |name: &str| -> Result<Vec<Pose>, VerifyError> {
        let values = file.floats(name).map_err(|_| content(name, "must be F32 [pose, 4, 4]".into()))?;
        values.chunks_exact(16).map(|matrix| pose(matrix).map_err(|message| content(name, message))).collect()
    };
    let source_poses = poses("attention_src")?;
    let sources =
        Sources::<MAX_SOURCES>::new(&source_poses).map_err(|error| content("attention_src", error.to_string()))?;
    let targets = poses("attention_tgt")?;
    if has(EMBEDDING_TENSOR, EMBEDDING * targets.len()) {
        let reference = file.floats(EMBEDDING_TENSOR)?;
        let Ok(model) = AttentionModel::fourier(&mut prefixed(""));
        if let AttentionModel::Fourier(embedding) = model {
            let mut quantity = Quantity::new("attention: embedding of paper_fourier", Measure::Absolute, TOLERANCE);
            for (index, (target, expected)) in targets.iter().zip(reference.chunks_exact(EMBEDDING)).enumerate() {
                let ours = embedding.embed(target).map(f64::from);
                quantity.compare_all(ours, expected.iter().copied().map(f64::from), &format!("target {index}"));
            }
            report.quantities.push(quantity);
        }
    }
    for (variant, model) in variants() {
        let name = format!("attention_weights.{variant}");
        if !file.has(&name) {
            continue;
        }
        if !has(&name, source_poses.len() * targets.len()) {
            return Err(content(&name, format!("must be F32 [{}, {}]", source_poses.len(), targets.len())));
        }
        let reference = file.floats(&name)?;
        let weigh = |target: &Pose| -> SourceWeights {
            match &model {
                Some(model) => model.weigh(&sources, target),
                None => published_cross_attention(&sources, target),
            }
        };
        let mut quantity = Quantity::new(format!("attention: {variant}"), Measure::Absolute, TOLERANCE);
        for (column, target) in targets.iter().enumerate() {
            let weights = weigh(target);
            // The file is [source][target].
            for row in 0..source_poses.len() {
                let expected = f64::from(reference[row * targets.len() + column]);
                let place = || format!("source {row}, target {column}");
                quantity.compare(f64::from(weights.get(row as u32)), expected, place);
            }
        }
        report.quantities.push(quantity);
    }
    Ok(())
}

/// Parameters by deterministic initialisation, their names behind a prefix.
fn prefixed(prefix: &'static str) -> impl FnMut(&str, &[usize]) -> Result<Vec<f32>, Infallible> {
    move |name, shape| Ok(initialisation::tensor(&format!("{prefix}{name}"), shape))
}

/// Names of the variants in the file, with their parameters; the published cross attention has none.
fn variants() -> [(&'static str, Option<AttentionModel>); 5] {
    let Ok(fourier) = AttentionModel::fourier(&mut prefixed(""));
    let Ok(flat) = AttentionModel::flat(&mut prefixed(""));
    let Ok(learned) = AttentionModel::learned_cross(&mut prefixed("learned_cross_attention."));
    let Ok(pose_self) = AttentionModel::pose_self(&mut prefixed("relative_pose_self_attention."));
    [
        ("paper_fourier", Some(fourier)),
        ("paper_flat", Some(flat)),
        ("cross_attention", None),
        ("learned_cross_attention", Some(learned)),
        ("relative_pose_self_attention", Some(pose_self)),
    ]
}
