//! What the kernels are told.

use super::{Kernel, Piece};
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
use viewfuse_core::network::attend::MatrixBlock;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::network::transpose::TransposedBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::rays::CastBlock;
use viewfuse_core::sampler::{Mix, NoiseBlock};
use viewfuse_core::wanted::WantedBlock;
use viewfuse_core::weighting::WeighBlock;

impl Kernel {
    /// Bytes of its parameters, without the [`Piece`] behind them.
    pub const fn parameter_bytes(self) -> usize {
        match self {
            Kernel::Weigh => size_of::<WeighBlock>(),
            Kernel::EmbedPose | Kernel::Radiance => 0,
            // How many sources there are.
            Kernel::Attend => size_of::<u32>(),
            Kernel::CastRays => size_of::<CastBlock>(),
            Kernel::CoarseDepths => size_of::<CoarseBlock>(),
            Kernel::EmbedPoints => size_of::<EmbedBlock>(),
            Kernel::GatherLatents => size_of::<GatherBlock>(),
            Kernel::GatherVolume | Kernel::GatherHalves => size_of::<VolumeBlock>(),
            // How many numbers there are.
            Kernel::PackHalves => size_of::<u32>(),
            Kernel::Convolve => size_of::<ConvolveBlock>(),
            Kernel::ConvolveDepthwise => size_of::<DepthwiseBlock>(),
            Kernel::ConvolveTransposed => size_of::<TransposedBlock>(),
            Kernel::MaxPool => size_of::<PoolBlock>(),
            Kernel::Upsample => size_of::<UpsampleBlock>(),
            Kernel::Product => size_of::<ProductBlock>(),
            Kernel::ChannelMeans => size_of::<MeanBlock>(),
            Kernel::PartMoments | Kernel::MergeMoments | Kernel::Normalise => size_of::<NormaliseBlock>(),
            Kernel::MultiplyMatrices => size_of::<MatrixBlock>(),
            // Columns of a row.
            Kernel::SoftmaxRows => size_of::<u32>(),
            Kernel::WeighFeatures | Kernel::SumFeatures => size_of::<FeatureBlock>(),
            Kernel::DenoiserInput => size_of::<DenoiserInputBlock>(),
            // Samples on a ray.
            Kernel::PlacePoints | Kernel::WeighSamples => size_of::<u32>(),
            // How many views there are.
            Kernel::VisibleWeights => size_of::<u32>(),
            Kernel::DrawChances | Kernel::FineDepths | Kernel::MergeDepths => size_of::<FineBlock>(),
            Kernel::WantedSamples => size_of::<WantedBlock>(),
            Kernel::FuseViews => size_of::<FuseBlock>(),
            Kernel::Composite => size_of::<CompositeBlock>(),
            // Which view.
            Kernel::HullEntry => size_of::<u32>(),
            Kernel::MatchCost | Kernel::SumRow | Kernel::MeanColumn | Kernel::PickDepth => size_of::<SweepBlock>(),
            Kernel::March => size_of::<MarchBlock>(),
            Kernel::MixPictures => size_of::<Mix>(),
            Kernel::AddNoise => size_of::<NoiseBlock>(),
        }
    }

    /// Bytes of its push constants.
    pub const fn push_bytes(self) -> usize {
        self.parameter_bytes() + size_of::<Piece>()
    }
}
