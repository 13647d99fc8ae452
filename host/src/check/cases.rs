//! The cases, one for each kernel, and the way from a kernel to its case.

pub mod attend;
pub mod composite;
pub mod embed_pose;
pub mod fuse_views;
pub mod hull_entry;
pub mod march;
pub mod match_cost;
pub mod pick_depth;
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
        Kernel::FuseViews => visitor.visit::<fuse_views::FuseViews>(),
        Kernel::Composite => visitor.visit::<composite::Composite>(),
        Kernel::HullEntry => visitor.visit::<hull_entry::HullEntry>(),
        Kernel::MatchCost => visitor.visit::<match_cost::MatchCost>(),
        Kernel::SumRow => visitor.visit::<window::SumRow>(),
        Kernel::MeanColumn => visitor.visit::<window::MeanColumn>(),
        Kernel::PickDepth => visitor.visit::<pick_depth::PickDepth>(),
        Kernel::March => visitor.visit::<march::March>(),
        // Until their cases are written.
        _ => unreachable!(),
    }
}
