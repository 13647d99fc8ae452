//! Weightings that are ready for use: by formula, by attention, or implemented by another crate.

use crate::attention::{AttentionError, AttentionModel};
use crate::sources::{SourcePoses, SourceWeights};
use crate::spec::{Kind, WeightingError, WeightingSpec};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viewfuse_core::attention::published_cross_attention;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{Scheme, weigh};

/// Weights of the sources for a target. A crate outside implements this for a weighting of its own and passes it to
/// [`Weighting::custom`].
pub trait Weigh: Send + Sync {
    /// Its name in tables and records.
    fn name(&self) -> String;

    /// The weights of the sources for a target, in the order of the sources: as many as there are sources.
    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights;
}

/// A weighting that is ready for use.
#[derive(Clone)]
pub struct Weighting {
    name: String,
    weighs: Weighs,
}

#[derive(Clone)]
enum Weighs {
    Formula(Scheme),
    CrossAttention,
    Attention { model: Arc<AttentionModel>, file: PathBuf },
    Custom(Arc<dyn Weigh>),
}

impl Weighting {
    /// The weighting that a text names: [`WeightingSpec`] parsed and opened.
    ///
    /// # Errors
    /// [`WeightingError`].
    pub fn open(text: &str) -> Result<Weighting, WeightingError> {
        Ok(text.parse::<WeightingSpec>()?.open()?)
    }

    /// A weighting of another crate. If it returns weights for another number of sources, which it must not, they are
    /// truncated or filled with 0 and normalised to the sum 1.
    pub fn custom(weigh: impl Weigh + 'static) -> Weighting {
        Weighting { name: weigh.name(), weighs: Weighs::Custom(Arc::new(weigh)) }
    }

    /// The default scheme: error weighting with `alpha = 1`, the best of the paper's formulas.
    pub fn default_scheme() -> Weighting {
        Weighting::from(Scheme::ERROR)
    }

    /// The file of its parameters, if any.
    pub fn file(&self) -> Option<&Path> {
        match &self.weighs {
            Weighs::Attention { file, .. } => Some(file),
            Weighs::Formula(_) | Weighs::CrossAttention | Weighs::Custom(_) => None,
        }
    }

    /// The weights of the sources for a target, in the order of the sources.
    pub fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        match &self.weighs {
            Weighs::Formula(scheme) => weigh(*scheme, sources, target),
            Weighs::CrossAttention => published_cross_attention(sources, target),
            Weighs::Attention { model, .. } => model.weigh(sources, target),
            Weighs::Custom(weigh) => {
                let weights = weigh.weigh(sources, target);
                match weights.count() == sources.count() {
                    true => weights,
                    false => SourceWeights::from_scores(weights.values(), sources.count()),
                }
            }
        }
    }
}

impl WeightingSpec {
    /// Opens the weighting: learned attention is read from its file.
    ///
    /// # Errors
    /// [`AttentionError`], always with the file.
    pub fn open(&self) -> Result<Weighting, AttentionError> {
        let weighs = match &self.kind {
            Kind::Formula(scheme) => Weighs::Formula(*scheme),
            Kind::CrossAttention => Weighs::CrossAttention,
            Kind::Attention(file) => {
                Weighs::Attention { model: Arc::new(AttentionModel::open(file)?), file: file.clone() }
            }
        };
        Ok(Weighting { name: self.text.clone(), weighs })
    }
}

impl Weigh for Weighting {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        Weighting::weigh(self, sources, target)
    }
}

impl From<Scheme> for Weighting {
    fn from(scheme: Scheme) -> Weighting {
        Weighting { name: scheme.to_string(), weighs: Weighs::Formula(scheme) }
    }
}

impl fmt::Display for Weighting {
    /// Its name in tables and records: the given text, or the name of a custom weighting.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl fmt::Debug for Weighting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Weighting").field(&self.name).finish()
    }
}
