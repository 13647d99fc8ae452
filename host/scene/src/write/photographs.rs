//! Writing the photographs of a scene and their masks.

use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, GrayImage};

use super::{Draft, WriteSceneError};
use crate::scene::files::has_extension;
use crate::{Photograph, encode_png, picture_size, read_picture};

/// Extensions of files that have no alpha channel.
const JPEG: [&str; 2] = ["jpg", "jpeg"];

impl Draft<'_> {
    /// Writes the stored photograph of a view, not undistorted, as `FOLDER/NAME.EXTENSION`; returns its name in the
    /// folder. A file is copied unchanged, unless it carries an orientation, or an alpha channel that a person says is
    /// not used, or `only` has other extensions.
    pub(super) fn stored_photograph(
        &self,
        view: usize,
        folder: &str,
        only: &[&str],
    ) -> Result<String, WriteSceneError> {
        self.progress.check()?;
        let (name, uses_alpha) = (&self.names[view], self.scene.uses_alpha());
        let source = self.scene.upright_file(view)?.filter(|file| is_of(file, only));
        let is_as_used = match source {
            Some(file) => uses_alpha || has_extension(file, &JPEG) || !self.scene.stored_photograph(view)?.has_alpha,
            None => false,
        };
        let written = match source.filter(|_| is_as_used) {
            Some(source) => self.copied(source, folder, name)?,
            None => {
                let photograph = self.scene.stored_photograph(view)?;
                let photograph = if uses_alpha { photograph } else { photograph.without_alpha() };
                self.png(folder, name, rgb_or_rgba(photograph))?
            }
        };
        self.progress.step();
        Ok(written)
    }

    /// Writes the mask of a view, if it has one, for its stored photograph as [`Draft::stored_photograph`] writes it;
    /// returns its name in the folder: `name` with the mask's extension. A file is copied unchanged, unless it or the
    /// photograph carries an orientation, or `only` has other extensions.
    pub(super) fn mask(
        &self,
        view: usize,
        folder: &str,
        name: &str,
        only: &[&str],
    ) -> Result<Option<String>, WriteSceneError> {
        let Some(source) = &self.scene.views[view].mask else { return Ok(None) };
        Ok(Some(match self.scene.stored_mask(view)? {
            None if is_of(source, only) => self.copied(source, folder, name)?,
            None => self.png(folder, name, read_picture(source)?)?,
            Some(mask) => self.png(folder, name, mask.into())?,
        }))
    }

    /// Writes the ignore mask of a view into `masks`, as COLMAP and nerfstudio read it: a PNG of the photograph's size
    /// that is called as that is with `.png` behind it, of each photograph if one has a mask. A file that is one
    /// already is copied. Returns its name.
    fn ignore_mask(&self, view: usize, photograph: &str) -> Result<Option<String>, WriteSceneError> {
        let scene = self.scene;
        if scene.views.iter().all(|view| view.mask.is_none() || scene.has_object_mask(view)) {
            return Ok(None);
        }
        let size = picture_size(&self.folder.join("images").join(photograph))?;
        let is_ready = |mask: &PathBuf| -> Result<bool, WriteSceneError> {
            Ok(is_of(mask, &["png"]) && picture_size(mask)? == size && scene.stored_mask(view)?.is_none())
        };
        Ok(Some(match &scene.views[view].mask {
            Some(mask) if is_ready(mask)? => self.copied(mask, "masks", photograph)?,
            _ => self.png("masks", photograph, scene.stored_ignore_mask(view, size)?.into())?,
        }))
    }

    /// Writes the stored photograph of a view into `images`, as [`Draft::stored_photograph`], and its ignore mask into
    /// `masks`, as [`Draft::ignore_mask`]; an object's mask becomes the alpha channel, which says in these layouts where
    /// an object is. Returns both names.
    pub(super) fn stored_photograph_and_mask(&self, index: usize) -> Result<(String, Option<String>), WriteSceneError> {
        let view = &self.scene.views[index];
        if !self.scene.has_object_mask(view) {
            let name = self.stored_photograph(index, "images", &[])?;
            let mask = self.ignore_mask(index, &name)?;
            return Ok((name, mask));
        }
        self.progress.check()?;
        let name = self.png("images", &self.names[index], rgb_or_rgba(self.scene.masked_photograph(index)?))?;
        self.progress.step();
        Ok((name, None))
    }

    /// Writes the undistorted picture of a view, its mask as the alpha channel: the unchanged file if possible,
    /// otherwise a PNG.
    pub(super) fn pinhole_photograph(&self, view: usize, folder: &str) -> Result<String, WriteSceneError> {
        let changed = &self.scene.views[view];
        if changed.lens.is_none() && changed.mask.is_none() {
            return self.stored_photograph(view, folder, &[]);
        }
        self.progress.check()?;
        let mut photograph = self.scene.photograph(view)?;
        if changed.mask.is_some() && !self.scene.has_object_mask(changed) {
            photograph = with_hidden(photograph);
        }
        let name = self.png(folder, &self.names[view], rgb_or_rgba(photograph))?;
        self.progress.step();
        Ok(name)
    }

    /// Writes the undistorted picture of a view into `images` as [`Draft::pinhole_photograph`], but an ignore mask into
    /// `masks`. Returns both names.
    pub(super) fn pinhole_photograph_and_ignore_mask(
        &self,
        view: usize,
    ) -> Result<(String, Option<String>), WriteSceneError> {
        let changed = &self.scene.views[view];
        if self.scene.has_object_mask(changed) {
            return Ok((self.pinhole_photograph(view, "images")?, None));
        }
        if changed.mask.is_none() {
            let name = self.pinhole_photograph(view, "images")?;
            let mask = self.ignore_mask(view, &name)?;
            return Ok((name, mask));
        }
        let mask = format!("{}.png", self.names[view]);
        let name = self.pinhole_photograph_and_mask(view, "images", ["masks", &mask])?;
        Ok((name, Some(format!("{mask}.png"))))
    }

    /// Writes the undistorted picture of a view and its undistorted mask as two PNGs, the mask in a folder and with a
    /// name (without extension); returns the first one's name.
    pub(super) fn pinhole_photograph_and_mask(
        &self,
        view: usize,
        folder: &str,
        [mask_folder, mask_name]: [&str; 2],
    ) -> Result<String, WriteSceneError> {
        self.progress.check()?;
        let Photograph { pixels, seen, .. } = self.scene.photograph(view)?;
        let (name, changed) = (&self.names[view], &self.scene.views[view]);
        let (width, height) = pixels.dimensions();
        let mask = match seen {
            // Without an ignore mask it tells only what the lens did not see.
            Some(seen) if changed.mask.is_some() && !self.scene.has_object_mask(changed) => seen,
            _ => GrayImage::from_fn(width, height, |x, y| image::Luma([pixels.get_pixel(x, y)[3]])),
        };
        self.png(mask_folder, mask_name, mask.into())?;
        let written = self.png(folder, name, DynamicImage::ImageRgba8(pixels).into_rgb8().into())?;
        self.progress.step();
        Ok(written)
    }

    fn copied(&self, source: &Path, folder: &str, name: &str) -> Result<String, WriteSceneError> {
        let extension = source.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let file = format!("{name}.{extension}");
        let path = self.file(&format!("{folder}/{file}"))?;
        fs::copy(source, &path).map_err(|cause| WriteSceneError::Io(path, cause))?;
        Ok(file)
    }

    fn png(&self, folder: &str, name: &str, picture: DynamicImage) -> Result<String, WriteSceneError> {
        let file = format!("{name}.png");
        let encoded = encode_png(&picture);
        let failed = |cause| WriteSceneError::Encode(self.folder.join(folder).join(&file), cause);
        self.put(&format!("{folder}/{file}"), encoded.map_err(failed)?)?;
        Ok(file)
    }
}

/// Whether a file's extension is one of these; any is if there are none.
fn is_of(file: &Path, only: &[&str]) -> bool {
    only.is_empty() || has_extension(file, only)
}

/// The photograph with what does not count in it transparent.
fn with_hidden(mut photograph: Photograph) -> Photograph {
    let pixels = photograph.pixels.pixels_mut().zip(photograph.seen.iter().flat_map(|seen| seen.as_raw()));
    pixels.filter(|(_, seen)| **seen == 0).for_each(|(pixel, _)| pixel[3] = 0);
    Photograph { has_alpha: photograph.has_alpha || photograph.seen.is_some(), ..photograph }
}

/// Without the alpha channel where it says nothing.
fn rgb_or_rgba(Photograph { pixels, has_alpha, .. }: Photograph) -> DynamicImage {
    let picture = DynamicImage::ImageRgba8(pixels);
    if has_alpha { picture } else { picture.into_rgb8().into() }
}
