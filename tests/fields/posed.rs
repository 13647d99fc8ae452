//! The verdict on poses that a solver gives for bare photographs: true ones pass, and wrong ones do not, also where
//! every attempt agrees on them.

use glam::{DMat3, DVec3};
use std::f64::consts::PI;
use std::path::Path;
use viewfuse::job::progress::{Progress, Silent};
use viewfuse::pose::{
    Features, Found, Options, PoseJob, Solution, SolvedApart, SolvedCamera, SolvedPhotograph, SolvedPoint, Solver,
    SolverError, find,
};
use viewfuse::scene::Scene;
use viewfuse::scene::rig::Rig;
use viewfuse_tests::places::data;

/// Photographs of a set.
const COUNT: usize = 5;

/// Says the true poses of the sample room's first photographs, changed.
struct Oracle<F> {
    /// Of the features and a photograph: the turn of its camera about its down axis, degrees.
    turn: F,
    /// What all distances between cameras are multiplied with.
    baseline: f64,
    /// Whether it says of one camera that its photographs are of two focal lengths.
    is_zoomed: bool,
}

impl<F: Fn(Features, usize) -> f64 + Sync> Solver for Oracle<F> {
    fn name(&self) -> &'static str {
        "oracle"
    }

    fn features(&self) -> &'static [Features] {
        &[Features::Alp, Features::Sift]
    }

    fn solve(&self, job: &PoseJob, _progress: &dyn Progress) -> Result<Solution, SolverError> {
        let scene = Scene::open(data("room")).expect("the room");
        let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
        let focus = Rig::of(&cameras).focus.as_dvec3();
        let first = cameras[0].pose.centre_world().as_dvec3();
        let photograph = |index: usize| {
            let pose = &cameras[index].pose;
            let axes = [pose.right_world(), pose.down_world(), pose.forward_world()].map(|axis| axis.as_dvec3());
            let world_from_camera = DMat3::from_cols(axes[0], axes[1], axes[2]);
            let turned = DMat3::from_rotation_y((self.turn)(job.features, index).to_radians());
            let rotation = (world_from_camera * turned).transpose();
            let centre = first + self.baseline * (pose.centre_world().as_dvec3() - first);
            let translation = -(rotation * centre);
            let row = |row: usize| [rotation.x_axis[row], rotation.y_axis[row], rotation.z_axis[row], translation[row]];
            SolvedPhotograph { camera_from_world: Some([row(0), row(1), row(2)]), reason: None }
        };
        // What is found is in pixels of the job's photographs, which are enlarged.
        let scale = job.photographs.first().map_or(1.0, |photograph| f64::from(photograph.size[0]) / 320.0);
        let middle = [160.0 * scale, 120.0 * scale];
        // Around what the cameras look at: they bound the depths, and have parallax.
        let away = focus.distance(first);
        let point = |number: usize| {
            let angle = 2.0 * PI * number as f64 / 40.0;
            let offset = DVec3::new(angle.cos(), (3.0 * angle).sin(), angle.sin());
            let seen = (0..COUNT).map(|photo| (photo, middle)).collect();
            SolvedPoint { position: (focus + 0.4 * away * offset).to_array(), error: 0.3, seen }
        };
        let camera = |_| SolvedCamera { focal: 294.4 * scale, principal: middle, k1: 0.0 };
        Ok(Solution {
            solver: "oracle 1".to_owned(),
            cameras: job.cameras.iter().map(camera).collect(),
            photographs: (0..COUNT).map(photograph).collect(),
            points: (0..40).map(point).collect(),
            pairs: Vec::new(),
            apart: (self.is_zoomed && job.cameras.len() == 1).then(|| SolvedApart {
                loss: 0.5,
                focal: (0..COUNT).map(|photo| Some([300.0, 420.0][photo % 2])).collect(),
            }),
        })
    }
}

fn bare(folder: &Path) {
    for view in 0..COUNT {
        let name = format!("{view:03}.jpg");
        std::fs::copy(data("room").join("images").join(&name), folder.join(&name)).expect("a photograph");
    }
}

fn found(baseline: f64, turn: impl Fn(Features, usize) -> f64 + Sync) -> Found {
    let folder = tempfile::tempdir().expect("a folder");
    bare(folder.path());
    let options = Options { focal: Some(294.4), ..Options::default() };
    let oracle = Oracle { turn, baseline, is_zoomed: false };
    find(folder.path(), &[&oracle], &options, &Silent).expect("a verdict")
}

#[test]
fn true_poses_pass() {
    let found = found(1.0, |_, _| 0.0);
    let verdict = found.verdict.as_ref().expect("true poses");
    assert_eq!(verdict.photos, (0..COUNT).collect::<Vec<_>>());
    for image in &verdict.verified {
        assert!(image.rotation_difference < 1.0e-6, "{image:?}");
        assert!(image.held_out.gain() > 1.0 && image.held_out.sharpness() > 1.0, "{image:?}");
    }
}

/// Photographs that state nothing are looked for again with two cameras where a solver tells two zooms apart.
#[test]
fn zooms_are_cameras() {
    let folder = tempfile::tempdir().expect("a folder");
    bare(folder.path());
    let oracle = Oracle { turn: |_, _| 0.0, baseline: 1.0, is_zoomed: true };
    let found = find(folder.path(), &[&oracle], &Options::default(), &Silent).expect("a verdict");
    let photos: Vec<_> = found.cameras.groups.iter().map(|group| group.photos.clone()).collect();
    assert_eq!(photos, [vec![0, 2, 4], vec![1, 3]]);
    assert!(found.attempts.iter().all(|attempt| attempt.tried.focal.len() == 2), "{:?}", found.attempts[0].tried);
    assert_eq!(found.verdict.as_ref().expect("true poses").photos.len(), COUNT);
}

#[test]
fn one_wrong_pose_is_excluded_by_name() {
    let found = found(1.0, |_, photo| if photo == 2 { 5.0 } else { 0.0 });
    let verdict = found.verdict.as_ref().expect("the others are true");
    assert!(!verdict.photos.contains(&2) && verdict.photos.len() >= 3, "{:?}", verdict.photos);
    let excluded = found.excluded(Some(verdict));
    let is_it = |(name, why): &(_, String)| name == "002.jpg" && why.contains("held out and rendered");
    assert!(excluded.iter().any(is_it), "{excluded:?}");
}

#[test]
fn what_cannot_be_trusted_is_refused() {
    type Turn = fn(Features, usize) -> f64;
    let cases: [(f64, Turn, &str); 3] = [
        // All attempts agree on wrong poses; they do not agree; and the camera only turned.
        (1.0, |_, photo| 6.0 * photo as f64, "photographs stay"),
        (
            1.0,
            |features, photo| if features == Features::Sift { 4.0 * photo as f64 } else { 0.0 },
            "no other attempt has",
        ),
        (0.001, |_, _| 0.0, "the camera hardly moved"),
    ];
    for (baseline, turn, words) in cases {
        let found = found(baseline, turn);
        let refusal = found.verdict.as_ref().expect_err("wrong poses");
        assert!(refusal.main().contains(words), "{words}: {refusal:?}");
    }
}
