//! The most source views of a run, their poses and weights.

use viewfuse_core::sources::Sources;
use viewfuse_core::weights::Weights;

/// The most source views of a run: the capacity of every fixed-size array of views on the host.
pub const MAX_SOURCES: usize = 256;

/// The poses of a run's sources.
pub type SourcePoses = Sources<MAX_SOURCES>;

/// The weights of a run's sources.
pub type SourceWeights = Weights<MAX_SOURCES>;
