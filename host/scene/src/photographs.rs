//! Photographs prepared for a field: at working size, premultiplied, with the background removed.

mod exposure;
mod ground_truth;
pub(crate) mod ignored;
mod matte;
pub mod object_box;
mod resample;

pub use ground_truth::{GroundTruth, read_over};
pub use matte::BackgroundChoice;

use crate::rig::Rig;
use crate::scene::neus;
use crate::{MaskChoice, MaskMeaning, Photograph, Scene, SceneError, View};
use image::RgbImage;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, PinholeError};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Interrupted, Progress};

/// Why photographs could not be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PhotographsError {
    /// A photograph could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The working width and height of a view are unusable.
    #[error("view '{0}' cannot be resampled to {1}x{2}: {3}")]
    Size(String, u32, u32, PinholeError),
    /// The background, for which this colour was assumed, covers the whole photograph, or nothing of it.
    #[error(
        "{0}: shows no object in front of the background ({1}); give the colour that the photographs' background has, \
         or photographs with an alpha channel"
    )]
    NoSilhouette(String, String),
    /// Of no photograph anything counts.
    #[error(
        "{0}: of the photographs nothing counts ('{1}' is the first): their alpha channels or masks hide all of them"
    )]
    NothingCounts(String, String),
    /// The colour of the background has a channel outside `[0, 1]`, or that is NaN.
    #[error("the background {0:?} is no colour: a channel is not from 0 to 1")]
    Background([f32; 3]),
    /// The person stopped the work.
    #[error("interrupted")]
    Interrupted(#[from] Interrupted),
}

impl Hinted for PhotographsError {
    fn hint(&self) -> Option<Hint> {
        match self {
            PhotographsError::NoSilhouette { .. } => Some(Hint::Background),
            PhotographsError::NothingCounts { .. } => Some(Hint::Masks),
            PhotographsError::Scene(error) => error.hint(),
            _ => None,
        }
    }
}

/// One source at working size.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceImage {
    /// The camera of the resampled image.
    pub camera: Camera,
    /// `[row][column]`: premultiplied red, green, blue and alpha in `[0, 1]`.
    pub texels: Vec<[f32; 4]>,
}

impl SourceImage {
    /// The same picture with a longest side of at most `side` pixels, averaged by area.
    ///
    /// # Errors
    /// [`PinholeError`] if the focal length becomes too short.
    pub fn reduced(&self, side: u32) -> Result<SourceImage, PinholeError> {
        let (width, height) = reduced_size(&self.camera, side);
        let pinhole = self.camera.pinhole.resized(width, height)?;
        let size_before = [self.camera.pinhole.width(), self.camera.pinhole.height()];
        let texels = resample::area_average(&self.texels, size_before, [width, height]);
        Ok(SourceImage { camera: Camera { pinhole, ..self.camera }, texels })
    }
}

/// All sources of a run at working size.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceImages {
    /// In the order of the sources.
    pub images: Vec<SourceImage>,
    /// The background's colour, red green blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Whether alpha is an object's silhouette. Otherwise whole photographs are used, and alpha 0 marks pixels outside
    /// them, and those that do not count. In a silhouette the nearest pixels that count take their place.
    pub has_silhouettes: bool,
    /// Surface points in world coordinates that two or more of the sources saw, where the scene's files have them.
    pub points: Vec<Vec3>,
    /// Near and far bound of the sources, where the scene's files state them.
    pub near_far: Option<[f32; 2]>,
    /// What all photographs of the scene look at, whichever are sources ([`Rig::meeting_point`]).
    pub focus: Option<Vec3>,
    /// Warnings about the background and the exposures.
    pub warnings: Vec<String>,
}

impl SourceImages {
    /// A source over the background.
    pub fn picture(&self, source: usize) -> RgbImage {
        let SourceImage { camera, texels } = &self.images[source];
        let behind = self.background;
        let over = |t: &[f32; 4]| [0, 1, 2, 3].map(|c| t[c] + if c < 3 { (1.0 - t[3]) * behind[c] } else { 0.0 });
        let texels: Vec<[f32; 4]> = texels.iter().map(over).collect();
        to_rgb8(&texels, [camera.pinhole.width(), camera.pinhole.height()])
    }
}

