//! Photographs at targets, to compare predictions with.

use super::{Album, ignored, matte, resample, to_rgb8};
use crate::{MaskChoice, Photograph, SceneError, read_picture};
use image::{GrayImage, RgbImage};
use std::borrow::Cow;
use std::path::Path;
use std::sync::PoisonError;

/// A photograph at the size of a prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    /// The picture, opaque.
    pub picture: RgbImage,
    /// 255 where the photograph shows the whole pixel and it counts, otherwise 0: the photograph's lens did not see the
    /// corners of the pinhole's picture, its ignore mask takes pixels away. `None` if it shows all of them.
    pub seen: Option<GrayImage>,
}

/// A picture file as a render would compare it: laid over the background, or without its transparency if there is none,
/// and resampled by area averages to a size, or kept in its own.
///
/// # Errors
/// [`SceneError`] if it cannot be read.
pub fn read_over(path: &Path, size: Option<[u32; 2]>, background: Option<[f32; 3]>) -> Result<RgbImage, SceneError> {
    let picture = read_picture(path)?;
    let has_alpha = picture.color().has_alpha() && background.is_some();
    let size_before = [picture.width(), picture.height()];
    if !has_alpha && size.is_none_or(|size| size == size_before) {
        return Ok(picture.into_rgb8());
    }
    let photograph = Photograph { pixels: picture.into_rgba8(), has_alpha, seen: None };
    let photograph = if has_alpha { photograph } else { photograph.without_alpha() };
    let size = size.unwrap_or(size_before);
    let over = matte::laid_over(&photograph, background.unwrap_or_default());
    Ok(to_rgb8(&resample::area_average(&over, size_before, size), size))
}

impl Album<'_> {
    /// The truth at a view, resampled to a size, rounded to 8 bits: composited over the background if there is one;
    /// otherwise the whole photograph, of which transparent pixels do not count: the nearest that do take their place,
    /// as in sources. Nothing counts of a photograph that is transparent everywhere, or whose mask shows nothing.
    ///
    /// # Errors
    /// [`SceneError`] if it cannot be read.
    pub fn truth(&self, view: usize, size: [u32; 2], background: Option<[f32; 3]>) -> Result<GroundTruth, SceneError> {
        let mut photograph = self.photograph(view)?;
        let shows_nothing = photograph.has_alpha
            && self.scene.mask_choice != MaskChoice::None
            && photograph.pixels.pixels().all(|pixel| pixel[3] == 0);
        if self.has_own_alpha(view, &photograph) {
            let ignores = match (background, self.scene.mask_choice) {
                (None, _) | (_, MaskChoice::Ignore) => true,
                (_, MaskChoice::Auto) => {
                    let alone = || ignored::is_of_ignored(vec![ignored::border_share(&photograph)]);
                    self.ignores.lock().unwrap_or_else(PoisonError::into_inner).unwrap_or_else(alone)
                }
                _ => false,
            };
            if ignores {
                photograph = Cow::Owned(ignored::filled(ignored::by_alpha(photograph.into_owned())));
            }
        } else if background.is_none() && photograph.has_alpha {
            photograph = Cow::Owned(photograph.into_owned().without_alpha());
        }
        let background = background.unwrap_or_default();
        let size_before = photograph.pixels.dimensions();
        let texels = resample::area_average(&matte::laid_over(&photograph, background), size_before.into(), size);
        let seen = match shows_nothing {
            true => Some(GrayImage::new(size[0], size[1])),
            false => photograph.seen.as_ref().map(|seen| resample::seen(seen, size.into())),
        };
        Ok(GroundTruth { picture: to_rgb8(&texels, size), seen: seen.filter(|seen| seen.as_raw().contains(&0)) })
    }
}
