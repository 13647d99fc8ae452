//! Geometric consistency: a view's disparity counts where other views have their surface at the same point.
//!
//! The plane sweep's own confidence says how much better a plane matches than others, which textureless and repeated
//! surfaces and what only one neighbour sees get wrong. Published multi-view stereo asks for consistency by the error
//! of reprojection (Schönberger et al., "Pixelwise view selection", 2016); a bell in planes of the views' own sweeps is
//! as good (`host/results/front_to_back.md`).

use super::evidence::planes_behind;
use super::frustum::{SweptView, Track};
use crate::visual_hull::fade;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;

/// Consistency of a disparity that one view confirms exactly; each further one takes the same share of the rest.
pub const ONE_CONFIRMS: f32 = 0.65;
/// Width of the bell of what confirms, in planes of the confirming view's sweep.
pub const WIDTH: f32 = 2.0;

/// A view and the others that may confirm it, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ConfirmBlock {
    /// The view, with the offset of its map.
    pub camera: CameraBlock,
    /// Share of the confidence that is the consistency, in `[0, 1]`.
    pub share: f32,
    /// Number of the first other view.
    pub first_other: u32,
    /// How many others there are; without any, confidences stay as they are.
    pub other_count: u32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<ConfirmBlock>() == 96);

/// Disparity and confidence of a pixel of a view, counted row by row, by what other views say of it: the same
/// disparity, and a confidence of which a share is the geometric consistency in `[0, 1]`. That is 1 less the product,
/// over the others in their order, of 1 less [`ONE_CONFIRMS`] times a bell around the other's surface; a view that does
/// not have the point in its image confirms nothing. `disparities[view's map][row][column]` are disparity and
/// confidence; of the others' only disparities are read. Maps have the size of their images.
#[inline(always)]
pub fn confirmed(
    block: &ConfirmBlock,
    others: &(impl Fetch<SweptView> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    pixel: u32,
) -> [f32; 2] {
    let camera = &block.camera;
    let [disparity, confidence] = disparities.fetch((camera.first_texel + pixel) as usize);
    if block.other_count == 0 {
        return [disparity, confidence];
    }
    let (x, y) = ((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5);
    let mut doubt = 1.0;
    let mut number = 0;
    while number < block.other_count {
        let other = &others.fetch((block.first_other + number) as usize);
        let seen = Track::new(camera, &other.camera, x, y).at(disparity);
        if seen.in_image {
            let [surface, _] = disparities.fetch(other.map_texel(seen.x, seen.y));
            let density = 1.0 / (WIDTH * other.disparity_step);
            let behind = planes_behind(surface, disparity * seen.disparity_ratio, density);
            doubt *= 1.0 - ONE_CONFIRMS * fade(0.707_106_77 * behind);
        }
        number += 1;
    }
    [disparity, confidence + block.share * ((1.0 - doubt) - confidence)]
}