/// All results, or the first error in the order of the work: rayon's own collection returns any of several, so that
/// equal runs would name different photographs.
fn in_order<T: Send>(
    work: impl IndexedParallelIterator<Item = Result<T, PhotographsError>>,
) -> Result<Vec<T>, PhotographsError> {
    work.collect::<Vec<_>>().into_iter().collect()
}

/// Most bytes of decoded photographs that are kept. If a run needs more, each is decoded again at every use.
const MAX_KEPT_BYTES: u64 = 512 << 20;

/// Most bytes of photographs decoded at the same time, unless a single one needs more.
const MAX_DECODING_BYTES: u64 = 512 << 20;

/// Bytes for decoding a pixel: as decoded, as RGBA, undistorted.
const DECODING_BYTES: u64 = 16;

/// Photographs of less than twice this side are kept at their own size, for any working size.
const MIN_KEPT_SIDE: u32 = 640;

/// Points with a larger reprojection error, in pixels, are ignored.
const MAX_POINT_ERROR: f32 = 2.0;

/// Photographs of a scene, decoded once if memory allows.
pub struct Album<'a> {
    scene: &'a Scene,
    kept: Vec<Option<Photograph>>,
    /// The size at which each is kept.
    sizes: Vec<(u32, u32)>,
    /// Whether alpha channels say which pixels do not count, as the latest sources have it; `None` if these have none.
    /// Their targets mean the same by theirs.
    ignores: Mutex<Option<bool>>,
}

