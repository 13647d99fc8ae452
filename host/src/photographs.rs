//! Photographs as a field needs them: at working size, premultiplied, with the background taken out.

mod matte;
mod resample;

pub use matte::BackgroundChoice;

use crate::scene::{Photograph, Scene, SceneError};
use image::RgbImage;
use rayon::prelude::*;
use viewfuse_core::camera::{Camera, PinholeError};

/// Why photographs could not be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PhotographsError {
    /// A photograph could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The working size is unusable.
    #[error("view '{view}' cannot be resampled to {width}x{height}: {error}")]
    Size {
        /// The view.
        view: String,
        /// Wanted width.
        width: u32,
        /// Wanted height.
        height: u32,
        /// What is wrong with it.
        error: PinholeError,
    },
    /// The background covers the whole photograph, or nothing of it.
    #[error(
        "{path}: shows no object before the background ({colour}); give the background with --background, or \
         photographs with an alpha channel"
    )]
    NoSilhouette {
        /// The photograph.
        path: String,
        /// The background colour that was assumed.
        colour: String,
    },
}

/// One source at working size.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceImage {
    /// The camera of the resampled image.
    pub camera: Camera,
    /// `[row][column]`: premultiplied red, green, blue and alpha in `[0, 1]`.
    pub texels: Vec<[f32; 4]>,
}

/// All sources of a run at working size.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceImages {
    /// In the order of the sources.
    pub images: Vec<SourceImage>,
    /// What is behind the object, red green blue in `[0, 1]`.
    pub background: [f32; 3],
}

/// Decoded photographs of a scene, each read once.
pub struct Album<'a> {
    scene: &'a Scene,
    photographs: Vec<Option<Photograph>>,
}

impl<'a> Album<'a> {
    /// Reads the photographs of these views, all cores at once.
    ///
    /// # Errors
    /// [`SceneError`] of the first view that can not be read.
    pub fn open(scene: &'a Scene, views: impl IntoIterator<Item = usize>) -> Result<Album<'a>, SceneError> {
        let mut wanted: Vec<usize> = views.into_iter().collect();
        wanted.sort_unstable();
        wanted.dedup();
        let read: Vec<(usize, Photograph)> = wanted
            .into_par_iter()
            .map(|view| scene.photograph(view).map(|photograph| (view, photograph)))
            .collect::<Result<_, _>>()?;
        let mut photographs = vec![None; scene.views.len()];
        for (view, photograph) in read {
            photographs[view] = Some(photograph);
        }
        Ok(Album { scene, photographs })
    }

    /// Photograph of a view that was opened.
    fn photograph(&self, view: usize) -> Result<std::borrow::Cow<'_, Photograph>, SceneError> {
        match &self.photographs[view] {
            Some(photograph) => Ok(std::borrow::Cow::Borrowed(photograph)),
            None => Ok(std::borrow::Cow::Owned(self.scene.photograph(view)?)),
        }
    }

    /// The sources at `scale` times their own size, the background taken out as `choice` says.
    ///
    /// # Errors
    /// [`PhotographsError`].
    pub fn sources(
        &self,
        views: &[usize],
        scale: f32,
        choice: BackgroundChoice,
    ) -> Result<SourceImages, PhotographsError> {
        let photographs: Vec<_> = views.iter().map(|&view| self.photograph(view)).collect::<Result<_, _>>()?;
        let backdrop = matte::Backdrop::of(photographs.iter().map(AsRef::as_ref), choice);
        let images = views
            .par_iter()
            .zip(&photographs)
            .map(|(&view, photograph)| {
                let View { name, camera, image } = &self.scene.views[view];
                let (width, height) = scaled_size(camera, scale);
                let pinhole = camera.pinhole.resized(width, height).map_err(|error| PhotographsError::Size {
                    view: name.clone(),
                    width,
                    height,
                    error,
                })?;
                let premultiplied = matte::premultiplied(photograph, &backdrop);
                let opaque = premultiplied.iter().filter(|texel| texel[3] > 0.5).count();
                if opaque == 0 || (opaque == premultiplied.len() && !photograph.has_alpha) {
                    let path = image.as_ref().map_or_else(|| name.clone(), |path| path.display().to_string());
                    return Err(PhotographsError::NoSilhouette { path, colour: backdrop.to_string() });
                }
                let (own_width, own_height) = photograph.pixels.dimensions();
                let texels = resample::area_average(&premultiplied, [own_width, own_height], [width, height]);
                Ok(SourceImage { camera: Camera { pinhole, ..*camera }, texels })
            })
            .collect::<Result<_, PhotographsError>>()?;
        Ok(SourceImages { images, background: backdrop.colour() })
    }

    /// The truth at a view, resampled to a size and laid over a background, rounded to 8 bits.
    ///
    /// # Errors
    /// [`SceneError`] if it can not be read.
    pub fn truth(&self, view: usize, size: [u32; 2], background: [f32; 3]) -> Result<RgbImage, SceneError> {
        let photograph = self.photograph(view)?;
        let own_size = photograph.pixels.dimensions();
        let texels = resample::area_average(&matte::laid_over(&photograph, background), own_size.into(), size);
        Ok(to_rgb8(&texels, size))
    }
}

use crate::scene::View;

/// Size of a view's image at a scale: at least one pixel on a side.
pub fn scaled_size(camera: &Camera, scale: f32) -> (u32, u32) {
    let scaled = |side: u32| ((side as f32 * scale).round() as u32).max(1);
    (scaled(camera.pinhole.width()), scaled(camera.pinhole.height()))
}

/// Values in `[0, 1]` rounded to the nearest of 256 levels; the fourth channel is dropped. NaN becomes 0.
pub fn to_rgb8(texels: &[[f32; 4]], size: [u32; 2]) -> RgbImage {
    RgbImage::from_fn(size[0], size[1], |x, y| {
        let texel = texels[(y * size[0] + x) as usize];
        image::Rgb([texel[0], texel[1], texel[2]].map(|value| (value * 255.0 + 0.5) as u8))
    })
}
