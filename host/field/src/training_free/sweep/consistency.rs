//! Geometric consistency of the sources' disparities ([`viewfuse_kernels::plane_sweep::consistency`]).

use super::matching::swept;
use super::views::Views;
use crate::FieldError;
use viewfuse_device::Device;
use viewfuse_kernels::rows::{ConfirmBlock, SweptView};

/// Most other views that may confirm a disparity, those of greatest weight, and the fewest that are needed: two views
/// agree by chance.
const OTHERS: usize = 2;

impl<D: Device> Views<'_, D> {
    /// `maps[view][row][column]` with the confidences of these views by what they say of one another: of a view with
    /// at least [`OTHERS`] others, `consistency_share` of each is its geometric consistency. Of other views it is
    /// zeros. On any device.
    pub(super) fn confirmed<E: Device>(
        &self,
        device: &E,
        views: &[usize],
        maps: &E::Buffer<[f32; 2]>,
    ) -> Result<E::Buffer<[f32; 2]>, FieldError> {
        let (share, steps) = (self.settings.consistency_share, &self.maps.steps);
        let cameras = &self.matched.images.cameras;
        let is_found = |view: usize| views.contains(&view) && steps[view] > 0.0;
        let mut others: Vec<SweptView> = Vec::new();
        let mut blocks = Vec::with_capacity(views.len());
        for &view in views.iter().filter(|view| is_found(**view)) {
            let mut of_view = self.others(view);
            of_view.retain(|(other, weight)| *weight > 0.0 && is_found(*other));
            of_view.truncate(if share > 0.0 { OTHERS } else { 0 });
            let (camera, first_other) = (cameras[view], others.len() as u32);
            let other_count = if of_view.len() < OTHERS { 0 } else { OTHERS as u32 };
            blocks.push(ConfirmBlock { camera, share, first_other, other_count, padding: 0 });
            others.extend(swept(cameras, cameras, &of_view, Some(steps), None));
        }
        // No device has empty buffers.
        others.resize(others.len().max(1), SweptView::default());
        let others = device.table(&others)?;
        let mut confirmed = device.zeros(self.matched.texels.len())?;
        for block in &blocks {
            device.confirm_disparities(block, &others, maps, &mut confirmed)?;
        }
        Ok(confirmed)
    }
}
