//! Photographs, held out one at a time and rendered coarsely from their neighbours by the training-free field.
//!
//! A picture that is rendered at the photograph's pose is compared with the photograph, and so are what needs no poses
//! (a copy of the nearest photograph), what needs little of them (the same, warped by a plane), and pictures at poses
//! that are turned by two degrees. Where poses are true the first is nearer to the photograph than all others.
//!
//! ```text
//! score = -10 log10 mean (truth - gain picture)^2     decibels, over the pixels that the photograph shows
//! ```
//!
//! with a gain for each channel that minimises the error, within a factor of two: photographs differ in exposure.

use glam::DVec3;
use image::RgbImage;
use rayon::prelude::*;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::baseline::plane::plane_depth;
use viewfuse_evaluate::baseline::{Baseline, Shot};
use viewfuse_field::held_out::{self, HeldOut, HoldOut, MAX_SCORE, resampled};
use viewfuse_field::render::{RenderError, RenderOptions};
use viewfuse_field::training_free::{Sweep, TrainingFree};
use viewfuse_field::{Field, On, Surfaces};
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::{Album, BackgroundChoice, GroundTruth, SourceImages, scaled_size};
use viewfuse_scene::rig::Rig;
use viewfuse_weighting::Weighting;

/// Every photograph is held out, and rendered from few others: all of them must agree with its pose.
const HOLD_OUT: HoldOut = HoldOut { max_views: usize::MAX, max_neighbours: 4, side: 128 };

/// Most distance between two photographs of one place, as a share of that to what the cameras look at: a degree.
const MAX_SAME_PLACE: f32 = 0.0175;

/// The turn of disturbed poses.
const DISTURBANCE_DEGREES: f64 = 2.0;

/// What a held-out photograph is met with. Scores in decibels.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct HeldOutScores {
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

impl HeldOutScores {
    /// How much better than its copies, decibels.
    pub fn gain(&self) -> f64 {
        self.score - self.copy.max(self.warp)
    }

    /// How much better than at disturbed poses, decibels.
    pub fn sharpness(&self) -> f64 {
        self.score - self.disturbed
    }
}

/// Holds out every view of a scene with at least three, which all have photographs.
pub(crate) fn hold_out_all(scene: &Scene, progress: &dyn Progress) -> Result<Vec<HeldOutScores>, RenderError> {
    let quiet = Quiet(progress);
    let views: Vec<usize> = (0..scene.views.len()).collect();
    let album = Album::open_at(scene, views.iter().copied(), HOLD_OUT.side, &quiet)?;
    let all = album.sources(&views, HOLD_OUT.side, BackgroundChoice::None, &quiet)?;
    let photographs = HeldOutPhotographs { scene, album: &album, all };
    photographs.each(progress)
}

/// Photographs with their cameras, each of which is rendered from the others.
struct HeldOutPhotographs<'a> {
    scene: &'a Scene,
    album: &'a Album<'a>,
    all: SourceImages,
}

impl HeldOutPhotographs<'_> {
    /// The scores of each view, rendered from the others, on all cores.
    fn each(&self, progress: &dyn Progress) -> Result<Vec<HeldOutScores>, RenderError> {
        let (field, options) =
            (field(), RenderOptions { background: BackgroundChoice::None, ..RenderOptions::default() });
        let renderer = On { device: &Cpu, field: &field };
        let surfaces = Surfaces { points: self.all.points.clone(), near_far: self.all.near_far };
        let views: Vec<usize> = (0..self.scene.views.len()).collect();
        let scene = (self.scene, self.album);
        let photographs = held_out::Photographs::new(scene, views, &self.all, surfaces, HOLD_OUT, &field.about())?;
        let poses: Vec<Pose> = self.scene.views.iter().map(|view| view.camera.pose).collect();
        let cameras: Vec<Camera> = self.scene.views.iter().map(|view| view.camera).collect();
        let focus = Rig::of(&cameras).focus;
        let weighting = Weighting::default_scheme();
        let one = |&view: &usize| {
            progress.check().map_err(|stopped| RenderError::Field(stopped.into()))?;
            let quiet = &Quiet(progress);
            let neighbours = neighbours(&poses, focus, view);
            let mut held_out = photographs.hold_out(view, neighbours, &renderer, &options, quiet)?;
            held_out.stage.weigh(&weighting, quiet)?;
            let camera = self.scene.views[view].camera;
            let (width, height) = held_out.truth.picture.dimensions();
            let size = scaled_size(&camera, HOLD_OUT.side.min(width.max(height))).into();
            let truth = Truth::of(&held_out.truth);
            let rendered = Rendered { held_out, weighting: &weighting, camera, size, truth, progress: quiet };
            let scores = self.scores(view, rendered)?;
            progress.step();
            Ok(scores)
        };
        let views = HOLD_OUT.views(&poses);
        progress.expect(views.len());
        views.par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
    }

    fn scores(&self, view: usize, mut rendered: Rendered<'_>) -> Result<HeldOutScores, RenderError> {
        let pose = rendered.camera.pose;
        let score = rendered.score(pose)?;
        let mut disturbed = f64::NEG_INFINITY;
        for pose in turned(&pose) {
            disturbed = disturbed.max(rendered.score(pose)?);
        }
        let shot = |&other: &usize| Shot { camera: self.all.images[other].camera, picture: self.all.picture(other) };
        let shots: Vec<Shot> = rendered.held_out.neighbours.iter().map(shot).collect();
        let target = rendered.held_out.camera;
        let cameras: Vec<Camera> = self.scene.views.iter().map(|view| view.camera).collect();
        let depth = plane_depth(&target, self.all.points.iter().copied(), None, &cameras);
        let near: Vec<&Shot> = shots.iter().collect();
        let copy = rendered.truth.score(&rendered.held_out.nearest_copy());
        let warp = rendered.truth.score(&Baseline::WarpedCopy.picture(&near, &target, depth));
        Ok(HeldOutScores { photograph: self.scene.views[view].name.clone(), score, copy, warp, disturbed })
    }
}

