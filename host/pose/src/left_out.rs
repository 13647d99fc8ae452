//! Photographs, left out one at a time and rendered coarsely from their neighbours by the training-free field.
//!
//! A picture that is rendered at the photograph's pose is compared with the photograph, and so are what needs no poses (a copy of
//! the nearest photograph), what needs little of them (the same, warped by a plane), and pictures at poses that are turned
//! by two degrees. Where poses are true the first is nearer to the photograph than all others.
//!
//! ```text
//! score = -10 log10 mean (truth - gain picture)^2     decibels, over the pixels that the photograph shows
//! ```
//!
//! with a gain for each channel that minimises the error, within a factor of two: photographs differ in exposure.

use glam::DVec3;
use image::RgbImage;
use rayon::prelude::*;
use std::sync::Arc;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::baseline::plane::plane_depth;
use viewfuse_evaluate::baseline::{Baseline, Shot};
use viewfuse_field::On;
use viewfuse_field::render::{RenderError, RenderOptions, Stage};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::{Album, BackgroundChoice, SourceImage, SourceImages, scaled_size};
use viewfuse_weighting::Weighting;

/// Longest side of the pictures, in pixels.
const SIDE: u32 = 128;

/// Most neighbours that a photograph is rendered from.
const MAX_NEIGHBOURS: usize = 4;

/// The turn of disturbed poses.
const DISTURBANCE_DEGREES: f64 = 2.0;

/// The greatest score, decibels: that of pictures that differ in rounding alone.
const MAX_SCORE: f64 = 51.0;

/// A photograph that was left out. Scores in decibels.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// Its name.
    pub photograph: String,
    /// The score of what was rendered at its pose.
    pub score: f64,
    /// The score of a copy of the nearest photograph.
    pub copy: f64,
    /// The score of the nearest photograph, warped by a plane.
    pub warp: f64,
    /// The greatest score of what was rendered at poses that are turned by two degrees.
    pub disturbed: f64,
}

impl LeftOut {
    /// How much better than its copies, decibels.
    pub fn gain(&self) -> f64 {
        self.score - self.copy.max(self.warp)
    }

    /// How much better than at disturbed poses, decibels.
    pub fn sharpness(&self) -> f64 {
        self.score - self.disturbed
    }
}

/// Leaves out every view of a scene with at least three, which all have photographs.
///
/// # Errors
/// [`RenderError`].
pub(crate) fn left_out(scene: &Scene, progress: &dyn Progress) -> Result<Vec<LeftOut>, RenderError> {
    let views: Vec<usize> = (0..scene.views.len()).collect();
    let quiet = Quiet(progress);
    let album = Album::open_at(scene, views.iter().copied(), SIDE, &quiet)?;
    let all = album.sources(&views, SIDE, BackgroundChoice::None, &quiet)?;
    progress.expect(views.len());
    let one = |&view: &usize| {
        progress.check().map_err(|stopped| RenderError::Field(stopped.into()))?;
        let scores = scores(scene, &album, &all, view, &quiet)?;
        progress.step();
        Ok(scores)
    };
    views.par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
}

