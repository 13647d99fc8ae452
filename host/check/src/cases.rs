//! The cases, one for each kernel, and the way from a kernel to its case.

pub mod attend;
pub mod attend_pixels;
pub mod composite;
pub mod convolutions;
pub mod depths;
pub mod depthwise;
pub mod embed_pose;
pub mod feature_image;
pub mod fine_depths;
pub mod fuse_views;
pub mod gather_latents;
pub mod halves;
pub mod hull_entry;
pub mod layers;
pub mod march;
pub mod match_cost;
pub mod normalise;
pub mod pick_depth;
pub mod pictures;
pub mod points;
pub mod rays;
pub mod resample;
pub mod seen;
pub mod volumes;
pub mod weigh;
pub mod window;

use super::case::Visitor;
use viewfuse_vulkan::kernel::Kernel;

/// Does something with the case of a kernel. There is no `_` here: a kernel without a case does not compile.
pub fn visit<V: Visitor>(kernel: Kernel, visitor: V) -> V::Output {
    match kernel {
        Kernel::Weigh => visitor.visit::<weigh::Weigh>(),
        Kernel::EmbedPose => visitor.visit::<embed_pose::EmbedPose>(),
        Kernel::Attend => visitor.visit::<attend::Attend>(),
        Kernel::CastRays => visitor.visit::<rays::CastRays>(),
        Kernel::CoarseDepths => visitor.visit::<depths::CoarseDepths>(),
        Kernel::PlacePoints => visitor.visit::<rays::PlacePoints>(),
        Kernel::EmbedPoints => visitor.visit::<points::EmbedPoints>(),
        Kernel::VisibleWeights => visitor.visit::<points::VisibleWeights>(),
        Kernel::GatherLatents => visitor.visit::<gather_latents::GatherLatents>(),
        Kernel::GatherVolume => visitor.visit::<volumes::GatherVolume>(),
        Kernel::PackHalves => visitor.visit::<halves::PackHalves>(),
        Kernel::GatherHalves => visitor.visit::<halves::GatherHalves>(),
        Kernel::Convolve => visitor.visit::<convolutions::Convolve>(),
        Kernel::ConvolveDepthwise => visitor.visit::<depthwise::ConvolveDepthwise>(),
        Kernel::ConvolveTransposed => visitor.visit::<convolutions::ConvolveTransposed>(),
        Kernel::MaxPool => visitor.visit::<resample::MaxPool>(),
        Kernel::Upsample => visitor.visit::<resample::Upsample>(),
        Kernel::Product => visitor.visit::<layers::Product>(),
        Kernel::ChannelMeans => visitor.visit::<normalise::ChannelMeans>(),
        Kernel::PartMoments => visitor.visit::<normalise::PartMoments>(),
        Kernel::MergeMoments => visitor.visit::<normalise::MergeMoments>(),
        Kernel::Normalise => visitor.visit::<normalise::Normalise>(),
        Kernel::MultiplyMatrices => visitor.visit::<attend_pixels::MultiplyMatrices>(),
        Kernel::SoftmaxRows => visitor.visit::<attend_pixels::SoftmaxRows>(),
        Kernel::FuseViews => visitor.visit::<fuse_views::FuseViews>(),
        Kernel::Radiance => visitor.visit::<points::Radiance>(),
        Kernel::Composite => visitor.visit::<composite::Composite>(),
        Kernel::WeighSamples => visitor.visit::<seen::WeighSamples>(),
        Kernel::DrawChances => visitor.visit::<depths::DrawChances>(),
        Kernel::FineDepths => visitor.visit::<fine_depths::FineDepths>(),
        Kernel::MergeDepths => visitor.visit::<fine_depths::MergeDepths>(),
        Kernel::WantedSamples => visitor.visit::<seen::WantedSamples>(),
        Kernel::WeighFeatures => visitor.visit::<feature_image::WeighFeatures>(),
        Kernel::SumFeatures => visitor.visit::<feature_image::SumFeatures>(),
        Kernel::DenoiserInput => visitor.visit::<feature_image::DenoiserInput>(),
        Kernel::HullEntry => visitor.visit::<hull_entry::HullEntry>(),
        Kernel::MatchCost => visitor.visit::<match_cost::MatchCost>(),
        Kernel::SumRow => visitor.visit::<window::SumRow>(),
        Kernel::MeanColumn => visitor.visit::<window::MeanColumn>(),
        Kernel::PickDepth => visitor.visit::<pick_depth::PickDepth>(),
        Kernel::March => visitor.visit::<march::March>(),
        Kernel::MixPictures => visitor.visit::<pictures::MixPictures>(),
        Kernel::AddNoise => visitor.visit::<pictures::AddNoise>(),
    }
}
