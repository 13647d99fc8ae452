//! Held-out photographs: each is rendered from others as if it were not there, and compared with what it shows. It is
//! how pictures are scored without a truth beyond the sources.
//!
//! Who asks says which photographs are held out, from how many others each is rendered, and at which size: [`HoldOut`].

use crate::render::{RenderError, RenderOptions, Stage};
use crate::renderer::Renderer;
use crate::scores::psnr_of_seen;
use crate::{About, Surfaces};
use image::imageops::{self, FilterType};
use image::{GrayImage, RgbImage};
use std::borrow::Cow;
use std::sync::Arc;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, PinholeError};
use viewfuse_core::pose::Pose;
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::{Album, GroundTruth, SourceImage, SourceImages, scaled_size};
use viewfuse_scene::rig::spread;

/// The greatest score of a held-out photograph, decibels: that of 8-bit pictures that differ in rounding alone.
pub const MAX_SCORE: f64 = 51.0;
/// Longest side at which what compression and resampling do is averaged out, in pixels.
pub const COPY_SIDE: u32 = 32;
/// At that size copies differ by less than this, as a share of what a pixel's step changes. JPEGs of quality 60 and 70 at
/// the same and at a smaller size have 0.037 to 0.041; of the photographs of fourteen scenes the nearest two are a car
/// on white from two sides, 0.12, then a cup on a table, 0.17.
const MAX_COPY_SHARE: f64 = 0.07;
/// Between the axes of copies whose poses were found each by itself, in radians: a degree.
const MAX_COPY_ANGLE: f32 = 0.017;
/// Alpha from which on a pixel is shown whole.
const MIN_SHOWN_ALPHA: f32 = 0.999;

/// How photographs are held out, one at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HoldOut {
    /// Most photographs that are held out: of more, those that are as far apart as possible.
    pub max_views: usize,
    /// Most others that each is rendered from, the nearest ones.
    pub max_neighbours: usize,
    /// Longest side of the pictures, in pixels.
    pub side: u32,
}

impl HoldOut {
    /// The photographs that are held out, of those with these poses; ascending.
    pub fn views(&self, poses: &[Pose]) -> Vec<usize> {
        if poses.len() <= self.max_views {
            return (0..poses.len()).collect();
        }
        let centres: Vec<Vec3> = poses.iter().map(Pose::centre_world).collect();
        spread(&centres, self.max_views)
    }

    /// The others that a photograph is rendered from, the nearest first.
    pub fn neighbours(&self, poses: &[Pose], view: usize) -> Vec<usize> {
        self.neighbours_among(poses, view, |_| true)
    }

    /// As [`HoldOut::neighbours`], of those that `is_candidate` allows.
    pub fn neighbours_among(&self, poses: &[Pose], view: usize, is_candidate: impl Fn(usize) -> bool) -> Vec<usize> {
        let others = (0..poses.len()).filter(|other| *other != view && is_candidate(*other));
        nearest(others, |other| poses[other].distance(&poses[view]), self.max_neighbours)
    }
}

/// The nearest of some views, at most `count`, the nearest first; of equally near ones the first.
pub fn nearest(views: impl Iterator<Item = usize>, distance: impl Fn(usize) -> f32, count: usize) -> Vec<usize> {
    let mut nearest: Vec<usize> = views.collect();
    nearest.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    nearest.truncate(count);
    nearest
}

/// Whether two small pictures, of a longest side of [`COPY_SIDE`], are of one photograph, if only as a smaller or a more
/// compressed copy.
pub fn is_copy(a: &RgbImage, b: &RgbImage) -> bool {
    difference(a, b).is_some_and(|levels| levels < MAX_COPY_SHARE * step(a))
}

/// Root mean square difference of two pictures of one size, in levels.
pub fn difference(a: &RgbImage, b: &RgbImage) -> Option<f64> {
    (a.dimensions() == b.dimensions()).then(|| {
        let sum: f64 = a.iter().zip(b.iter()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
        (sum / a.len().max(1) as f64).sqrt()
    })
}

/// Root mean square difference of a picture from itself a pixel beside, in levels.
fn step(picture: &RgbImage) -> f64 {
    let (width, height) = picture.dimensions();
    let part = |x, y| imageops::crop_imm(picture, x, y, width.saturating_sub(1), height.saturating_sub(1)).to_image();
    difference(&part(0, 0), &part(1, 1)).unwrap_or(0.0)
}

/// A picture at a size, resampled if it has another one.
pub fn resampled(picture: &RgbImage, (width, height): (u32, u32)) -> Cow<'_, RgbImage> {
    match picture.dimensions() == (width, height) {
        true => Cow::Borrowed(picture),
        false => Cow::Owned(imageops::resize(picture, width, height, FilterType::Triangle)),
    }
}

/// Photographs of a scene, each of which can be held out.
pub struct Photographs<'a> {
    scene: &'a Scene,
    album: &'a Album<'a>,
    /// The scene's views that they are of.
    views: Vec<usize>,
    /// At the size of the pictures.
    pictures: SourceImages,
    /// At the size that the field takes sources at.
    sources: SourceImages,
}

/// A held-out photograph, with the others that it is rendered from on the device.
pub struct HeldOut<'a> {
    /// From which it is rendered.
    pub stage: Stage<'a>,
    /// Its camera, of the truth's size.
    pub camera: Camera,
    /// What it shows.
    pub truth: GroundTruth,
    /// The photographs that it is rendered from, in their order on the stage.
    pub neighbours: Vec<usize>,
}