impl<'a> Album<'a> {
    /// Reads the photographs of these views at their own size, all cores at once.
    ///
    /// At most 512 MiB of them are kept; if they need more, each is read again at every use. Decoding uses at most
    /// another 512 MiB, or the memory of a single photograph if that is more.
    ///
    /// # Errors
    /// [`PhotographsError`] of the first view that cannot be read, or if the work is stopped.
    pub fn open(
        scene: &'a Scene,
        views: impl IntoIterator<Item = usize>,
        progress: &dyn Progress,
    ) -> Result<Album<'a>, PhotographsError> {
        Album { scene, kept: vec![None; scene.views.len()], sizes: sizes(scene, own_size), ignores: Mutex::default() }
            .filled(views, progress)
    }

    /// As [`Album::open_for`], for sources and truths of at most `longest_side` pixels on a side.
    ///
    /// # Errors
    /// As [`Album::open`].
    pub fn open_at(
        scene: &'a Scene,
        views: impl IntoIterator<Item = usize>,
        longest_side: u32,
        progress: &dyn Progress,
    ) -> Result<Album<'a>, PhotographsError> {
        Album::open_for(scene, views, |camera| reduced_size(camera, longest_side).into(), longest_side, progress)
    }

    /// As [`Album::open`], for truths of the size that `picture` gives for a camera, and for sources of at most
    /// `longest_side` pixels on a side: larger photographs are reduced as soon as they are decoded, to no less than
    /// twice that side, and to a multiple of the pictures' size, so that a truth is the same mean over the pixels of its
    /// photograph but for rounding. Those below 1280 pixels, or four times that side, keep their own size, with
    /// bit-identical results.
    ///
    /// # Errors
    /// As [`Album::open`].
    pub fn open_for(
        scene: &'a Scene,
        views: impl IntoIterator<Item = usize>,
        picture: impl Fn(&Camera) -> [u32; 2],
        longest_side: u32,
        progress: &dyn Progress,
    ) -> Result<Album<'a>, PhotographsError> {
        let least = longest_side.saturating_mul(2).max(MIN_KEPT_SIDE);
        let kept = |camera: &Camera| {
            let [width, height] = picture(camera).map(|side| side.max(1));
            let times = least.div_ceil(width.max(height));
            let is_large = self::longest_side(camera) / 2 >= times.saturating_mul(width.max(height));
            if is_large { (times * width, times * height) } else { own_size(camera) }
        };
        Album { scene, kept: vec![None; scene.views.len()], sizes: sizes(scene, kept), ignores: Mutex::default() }
            .filled(views, progress)
    }

    fn filled(
        mut self,
        views: impl IntoIterator<Item = usize>,
        progress: &dyn Progress,
    ) -> Result<Album<'a>, PhotographsError> {
        let mut wanted: Vec<usize> = views.into_iter().collect();
        wanted.sort_unstable();
        wanted.dedup();
        if let Some(&view) = wanted.last().filter(|view| **view >= self.scene.views.len()) {
            self.scene.photograph(view)?;
        }
        let pixels = |(width, height): (u32, u32)| u64::from(width) * u64::from(height);
        if wanted.iter().map(|&view| 4 * pixels(self.sizes[view])).sum::<u64>() > MAX_KEPT_BYTES {
            return Ok(self);
        }
        progress.expect(wanted.len());
        let mut rest = &wanted[..];
        while !rest.is_empty() {
            // As many as fit, and at least one.
            let mut bytes = 0;
            let fits = |&&view: &&usize| {
                bytes += DECODING_BYTES * pixels(own_size(&self.scene.views[view].camera));
                bytes <= MAX_DECODING_BYTES
            };
            let count = rest.iter().take_while(fits).count().max(1);
            let (now, later) = rest.split_at(count);
            let read = |&view: &usize| {
                progress.check()?;
                let photograph = self.read(view)?;
                progress.step();
                Ok((view, photograph))
            };
            let photographs = in_order(now.par_iter().map(read))?;
            for (view, photograph) in photographs {
                self.kept[view] = Some(photograph);
            }
            rest = later;
        }
        Ok(self)
    }

    fn read(&self, view: usize) -> Result<Photograph, SceneError> {
        let size = self.sizes[view];
        let photograph = self.scene.photograph_after(view, |stored| match stored.pixels.dimensions() == size {
            true => stored,
            false => resample::reduced(&stored, size),
        })?;
        let has_ignore_mask = self.scene.views[view].mask.is_some() && self.scene.masks == MaskMeaning::Ignore;
        Ok(if has_ignore_mask { ignored::filled(photograph) } else { photograph })
    }

    fn photograph(&self, view: usize) -> Result<Cow<'_, Photograph>, SceneError> {
        match self.kept.get(view) {
            Some(Some(photograph)) => Ok(Cow::Borrowed(photograph)),
            _ if view < self.scene.views.len() => Ok(Cow::Owned(self.read(view)?)),
            _ => Ok(Cow::Owned(self.scene.photograph(view)?)),
        }
    }

    /// Whether a photograph has an alpha channel that is not its object's mask.
    fn has_own_alpha(&self, view: usize, photograph: &Photograph) -> bool {
        photograph.has_alpha && !self.scene.has_object_mask(&self.scene.views[view])
    }

    /// A photograph as a source; `ignores` if what is transparent in it does not count.
    fn source(&self, view: usize, ignores: bool) -> Result<Cow<'_, Photograph>, SceneError> {
        let photograph = self.photograph(view)?;
        Ok(match ignores && self.has_own_alpha(view, &photograph) {
            true => Cow::Owned(ignored::filled(ignored::by_alpha(photograph.into_owned()))),
            false => photograph,
        })
    }

    /// The sources, reduced to at most `longest_side` pixels on a side, the background removed according to `choice`.
    ///
    /// # Errors
    /// [`PhotographsError`].
    pub fn sources(
        &self,
        views: &[usize],
        longest_side: u32,
        choice: BackgroundChoice,
        progress: &dyn Progress,
    ) -> Result<SourceImages, PhotographsError> {
        if let BackgroundChoice::Colour(colour) = choice
            && !colour.iter().all(|channel| (0.0..=1.0).contains(channel))
        {
            return Err(PhotographsError::Background(colour));
        }
        // Two passes over the photographs, so that at most one for each thread must be in memory.
        let look = |&view: &usize| {
            progress.check()?;
            let photograph = self.photograph(view)?;
            let share = self.has_own_alpha(view, &photograph).then(|| ignored::border_share(&photograph));
            Ok((matte::Border::of(&photograph, choice), share))
        };
        let (mut borders, shares): (Vec<_>, Vec<_>) = in_order(views.par_iter().map(look))?.into_iter().unzip();
        let shares: Vec<f32> = shares.into_iter().flatten().collect();
        let transparent_count = shares.len();
        let ignores = match self.scene.mask_choice {
            MaskChoice::Auto => ignored::is_of_ignored(shares),
            asked => asked == MaskChoice::Ignore && transparent_count > 0,
        };
        *self.ignores.lock().unwrap_or_else(PoisonError::into_inner) = (transparent_count > 0).then_some(ignores);
        if ignores {
            let look = |&view: &usize| {
                progress.check()?;
                Ok(matte::Border::of(self.source(view, ignores)?.as_ref(), choice))
            };
            borders = in_order(views.par_iter().map(look))?;
        }
        let backdrop = matte::Backdrop::of(borders.iter().flatten(), choice);
        let (background, mut warnings) = (backdrop.colour, Vec::new());
        if ignores && self.scene.mask_choice == MaskChoice::Auto {
            warnings.push(format!(
                "{transparent_count} photographs have an alpha channel that is opaque along the border: it is taken \
                 for pixels that do not count, not for an object"
            ));
        }
        let whole_pictures = match choice {
            BackgroundChoice::None => true,
            BackgroundChoice::Colour(_) => false,
            BackgroundChoice::Auto => !backdrop.can_be_told(),
        };
        // Whole photographs of a place are no fault. It is one where a person wants an object: by the background's
        // colour, or by cutting it out of some of the photographs.
        let is_asked = match choice {
            BackgroundChoice::None => false,
            BackgroundChoice::Colour(_) => true,
            BackgroundChoice::Auto => borders.iter().any(Option::is_none),
        };
        if is_asked && !backdrop.can_be_told() {
            // The same text for any choice of sources, so that it is shown once.
            let outcome = if whole_pictures && transparent_count > 0 {
                "nothing is cut out, and what is transparent does not count"
            } else if whole_pictures {
                "nothing is cut out, whole pictures are used"
            } else {
                "what is cut out may be more or less than the object"
            };
            warnings.push(format!(
                "the photographs' borders are not of one colour (they deviate by more than {:.0} of 255): {outcome}; \
                 for an object alone, photograph before a plain background or cut it out (PNG with alpha)",
                matte::MAX_NOISE_LEVEL
            ));
        }
        let cut_out = |is_whole: bool| {
            let source = |(&view, border): (&usize, &Option<matte::Border>)| {
                progress.check()?;
                let border = border.as_ref().filter(|_| !is_whole);
                self.cut_out(view, self.source(view, ignores)?, longest_side, border, &backdrop, !is_whole)
            };
            in_order(views.par_iter().zip(&borders).map(source))
        };
        let mut has_silhouettes = !whole_pictures;
        let images = match cut_out(whole_pictures) {
            Err(PhotographsError::NoSilhouette(path, colour)) if choice == BackgroundChoice::Auto => {
                warnings.push(format!(
                    "{path}: shows no object in front of a background of {colour}: nothing is cut out, whole pictures \
                        are used"
                ));
                has_silhouettes = false;
                cut_out(true)?
            }
            images => images?,
        };
        let name = |view: usize| self.scene.views[view].name.as_str();
        let shows_nothing = |image: &SourceImage| image.texels.iter().all(|texel| texel[3] == 0.0);
        let empty: Vec<usize> =
            views.iter().zip(&images).filter(|(_, image)| shows_nothing(image)).map(|(&view, _)| view).collect();
        if let [first, ..] = empty[..] {
            if empty.len() == views.len() {
                let scene = self.scene.path.display().to_string();
                return Err(PhotographsError::NothingCounts(scene, name(first).to_owned()));
            }
            let more = if empty.len() > 1 { format!(", and of {} more", empty.len() - 1) } else { String::new() };
            warnings.push(format!(
                "of the photograph '{}'{more} nothing counts: its mask or its alpha channel hides all of it",
                name(first)
            ));
        }
        warnings.extend(exposure::warning(&images, views.iter().map(|&view| name(view))));
        warnings.extend(exposure::dark_warning(&images));
        warnings.extend(exposure::grey_warning(&images, views.iter().map(|&view| name(view))));
        let (points, near_far) = self.space(views);
        // A sphere is the object's: photographs that are not cut out show more.
        let is_of_object = self.scene.layout == neus::NAME;
        let near_far = near_far.filter(|_| has_silhouettes || !is_of_object);
        let photographs = self.scene.views.iter().filter(|view| view.image.is_some());
        let focus = Rig::meeting_point(&photographs.map(|view| view.camera).collect::<Vec<_>>());
        Ok(SourceImages { images, background, has_silhouettes, points, near_far, focus, warnings })
    }

    /// Points that at least two of these views saw, and the depth bounds over all of them.
    fn space(&self, views: &[usize]) -> (Vec<Vec3>, Option<[f32; 2]>) {
        let saw = |point: &&crate::ScenePoint| {
            let is_source = |view: &&u32| views.contains(&(**view as usize));
            let is_exact = point.error.is_none_or(|error| error <= MAX_POINT_ERROR);
            is_exact && point.views.iter().filter(is_source).take(2).count() == 2
        };
        let points = self.scene.points.iter().filter(saw).map(|point| point.position_world).collect();
        let bounds: Option<Vec<[f32; 2]>> = views.iter().map(|&view| self.scene.views[view].near_far).collect();
        let near_far = bounds.and_then(|all| all.into_iter().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]));
        (points, near_far)
    }

    /// A source at working size; `must_show` requires that it shows an object and, unless it has an alpha channel, a
    /// background.
    fn cut_out(
        &self,
        view: usize,
        mut photograph: Cow<'_, Photograph>,
        longest_side: u32,
        border: Option<&matte::Border>,
        backdrop: &matte::Backdrop,
        must_show: bool,
    ) -> Result<SourceImage, PhotographsError> {
        let View { name, camera, image, .. } = &self.scene.views[view];
        if self.scene.has_object_mask(&self.scene.views[view]) && !must_show {
            photograph = Cow::Owned(photograph.into_owned().without_alpha());
        }
        // Enlarging a source would add pixels but no detail.
        let (width, height) = reduced_size(camera, longest_side);
        let pinhole = camera.pinhole.resized(width, height);
        let pinhole = pinhole.map_err(|error| PhotographsError::Size(name.clone(), width, height, error))?;
        let size_before = photograph.pixels.dimensions().into();
        let texels = if border.is_none() && !must_show {
            let pixels = photograph.pixels.as_raw().as_chunks::<4>().0;
            let seen = photograph.seen.as_ref().map(|seen| seen.as_raw());
            let texel = |at: usize| match seen {
                Some(seen) if seen[at] == 0 => [0.0; 4],
                _ => matte::premultiplied_by_alpha(pixels[at]),
            };
            resample::area_average_of(texel, size_before, [width, height])
        } else {
            let premultiplied = matte::premultiplied(&photograph, border, backdrop);
            let opaque = premultiplied.iter().filter(|texel| texel[3] > 0.5).count();
            if must_show && (opaque == 0 || (opaque == premultiplied.len() && !photograph.has_alpha)) {
                let path = image.as_ref().map_or_else(|| name.clone(), |path| path.display().to_string());
                return Err(PhotographsError::NoSilhouette(path, backdrop.to_string()));
            }
            resample::area_average(&premultiplied, size_before, [width, height])
        };
        Ok(SourceImage { camera: Camera { pinhole, ..*camera }, texels })
    }
}