fn scores(
    scene: &Scene,
    album: &Album<'_>,
    all: &SourceImages,
    view: usize,
    progress: &dyn Progress,
) -> Result<LeftOut, RenderError> {
    let neighbours = nearest(scene, view);
    let images = Arc::new(SourceImages {
        images: neighbours.iter().map(|&own| all.images[own].clone()).collect(),
        warnings: Vec::new(),
        ..all.clone()
    });
    let shots: Vec<Shot> = (0..neighbours.len())
        .map(|own| Shot { camera: images.images[own].camera, picture: images.picture(own) })
        .collect();
    let truth = Truth::of(all, view);
    let (renderer, options) = (
        On { device: &Cpu, field: &TrainingFree::default() },
        RenderOptions { background: BackgroundChoice::None, ..RenderOptions::default() },
    );
    let mut stage = Stage::of_images(scene, album, &neighbours, images, &renderer, &options, progress)?;
    let weighting = Weighting::default_scheme();
    stage.weigh(&weighting, progress)?;
    let camera = scene.views[view].camera;
    let (width, height) = scaled_size(&camera, SIDE.min(truth.picture.width().max(truth.picture.height())));
    let mut rendered = |pose: Pose| -> Result<f64, RenderError> {
        let camera = Camera { pose, ..camera };
        let frame = stage.frame_of_size(&weighting, &camera, [width, height], progress)?;
        Ok(truth.score(&frame.picture))
    };
    let score = rendered(camera.pose)?;
    let mut disturbed = f64::NEG_INFINITY;
    for pose in turned(&camera.pose) {
        disturbed = disturbed.max(rendered(pose)?);
    }
    let target = all.images[view].camera;
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let depth = plane_depth(&target, all.points.iter().copied(), None, &cameras);
    let near: Vec<&Shot> = shots.iter().collect();
    let of = |baseline: Baseline| truth.score(&baseline.picture(&near, &target, depth));
    let (copy, warp) = (of(Baseline::NearestCopy), of(Baseline::WarpedCopy));
    Ok(LeftOut { photograph: scene.views[view].name.clone(), score, copy, warp, disturbed })
}

/// The nearest other views, the nearest first.
fn nearest(scene: &Scene, view: usize) -> Vec<usize> {
    let own = &scene.views[view].camera.pose;
    let distance = |other: &usize| scene.views[*other].camera.pose.distance(own);
    let mut others: Vec<usize> = (0..scene.views.len()).filter(|other| *other != view).collect();
    others.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    others.truncate(MAX_NEIGHBOURS);
    others
}

/// A pose turned about its own right and down axes, both ways.
fn turned(pose: &Pose) -> Vec<Pose> {
    let (sin, cos) = DISTURBANCE_DEGREES.to_radians().sin_cos();
    let [right, down, forward] =
        [pose.right_world(), pose.down_world(), pose.forward_world()].map(|own| own.as_dvec3());
    let centre = pose.centre_world();
    let of = |axes: [DVec3; 3]| {
        let row = |row: usize| [axes[0][row] as f32, axes[1][row] as f32, axes[2][row] as f32, centre[row]];
        Pose::from_opencv(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]).ok()
    };
    let about = |sin: f64| {
        [
            of([right, cos * down + sin * forward, cos * forward - sin * down]),
            of([cos * right + sin * forward, down, cos * forward - sin * right]),
        ]
    };
    [about(sin), about(-sin)].into_iter().flatten().flatten().collect()
}

/// A photograph as it is compared.
struct Truth {
    picture: RgbImage,
    /// The pixels that count.
    shown: Vec<bool>,
}

impl Truth {
    fn of(all: &SourceImages, view: usize) -> Truth {
        let SourceImage { texels, .. } = &all.images[view];
        Truth { picture: all.picture(view), shown: texels.iter().map(|texel| texel[3] > 0.999).collect() }
    }

    /// The score of a picture of its size; of another size it is resampled.
    fn score(&self, picture: &RgbImage) -> f64 {
        let (width, height) = self.picture.dimensions();
        let resized;
        let picture = if picture.dimensions() == (width, height) {
            picture
        } else {
            resized = image::imageops::resize(picture, width, height, image::imageops::FilterType::Triangle);
            &resized
        };
        let pairs = || self.picture.pixels().zip(picture.pixels()).zip(&self.shown).filter(|(_, shown)| **shown);
        let (mut error, mut count) = (0.0, 0_usize);
        for channel in 0..3 {
            let level = |pixel: &image::Rgb<u8>| f64::from(pixel[channel]) / 255.0;
            let (mut both, mut square) = (0.0, 0.0);
            for ((truth, own), _) in pairs() {
                both += level(truth) * level(own);
                square += level(own).powi(2);
            }
            let gain = if square > 0.0 { (both / square).clamp(0.5, 2.0) } else { 1.0 };
            for ((truth, own), _) in pairs() {
                error += (level(truth) - gain * level(own)).powi(2);
                count += 1;
            }
        }
        if count == 0 { 0.0 } else { (-10.0 * (error / count as f64).log10()).min(MAX_SCORE) }
    }
}
