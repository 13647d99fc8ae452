//! Pictures at, beside and between photographs: as a camera comes nearer to a photograph, its picture becomes the
//! photograph.

use viewfuse::device::cpu::Cpu;
use viewfuse::field::On;
use viewfuse::field::render::{Frame, RenderOptions, Stage};
use viewfuse::field::scores::psnr_of_seen;
use viewfuse::field::training_free::TrainingFree;
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::{FewShot, Target};
use viewfuse::weighting::Weighting;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_tests::fields::{on_scene, sample};

/// Schemes, and whether a photograph has all the weight at its own place.
const SCHEMES: [(&str, bool); 10] = [
    ("distance:power=2", true),
    ("error:alpha=1", true),
    ("gaussian:beta=1", false),
    ("distance:power=1", true),
    ("distance:power=3", true),
    ("error:alpha=0.5", true),
    ("l1", true),
    ("frobenius", true),
    ("relative-frobenius", false),
    ("mean", false),
];
/// Shares of the way to the next photograph, from the middle to the photograph itself.
const AWAY: [f32; 7] = [0.5, 0.3, 0.15, 0.08, 0.03, 0.01, 0.0];
/// How much of the weight is dropped, and with how many of the schemes it is tried.
const DROPPED: [(f32, usize); 3] = [(0.01, 10), (0.0, 3), (0.2, 3)];
/// Most decibels that a picture loses as its camera comes nearer.
const MAX_LOSS: f64 = 0.5;
/// Decibels of a picture at a photograph that has all the weight, and share of it that two photographs show.
const MIN_AT: f64 = 35.0;
const MIN_CONFIRMED: f32 = 0.5;

/// A camera this far away from one, towards a place, and turned with it towards what the other looks at.
fn away(from: &Camera, to: Vec3, ahead: Vec3, share: f32) -> Camera {
    if share == 0.0 {
        return *from;
    }
    let mix = |a: Vec3, b: Vec3| a * (1.0 - share) + b * share;
    let centre = mix(from.pose.centre_world(), to);
    let forward = mix(from.pose.forward_world(), ahead);
    Camera { pose: Pose::look_at(centre, centre + forward, -from.pose.down_world()).expect("a pose"), ..*from }
}

fn frame(stage: &mut Stage<'_>, weighting: &Weighting, camera: Camera) -> Frame {
    stage.frame(weighting, &Target { name: String::new(), camera, truth: None }, &Silent).expect("a frame")
}

#[test]
fn pictures_become_the_photograph_as_the_camera_comes_nearer() {
    let scene = sample("room");
    let sources = (0..scene.views.len()).collect();
    let job = FewShot { sources, ..FewShot::default() };
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    for (leave_out, count) in DROPPED {
        let options = RenderOptions { size: Some([48, 36]), leave_out, ..RenderOptions::default() };
        on_scene(&scene, &job, &renderer, &options, |stage| {
            SCHEMES[..count].iter().for_each(|scheme| nearer(stage, &scene, leave_out, *scheme));
        });
    }
}

fn nearer(stage: &mut Stage<'_>, scene: &Scene, leave_out: f32, (scheme, is_all): (&str, bool)) {
    let (at, next) = (5, 6);
    let photograph = stage.images.picture(at);
    let [camera, other] = [at, next].map(|view: usize| scene.views[view].camera);
    let step = other.pose.distance(&camera.pose);
    let beside = camera.pose.centre_world() - camera.pose.down_world() * step;
    let weighting = Weighting::open(scheme).expect("a scheme");
    stage.weigh(&weighting, &Silent).expect("weighed");
    for (way, to, ahead) in [
        ("between", other.pose.centre_world(), other.pose.forward_world()),
        ("beside", beside, camera.pose.forward_world()),
    ] {
        let frames = AWAY.map(|share| frame(stage, &weighting, away(&camera, to, ahead, share)));
        let scores = frames.each_ref().map(|frame| psnr_of_seen(&frame.picture, &photograph, None));
        let way = format!("{scheme}, {leave_out} dropped, {way}");
        println!("{way}: {scores:.1?}");
        let worst = scores.windows(2).map(|pair| pair[0] - pair[1]).fold(f64::MIN, f64::max);
        assert!(worst <= MAX_LOSS, "{way}: {worst:.1} dB lost on the way, {scores:.1?}");
        if let ([.., at], true, Some(seen)) = (&scores[..], is_all, frames[AWAY.len() - 1].seen) {
            assert!(*at >= MIN_AT, "{scheme}: {at:.1} dB at the photograph");
            assert!(seen.by_none + seen.by_one < 1.0 - MIN_CONFIRMED, "{scheme}: {seen:?} at the photograph");
        }
    }
}
