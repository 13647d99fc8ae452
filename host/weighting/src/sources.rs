//! The most source views of a run, their poses and weights.

pub use viewfuse_core::sources::MAX_SOURCES;

use viewfuse_core::sources::Sources;
use viewfuse_core::weights::Weights;

/// The poses of a run's sources.
pub type SourcePoses = Sources<MAX_SOURCES>;

/// The weights of a run's sources.
pub type SourceWeights = Weights<MAX_SOURCES>;
