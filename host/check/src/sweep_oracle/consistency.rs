//! A source pixel's confidence by what other sources say of it.

use super::{BEHIND, project_plane};
use crate::bounded::Bounded;
use crate::camera_oracle::cell;
use crate::hull_oracle::bell;
use viewfuse_kernels::plane_sweep::consistency::{ConfirmBlock, ONE_CONFIRMS, WIDTH};
use viewfuse_kernels::plane_sweep::frustum::SweptView;

/// Disparity and confidence of a pixel.
pub fn confirmed(
    block: &ConfirmBlock,
    others: &[SweptView],
    disparities: &[[f32; 2]],
    pixel: u32,
) -> [Option<Bounded>; 2] {
    let width = block.camera.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let [disparity, confidence] = disparities[(block.camera.first_texel + pixel) as usize].map(Bounded::from);
    let doubt = |other: &SweptView| {
        let seen = project_plane(&block.camera, &other.camera, at, disparity);
        if !seen.in_image? {
            return Some(Bounded::ONE);
        }
        let (column, row) = (cell(seen.x, other.camera.width)?, cell(seen.y, other.camera.height)?);
        let texel = other.first_disparity as usize + row * other.map_width as usize + column;
        let surface = Bounded::from(disparities[texel][0]);
        let behind = (surface - disparity / seen.depth_ratio) / (Bounded::from(WIDTH) * other.disparity_step.into());
        Some(Bounded::ONE - Bounded::from(ONE_CONFIRMS) * bell(Bounded::from(BEHIND) * behind))
    };
    let asked = &others[block.first_other as usize..][..block.other_count as usize];
    if asked.is_empty() {
        return [Some(disparity), Some(confidence)];
    }
    let all = asked.iter().try_fold(Bounded::ONE, |all, other| Some(all * doubt(other)?));
    let of_doubt = |all: Bounded| confidence + Bounded::from(block.share) * ((Bounded::ONE - all) - confidence);
    [Some(disparity), all.map(of_doubt)]
}
