//! The cases, one for each kernel and with its name, and the mapping from a kernel to its case.

mod blend_planes;
mod census_cost;
mod compare_views;
mod composite;
mod confirm_disparities;
mod convolutions;
mod depths;
mod depthwise;
mod entries;
mod feature_image;
mod fine_depths;
mod front;
mod fuse_views;
mod gather_latents;
mod gaussians;
mod group_norm;
mod half_precision;
mod hull_entry;
mod limits;
mod linear;
mod lists;
mod losses;
mod march_rays;
mod match_cost;
mod matrices;
mod particles;
mod paths;
mod pick_depth;
mod pick_disparity;
mod pictures;
mod points;
mod rays;
mod resample;
mod sample_mask;
mod shown;
mod steps;
mod volumes;
mod window;
mod window_cost;

use super::agreement::Limits;
use super::bounded::Bounded;
use super::case::{Case, NegativeControl, Visitor};
use super::dispatch::*;
use super::poses::{Random, numbers, random};
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, DeviceError, LayerShape};
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;

/// Increases numbers by 1 %.
fn increase<'a>(values: impl IntoIterator<Item = &'a mut f32>) {
    values.into_iter().for_each(|value| *value *= 1.01);
}

/// Expected numbers, and so many zeros behind them that stay.
fn decided(values: impl IntoIterator<Item = Bounded>, behind: usize) -> Vec<Option<Bounded>> {
    values.into_iter().chain(std::iter::repeat_n(Bounded::ZERO, behind)).map(Some).collect()
}

/// The rows of two bands, first and count, of which one may have none; see [`Output::Continued`].
fn bands(row_count: u32) -> impl Iterator<Item = [u32; 2]> {
    let middle = row_count / 2;
    [[0, middle], [middle, row_count - middle]].into_iter().filter(|[_, count]| *count > 0)
}

/// What one of several dispatches writes a part of: an array for the first one.
fn part_of_output<T>(index: usize, count: usize) -> Output<T> {
    if index == 0 { Output::Zeros(count) } else { Output::Continued }
}

macro_rules! visits {
    ($({ $Kernel:ident $($rest:tt)* })+) => {
        /// Runs an operation on the case of a kernel, which is the type of the kernel's name. A kernel without a case
        /// does not compile.
        pub fn visit<V: Visitor>(kernel: Kernel, visitor: V) -> V::Output {
            match kernel {
                $(Kernel::$Kernel => visitor.visit::<$Kernel>(),)+
            }
        }
    };
}

for_each_kernel!(visits);
