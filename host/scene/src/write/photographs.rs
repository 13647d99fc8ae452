//! Writing the photographs of a scene.

use std::fs;

use image::RgbaImage;

use super::{Draft, WriteSceneError};
use crate::Photograph;

impl Draft<'_> {
    /// Writes the stored photograph of a view, not undistorted, as `FOLDER/NAME.EXTENSION`; returns its name in the
    /// folder. A file is copied unchanged, unless it must be turned.
    pub(super) fn stored_photograph(&self, view: usize, folder: &str) -> Result<String, WriteSceneError> {
        self.progress.check()?;
        let name = &self.scene.views[view].name;
        let written = match self.scene.upright_file(view)? {
            Some(source) => {
                let extension = source.extension().unwrap_or_default().to_string_lossy().to_lowercase();
                let file = format!("{name}.{extension}");
                let path = self.file(&format!("{folder}/{file}"))?;
                fs::copy(source, &path).map_err(|cause| WriteSceneError::Io { path, cause })?;
                file
            }
            None => self.png(folder, name, &self.scene.stored_photograph(view)?)?,
        };
        self.progress.step();
        Ok(written)
    }

    /// Copies the mask of a view to `masks/`, named after the photograph with `.png` appended; returns the name in the
    /// folder.
    pub(super) fn mask(&self, view: usize, photograph: &str) -> Result<Option<String>, WriteSceneError> {
        let Some(source) = &self.scene.views[view].mask else { return Ok(None) };
        let extension = source.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let name = format!("{photograph}.{extension}");
        let path = self.file(&format!("masks/{name}"))?;
        fs::copy(source, &path).map_err(|cause| WriteSceneError::Io { path, cause })?;
        Ok(Some(name))
    }

    /// Writes the undistorted picture of a view: the unchanged file if possible, otherwise a PNG.
    pub(super) fn pinhole_photograph(&self, view: usize, folder: &str) -> Result<String, WriteSceneError> {
        let changed = &self.scene.views[view];
        if changed.lens.is_none() && changed.mask.is_none() {
            return self.stored_photograph(view, folder);
        }
        self.progress.check()?;
        let name = self.png(folder, &changed.name, &self.scene.photograph(view)?)?;
        self.progress.step();
        Ok(name)
    }

    fn png(&self, folder: &str, name: &str, photograph: &Photograph) -> Result<String, WriteSceneError> {
        let file = format!("{name}.png");
        let path = self.file(&format!("{folder}/{file}"))?;
        let pixels: &RgbaImage = &photograph.pixels;
        let saved = match photograph.has_alpha {
            true => pixels.save(&path),
            false => image::DynamicImage::ImageRgba8(pixels.clone()).into_rgb8().save(&path),
        };
        saved.map_err(|cause| WriteSceneError::Encode { path, cause })?;
        Ok(file)
    }
}
