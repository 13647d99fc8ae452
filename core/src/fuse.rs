//! Fusion of latents: weighted sums over the source views.
//!
//! Sums run in view order. Source: PixelNeRF's and GeNVS's combine step, with the mean replaced by [`Weights`].

use crate::fetch::Fetch;
use crate::weights::Weights;
use bytemuck::{Pod, Zeroable};

/// Weighted sum of the latents of all views: `latents[view][channel]` to `[channel]`. A view that sees nothing is
/// expected to hold zeros, which shrinks the result (the published behaviour).
#[inline]
pub fn fuse_views<const S: usize, const C: usize>(weights: &Weights<S>, latents: &[[f32; C]; S]) -> [f32; C] {
    let mut sum = [0.0; C];
    let mut view = 0;
    while view < weights.count() {
        add_scaled(&mut sum, &latents[view as usize], weights.get(view));
        view += 1;
    }
    sum
}

/// What a sensor gives as a whole number; exact as an `f32`.
pub trait Reading: Copy {
    /// The number.
    fn number(self) -> f32;
}

macro_rules! readings {
    ($($whole:ty),*) => {
        $(impl Reading for $whole {
            #[inline(always)]
            fn number(self) -> f32 {
                self as f32
            }
        })*
    };
}

readings!(u8, i8, u16, i16);

/// As [`fuse_views`] for readings that are whole numbers: `readings[view][channel]` to `[channel]`, with the same bits
/// as for these numbers as `f32`, and without a copy of them.
#[inline]
pub fn fuse_readings<T: Reading, const S: usize, const C: usize>(
    weights: &Weights<S>,
    readings: &[[T; C]; S],
) -> [f32; C] {
    let mut sum = [0.0; C];
    let mut view = 0;
    while view < weights.count() {
        let (share, reading) = (weights.get(view), &readings[view as usize]);
        let mut channel = 0;
        while channel < C {
            sum[channel] += share * reading[channel].number();
            channel += 1;
        }
        view += 1;
    }
    sum
}

/// A dispatch of [`fuse_element`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FuseBlock {
    /// How many views there are.
    pub view_count: u32,
    /// From an element to the next view's.
    pub stride: u32,
    /// Elements that share their weights: the channels of a point. 0 counts as 1.
    pub channel_count: u32,
    /// From a point's weights to the next point's; 0 if all points have the same.
    pub weight_stride: u32,
}

impl FuseBlock {
    /// Where the weights of an element's views start.
    #[inline]
    pub fn first_weight(&self, element: usize) -> usize {
        element / self.channel_count.max(1) as usize * self.weight_stride as usize
    }
}

/// One channel of [`fuse_views`] from flat buffers that start at the element: the weighted sum of the elements
/// `latents[view * stride]` over the views, with the weights `weights[view]` (see [`FuseBlock::first_weight`]).
#[inline]
pub fn fuse_element(
    weights: &(impl Fetch<f32> + ?Sized),
    latents: &(impl Fetch<f32> + ?Sized),
    block: &FuseBlock,
) -> f32 {
    let mut sum = 0.0;
    let mut view = 0;
    while view < block.view_count as usize {
        sum += weights.fetch(view) * latents.fetch(view * block.stride as usize);
        view += 1;
    }
    sum
}

/// A sum over views that is renormalised over those that see the point, taken one view at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VisibleFusion<const C: usize> {
    sum: [f32; C],
    seen_weight: f32,
}

impl<const C: usize> VisibleFusion<C> {
    /// No views yet.
    pub const EMPTY: VisibleFusion<C> = VisibleFusion { sum: [0.0; C], seen_weight: 0.0 };

    /// Adds a view's latent with `weight * visibility` as its share; both at least 0.
    #[inline]
    pub fn add(&mut self, latent: &[f32; C], share: f32) {
        add_scaled(&mut self.sum, latent, share);
        self.seen_weight += share;
    }

    /// Total share of the views that see the point.
    #[inline]
    pub fn seen_weight(&self) -> f32 {
        self.seen_weight
    }

    /// The weighted mean over the views that see the point; `otherwise` if none does.
    #[inline]
    pub fn mean_or(&self, otherwise: [f32; C]) -> [f32; C] {
        // Below this a quotient of two subnormal-ridden sums means nothing.
        if !(self.seen_weight > 1.0e-30) {
            return otherwise;
        }
        let mut mean = self.sum;
        let mut channel = 0;
        while channel < C {
            mean[channel] /= self.seen_weight;
            channel += 1;
        }
        mean
    }
}

/// Weighted mean of the latents over the views that see the point (IBRNet's rule): `visibility[view]` in `[0, 1]`
/// multiplies the view's weight before renormalising. If no view sees the point, the result is `otherwise`.
#[inline]
pub fn fuse_visible<const S: usize, const C: usize>(
    weights: &Weights<S>,
    visibility: &[f32; S],
    latents: &[[f32; C]; S],
    otherwise: [f32; C],
) -> [f32; C] {
    let mut fusion = VisibleFusion::EMPTY;
    let mut view = 0;
    while view < weights.count() {
        fusion.add(&latents[view as usize], weights.get(view) * visibility[view as usize]);
        view += 1;
    }
    fusion.mean_or(otherwise)
}

#[inline]
fn add_scaled<const C: usize>(sum: &mut [f32; C], latent: &[f32; C], share: f32) {
    let mut channel = 0;
    while channel < C {
        sum[channel] += share * latent[channel];
        channel += 1;
    }
}
