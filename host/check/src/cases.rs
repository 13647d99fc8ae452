//! The cases, one for each kernel and with its name, and the mapping from a kernel to its case.

pub mod attend;
pub mod blend_planes;
pub mod census_cost;
pub mod compare_views;
pub mod composite;
pub mod convolutions;
pub mod depths;
pub mod depthwise;
pub mod embed_pose;
pub mod feature_image;
pub mod fine_depths;
pub mod fuse_views;
pub mod gather_latents;
pub mod group_norm;
pub mod half_latents;
pub mod half_precision;
pub mod hull_entry;
pub mod limits;
pub mod linear;
pub mod lists;
pub mod march_rays;
pub mod match_cost;
pub mod matrices;
pub mod paths;
pub mod pick_depth;
pub mod pick_disparity;
pub mod pictures;
pub mod points;
pub mod rays;
pub mod resample;
pub mod seen;
pub mod volumes;
pub mod weigh;
pub mod window;
pub mod window_cost;

use super::case::{Case, Visitor};
use viewfuse_kernels::for_each_kernel;
use viewfuse_vulkan::kernel::Kernel;

use attend::*;
use blend_planes::*;
use census_cost::*;
use compare_views::*;
use composite::*;
use convolutions::*;
use depths::*;
use depthwise::*;
use embed_pose::*;
use feature_image::*;
use fine_depths::*;
use fuse_views::*;
use gather_latents::*;
use group_norm::*;
use half_latents::*;
use half_precision::*;
use hull_entry::*;
use limits::*;
use linear::*;
use lists::*;
use march_rays::*;
use match_cost::*;
use matrices::*;
use paths::*;
use pick_depth::*;
use pick_disparity::*;
use pictures::*;
use points::*;
use rays::*;
use resample::*;
use seen::*;
use volumes::*;
use weigh::*;
use window::*;
use window_cost::*;

macro_rules! visits {
    ($({ $Kernel:ident $($rest:tt)* })+) => {
        /// Runs an operation on the case of a kernel, which is the type of the kernel's name. A kernel without a case
        /// does not compile.
        pub fn visit<V: Visitor>(kernel: Kernel, visitor: V) -> V::Output {
            match kernel {
                $(Kernel::$Kernel => visitor.visit::<$Kernel>(),)+
            }
        }

        // Nor does a case that says it is another kernel's.
        $(const _: () = assert!(<$Kernel as Case>::KERNEL as u32 == Kernel::$Kernel as u32);)+
    };
}

for_each_kernel!(visits);