/// The photographs that one is rendered from: none that was taken from its own place, which would be met by its copy as
/// well as by what is rendered from it, unless there are no two others.
fn neighbours(poses: &[Pose], focus: Vec3, view: usize) -> Vec<usize> {
    let place = |view: usize| poses[view].centre_world();
    let reach = MAX_SAME_PLACE * place(view).distance(focus);
    let elsewhere = HOLD_OUT.neighbours_among(poses, view, |other| place(other).distance(place(view)) > reach);
    if elsewhere.len() > 1 { elsewhere } else { HOLD_OUT.neighbours(poses, view) }
}

/// A held-out photograph, rendered from its neighbours.
struct Rendered<'a> {
    held_out: HeldOut<'a>,
    weighting: &'a Weighting,
    camera: Camera,
    size: [u32; 2],
    truth: Truth,
    progress: &'a dyn Progress,
}

impl Rendered<'_> {
    /// The score of the picture at a pose.
    fn score(&mut self, pose: Pose) -> Result<f64, RenderError> {
        let camera = Camera { pose, ..self.camera };
        let frame = self.held_out.stage.frame_of_size(self.weighting, &camera, self.size, self.progress)?;
        Ok(self.truth.score(&resampled(&frame.picture, self.truth.picture.dimensions())))
    }
}

/// A pose turned about its own right and down axes, both ways.
fn turned(pose: &Pose) -> Vec<Pose> {
    let (sin, cos) = DISTURBANCE_DEGREES.to_radians().sin_cos();
    let [right, down, forward] =
        [pose.right_world(), pose.down_world(), pose.forward_world()].map(|axis| axis.as_dvec3());
    let centre = pose.centre_world();
    let with = |axes: [DVec3; 3]| {
        let row = |row: usize| [axes[0][row] as f32, axes[1][row] as f32, axes[2][row] as f32, centre[row]];
        Pose::from_opencv(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]).ok()
    };
    let about = |sin: f64| {
        [
            with([right, cos * down + sin * forward, cos * forward - sin * down]),
            with([cos * right + sin * forward, down, cos * forward - sin * right]),
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
    fn of(GroundTruth { picture, seen }: &GroundTruth) -> Truth {
        let shown = match seen {
            Some(seen) => seen.as_raw().iter().map(|level| *level > 0).collect(),
            None => vec![true; picture.pixels().len()],
        };
        Truth { picture: picture.clone(), shown }
    }

    /// The differences `truth - gain picture` of a picture of its size, three for each pixel that counts.
    fn differences(&self, picture: &RgbImage) -> Vec<f64> {
        let pairs = || self.picture.pixels().zip(picture.pixels()).zip(&self.shown).filter(|(_, shown)| **shown);
        let level = |pixel: &image::Rgb<u8>, channel: usize| f64::from(pixel[channel]) / 255.0;
        let gains: [f64; 3] = std::array::from_fn(|channel| {
            let (mut both, mut square) = (0.0, 0.0);
            for ((truth, shown), _) in pairs() {
                both += level(truth, channel) * level(shown, channel);
                square += level(shown, channel).powi(2);
            }
            if square > 0.0 { (both / square).clamp(0.5, 2.0) } else { 1.0 }
        });
        let difference =
            |truth, shown| (0..3).map(move |channel| level(truth, channel) - gains[channel] * level(shown, channel));
        pairs().flat_map(|((truth, shown), _)| difference(truth, shown)).collect()
    }

    /// The score of a picture of its size.
    fn score(&self, picture: &RgbImage) -> f64 {
        let differences = self.differences(picture);
        let error: f64 = differences.iter().map(|difference| difference * difference).sum();
        if differences.is_empty() { 0.0 } else { (-10.0 * (error / differences.len() as f64).log10()).min(MAX_SCORE) }
    }
}

/// The field that renders a view from the others: each source's depths count as they are, as a pose that is a little
/// off should be felt, not its photograph doubted.
fn field() -> TrainingFree {
    let sweep = Sweep { consistency_share: 0.0, ..Sweep::default() };
    TrainingFree { sweep, ..TrainingFree::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras on a line, which look ahead at what is 4 away.
    fn poses(places: &[f32]) -> Vec<Pose> {
        let pose = |x: &f32| {
            Pose::from_opencv(&[[1.0, 0.0, 0.0, *x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        };
        places.iter().map(|x| pose(x).expect("a pose")).collect()
    }

    #[test]
    fn a_photograph_is_not_rendered_from_one_of_the_same_place() {
        let focus = Vec3::new(0.0, 0.0, 4.0);
        let found = |places: &[f32], view| neighbours(&poses(places), focus, view);
        assert_eq!(found(&[0.0, 0.01, 0.5, 1.0], 0), [2, 3]);
        assert_eq!(found(&[0.0, 0.01, 0.5, 1.0], 2), [1, 0, 3]);
        assert_eq!(found(&[0.0, 0.1, 0.5, 1.0], 0), [1, 2, 3], "a degree and a half beside");
        assert_eq!(found(&[0.0, 0.01, 0.5], 0), [1, 2], "there are no two others");
    }
}