/// A size for each view of a scene.
fn sizes(scene: &Scene, size: impl Fn(&Camera) -> (u32, u32)) -> Vec<(u32, u32)> {
    scene.views.iter().map(|view| size(&view.camera)).collect()
}

/// Width and height of a camera's image.
fn own_size(camera: &Camera) -> (u32, u32) {
    (camera.pinhole.width(), camera.pinhole.height())
}

/// Longest side of a camera's image in pixels.
pub fn longest_side(camera: &Camera) -> u32 {
    camera.pinhole.width().max(camera.pinhole.height())
}

/// Size of a camera's image with its longest side scaled to `side`; at least one pixel on a side.
pub fn scaled_size(camera: &Camera, side: u32) -> (u32, u32) {
    let scale = f64::from(side) / f64::from(longest_side(camera));
    let scaled = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
    (scaled(camera.pinhole.width()), scaled(camera.pinhole.height()))
}

/// As [`scaled_size`], but never larger than the image is.
pub fn reduced_size(camera: &Camera, side: u32) -> (u32, u32) {
    scaled_size(camera, side.min(longest_side(camera)))
}

/// Values in `[0, 1]` rounded to the nearest of 256 levels; the fourth channel is dropped. NaN becomes 0.
pub fn to_rgb8(texels: &[[f32; 4]], size: [u32; 2]) -> RgbImage {
    RgbImage::from_fn(size[0], size[1], |x, y| {
        let texel = texels[(y * size[0] + x) as usize];
        image::Rgb([texel[0], texel[1], texel[2]].map(|value| (value * 255.0 + 0.5) as u8))
    })
}