impl<'a> Photographs<'a> {
    /// Photographs of these views of a scene, no smaller than the pictures, with what is known of the surfaces.
    ///
    /// # Errors
    /// [`RenderError::Unsuitable`] if a photograph is too narrow to be reduced.
    pub fn new(
        (scene, album): (&'a Scene, &'a Album<'a>),
        views: Vec<usize>,
        images: &SourceImages,
        surfaces: Surfaces,
        hold_out: HoldOut,
        about: &About,
    ) -> Result<Photographs<'a>, RenderError> {
        let unusable = |error: PinholeError| RenderError::Unsuitable {
            scene: scene.path.display().to_string(),
            reason: error.into(),
        };
        let at = |side: u32| -> Result<SourceImages, RenderError> {
            let reduced: Result<Vec<SourceImage>, _> = images.images.iter().map(|image| image.reduced(side)).collect();
            Ok(SourceImages {
                images: reduced.map_err(unusable)?,
                background: images.background,
                has_silhouettes: images.has_silhouettes,
                points: surfaces.points.clone(),
                near_far: surfaces.near_far,
                focus: images.focus,
                warnings: Vec::new(),
            })
        };
        let (pictures, sources) = (at(hold_out.side)?, at(about.source_side.of(hold_out.side))?);
        Ok(Photographs { scene, album, views, pictures, sources })
    }

    /// Whether one of them shows anything that counts.
    pub fn shows_anything(&self, view: usize) -> bool {
        self.pictures.has_silhouettes
            || self.pictures.images[view].texels.iter().any(|texel| texel[3] > MIN_SHOWN_ALPHA)
    }

    /// Those that are another copy of one of them, which says nothing of new views: smaller, or more compressed.
    pub fn copies(&self, view: usize) -> Vec<usize> {
        let small = |view: usize| {
            let picture = self.pictures.picture(view);
            let (width, height) = scaled_size(&self.pictures.images[view].camera, COPY_SIDE);
            imageops::thumbnail(&picture, width.max(2), height.max(2))
        };
        let (own, images) = (small(view), &self.pictures.images);
        let is_near = |other: &usize| images[*other].camera.pose.axis_angle(&images[view].camera.pose) < MAX_COPY_ANGLE;
        let others = (0..self.views.len()).filter(|other| *other != view).filter(is_near);
        others.filter(|other| is_copy(&own, &small(*other))).collect()
    }

    /// Holds one of them out: takes its neighbours to the device, in this order.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn hold_out(
        &self,
        view: usize,
        neighbours: Vec<usize>,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<HeldOut<'a>, RenderError> {
        let images = neighbours.iter().map(|&other| self.sources.images[other].clone()).collect();
        let sources = Arc::new(SourceImages {
            images,
            points: self.sources.points.clone(),
            warnings: Vec::new(),
            ..self.sources
        });
        let views: Vec<usize> = neighbours.iter().map(|&other| self.views[other]).collect();
        let stage = Stage::of_images(self.scene, self.album, &views, sources, renderer, options, progress)?;
        let shown = &self.pictures.images[view];
        let seen = if self.pictures.has_silhouettes { None } else { shown_part(shown) };
        let truth = GroundTruth { picture: self.pictures.picture(view), seen };
        Ok(HeldOut { stage, camera: shown.camera, truth, neighbours })
    }
}

impl HeldOut<'_> {
    /// A copy of the nearest of its neighbours, of the truth's size: what a picture must be better than.
    pub fn nearest_copy(&self) -> RgbImage {
        let images = &self.stage.images;
        let distance = |neighbour: usize| images.images[neighbour].camera.pose.distance(&self.camera.pose);
        let size = self.truth.picture.dimensions();
        match nearest(0..images.images.len(), distance, 1).first() {
            Some(&neighbour) => resampled(&images.picture(neighbour), size).into_owned(),
            None => RgbImage::new(size.0, size.1),
        }
    }

    /// The score of a picture, decibels, at most [`MAX_SCORE`].
    pub fn score(&self, picture: &RgbImage) -> f64 {
        psnr_of_seen(picture, &self.truth.picture, self.truth.seen.as_ref()).min(MAX_SCORE)
    }
}

/// The pixels that a whole photograph shows: those its lens did not see have alpha 0. `None` if it shows all of them.
fn shown_part(SourceImage { camera, texels }: &SourceImage) -> Option<GrayImage> {
    let levels: Vec<u8> = texels.iter().map(|texel| if texel[3] > MIN_SHOWN_ALPHA { u8::MAX } else { 0 }).collect();
    GrayImage::from_raw(camera.pinhole.width(), camera.pinhole.height(), levels)
        .filter(|seen| seen.as_raw().contains(&0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras on a line that look ahead.
    fn poses(places: &[f32]) -> Vec<Pose> {
        let at = |x: f32| Pose::look_at(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 1.0), -Vec3::Y).expect("a pose");
        places.iter().copied().map(at).collect()
    }

    #[test]
    fn few_are_all_held_out_and_of_many_those_that_are_far_apart() {
        let hold_out = HoldOut { max_views: 3, max_neighbours: 2, side: 96 };
        assert_eq!(hold_out.views(&poses(&[0.0, 0.1, 5.0])), [0, 1, 2]);
        assert_eq!(hold_out.views(&poses(&[0.0, 0.1, 5.0, 2.5, 4.9])), [0, 2, 3]);
    }

    #[test]
    fn neighbours_are_the_nearest_others_the_nearest_first() {
        let hold_out = HoldOut { max_views: 3, max_neighbours: 3, side: 96 };
        let poses = poses(&[4.0, 0.0, 1.0, -1.0, 9.0]);
        assert_eq!(hold_out.neighbours(&poses, 1), [2, 3, 0], "of equally near ones the first");
        assert_eq!(hold_out.neighbours(&poses[..2], 1), [0]);
    }
}
