//! Geometric consistency: a source's disparity counts where other sources have their surface at the same point.
//!
//! The plane sweep's own confidence says how much better a plane matches than others, which textureless and repeated
//! surfaces and what only one neighbour sees get wrong. Published multi-view stereo asks for consistency by the error
//! of reprojection (Schönberger et al., "Pixelwise view selection", 2016); a bell in planes of the views' own sweeps is
//! as good (`host/results/front_to_back.md`).

use super::views::Views;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_device::parallel::for_each;
use viewfuse_kernels::plane_sweep::evidence::planes_behind;
use viewfuse_kernels::plane_sweep::frustum::Track;
use viewfuse_kernels::visual_hull::fade;

/// Most other views that may confirm a disparity, those of greatest weight, and the fewest that are needed: two views
/// agree by chance.
const OTHERS: usize = 2;
/// Consistency of a disparity that one view confirms exactly; each further one takes the same share of the rest.
const ONE_CONFIRMS: f32 = 0.65;
/// Width of the bell of what confirms, in planes of the confirming view's sweep.
const WIDTH: f32 = 2.0;
/// Pixels that are enough work for a thread.
const MIN_PIXELS: usize = 512;

impl<D: Device> Views<'_, D> {
    /// `maps[view][row][column]` with the confidences of these views by what they say of one another: of a view with
    /// at least [`OTHERS`] others, `consistency_share` of each is its geometric consistency.
    pub(super) fn confirmed(&self, views: &[usize], maps: &[[f32; 2]]) -> Vec<[f32; 2]> {
        let share = self.settings.consistency_share;
        let mut confirmed = maps.to_vec();
        let is_found = |view: usize| views.contains(&view) && self.maps.steps[view] > 0.0;
        for &view in views.iter().filter(|view| share > 0.0 && is_found(**view)) {
            let others = self.others(view).into_iter().filter(|(other, weight)| *weight > 0.0 && is_found(*other));
            let others: Vec<(CameraBlock, f32)> = others
                .take(OTHERS)
                .map(|(other, _)| (self.matched.images.cameras[other], self.maps.steps[other]))
                .collect();
            if others.len() < OTHERS {
                continue;
            }
            let camera = self.matched.images.cameras[view];
            let (first, count) = (camera.first_texel as usize, (camera.width * camera.height) as usize);
            for_each(&mut confirmed[first..first + count], MIN_PIXELS, |pixel, [disparity, confidence]| {
                let consistency = consistency(&camera, pixel as u32, *disparity, &others, maps);
                *confidence += share * (consistency - *confidence);
            });
        }
        confirmed
    }
}

/// Geometric consistency in `[0, 1]` of a pixel's disparity: 1 less the product, over the others, of 1 less
/// [`ONE_CONFIRMS`] times a bell around the other's surface; a view that does not have the point in its image confirms
/// nothing. `others` are cameras and the steps of their planes; only disparities are read from `maps[texel]`. `pixel`
/// is counted row by row.
fn consistency(
    camera: &CameraBlock,
    pixel: u32,
    disparity: f32,
    others: &[(CameraBlock, f32)],
    maps: &[[f32; 2]],
) -> f32 {
    let (x, y) = ((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5);
    let doubt = others.iter().map(|(other, step)| {
        let seen = Track::new(camera, other, x, y).at(disparity);
        if !seen.in_image {
            return 1.0;
        }
        let [surface, _] = maps[other.texel_at(seen.x, seen.y)];
        let behind = planes_behind(surface, disparity * seen.disparity_ratio, 1.0 / (WIDTH * step));
        1.0 - ONE_CONFIRMS * fade(std::f32::consts::FRAC_1_SQRT_2 * behind)
    });
    1.0 - doubt.product::<f32>()
}
