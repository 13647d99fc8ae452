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
use viewfuse_field::training_free::{Sweep, TrainingFree};
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
    let quiet = Quiet(progress);
    let album = open_album(scene, &quiet)?;
    Photographs::of(scene, &album, &quiet)?.left_out(progress)
}

/// The photographs of a scene at the size at which they are compared.
///
/// # Errors
/// [`RenderError`].
fn open_album<'a>(scene: &'a Scene, progress: &dyn Progress) -> Result<Album<'a>, RenderError> {
    Ok(Album::open_at(scene, 0..scene.views.len(), SIDE, progress)?)
}

/// Photographs with their cameras, each of which is rendered from the others.
struct Photographs<'a> {
    scene: Scene,
    album: &'a Album<'a>,
    all: SourceImages,
}

impl<'a> Photographs<'a> {
    /// Of a scene whose views all have photographs, in an album of it.
    ///
    /// # Errors
    /// [`RenderError`].
    fn of(scene: &Scene, album: &'a Album<'a>, progress: &dyn Progress) -> Result<Photographs<'a>, RenderError> {
        let views: Vec<usize> = (0..scene.views.len()).collect();
        let all = album.sources(&views, SIDE, BackgroundChoice::None, progress)?;
        Ok(Photographs { scene: scene.clone(), album, all })
    }

    /// What each is met with.
    ///
    /// # Errors
    /// [`RenderError`].
    fn left_out(&self, progress: &dyn Progress) -> Result<Vec<LeftOut>, RenderError> {
        self.each(progress, |view, rendered| self.scores(view, rendered))
    }

    /// Does something with each view, rendered from the others, on all cores.
    ///
    /// # Errors
    /// [`RenderError`].
    fn each<T: Send>(
        &self,
        progress: &dyn Progress,
        work: impl Fn(usize, &mut Rendered<'_>) -> Result<T, RenderError> + Sync,
    ) -> Result<Vec<T>, RenderError> {
        let views: Vec<usize> = (0..self.scene.views.len()).collect();
        progress.expect(views.len());
        let one = |&view: &usize| {
            progress.check().map_err(|stopped| RenderError::Field(stopped.into()))?;
            let done = self.rendered(view, &Quiet(progress), |rendered| work(view, rendered))?;
            progress.step();
            Ok(done)
        };
        views.par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
    }

    fn rendered<T>(
        &self,
        view: usize,
        progress: &dyn Progress,
        work: impl FnOnce(&mut Rendered<'_>) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        let neighbours = nearest(&self.scene, view);
        let images = Arc::new(SourceImages {
            images: neighbours.iter().map(|&own| self.all.images[own].clone()).collect(),
            warnings: Vec::new(),
            ..self.all.clone()
        });
        let truth = Truth::of(&self.all, view);
        let (renderer, options) = (
            On { device: &Cpu, field: &field() },
            RenderOptions { background: BackgroundChoice::None, ..RenderOptions::default() },
        );
        let mut stage = Stage::of_images(&self.scene, self.album, &neighbours, images, &renderer, &options, progress)?;
        let weighting = Weighting::default_scheme();
        stage.weigh(&weighting, progress)?;
        let camera = self.scene.views[view].camera;
        let (width, height) = scaled_size(&camera, SIDE.min(truth.picture.width().max(truth.picture.height())));
        work(&mut Rendered { stage, weighting, camera, size: [width, height], truth, progress })
    }

    fn scores(&self, view: usize, rendered: &mut Rendered<'_>) -> Result<LeftOut, RenderError> {
        let pose = rendered.camera.pose;
        let score = rendered.score(pose)?;
        let mut disturbed = f64::NEG_INFINITY;
        for pose in turned(&pose) {
            disturbed = disturbed.max(rendered.score(pose)?);
        }
        let neighbours = nearest(&self.scene, view);
        let shots: Vec<Shot> = neighbours
            .iter()
            .map(|&own| Shot { camera: self.all.images[own].camera, picture: self.all.picture(own) })
            .collect();
        let target = self.all.images[view].camera;
        let cameras: Vec<Camera> = self.scene.views.iter().map(|view| view.camera).collect();
        let depth = plane_depth(&target, self.all.points.iter().copied(), None, &cameras);
        let near: Vec<&Shot> = shots.iter().collect();
        let of = |baseline: Baseline| rendered.truth.score(&baseline.picture(&near, &target, depth));
        let (copy, warp) = (of(Baseline::NearestCopy), of(Baseline::WarpedCopy));
        Ok(LeftOut { photograph: self.scene.views[view].name.clone(), score, copy, warp, disturbed })
    }
}

/// A photograph, and its neighbours from which it is rendered.
struct Rendered<'a> {
    stage: Stage<'a>,
    weighting: Weighting,
    camera: Camera,
    size: [u32; 2],
    truth: Truth,
    progress: &'a dyn Progress,
}

impl Rendered<'_> {
    /// The score of the picture at a pose.
    fn score(&mut self, pose: Pose) -> Result<f64, RenderError> {
        let camera = Camera { pose, ..self.camera };
        let frame = self.stage.frame_of_size(&self.weighting, &camera, self.size, self.progress)?;
        Ok(self.truth.score(&self.truth.resized(frame.picture)))
    }
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

    /// A picture, resampled if it is of another size.
    fn resized(&self, picture: RgbImage) -> RgbImage {
        let (width, height) = self.picture.dimensions();
        if picture.dimensions() == (width, height) {
            return picture;
        }
        image::imageops::resize(&picture, width, height, image::imageops::FilterType::Triangle)
    }

    /// The differences `truth - gain picture` of a picture of its size, three for each pixel that counts.
    fn differences(&self, picture: &RgbImage) -> Vec<f64> {
        let pairs = || self.picture.pixels().zip(picture.pixels()).zip(&self.shown).filter(|(_, shown)| **shown);
        let level = |pixel: &image::Rgb<u8>, channel: usize| f64::from(pixel[channel]) / 255.0;
        let gains: [f64; 3] = std::array::from_fn(|channel| {
            let (mut both, mut square) = (0.0, 0.0);
            for ((truth, own), _) in pairs() {
                both += level(truth, channel) * level(own, channel);
                square += level(own, channel).powi(2);
            }
            if square > 0.0 { (both / square).clamp(0.5, 2.0) } else { 1.0 }
        });
        let of = |truth, own| (0..3).map(move |channel| level(truth, channel) - gains[channel] * level(own, channel));
        pairs().flat_map(|((truth, own), _)| of(truth, own)).collect()
    }

    /// The score of a picture of its size.
    fn score(&self, picture: &RgbImage) -> f64 {
        let differences = self.differences(picture);
        let error: f64 = differences.iter().map(|own| own * own).sum();
        if differences.is_empty() { 0.0 } else { (-10.0 * (error / differences.len() as f64).log10()).min(MAX_SCORE) }
    }
}

/// The field that renders a view from the others: each source's depths count as they are, as a pose that is a little off should be felt,
/// not its photograph doubted.
fn field() -> TrainingFree {
    let sweep = Sweep { consistency_share: 0.0, ..Sweep::default() };
    TrainingFree { sweep, ..TrainingFree::default() }
}
