//! Views of synthetic objects in memory, and the field run on them from end to end.

use image::RgbaImage;
use std::sync::Arc;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::render::{RenderOptions, Stage};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::field::{FieldError, On, Rendered};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse::weighting::Weighting;
use viewfuse::weighting::sources::{MAX_SOURCES, SourceWeights};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::sources::Sources;
use viewfuse_core::weights::Weights;
use viewfuse_lab::scenes::toy::{lorry, training_cameras};
use viewfuse_lab::scenes::{Finish, Object, Orbit, Part, Placement, Shape, Texture, render};

/// The sphere's radius, around the origin.
pub(crate) const RADIUS: f32 = 0.4;

/// Everything about a run that a test may change.
#[derive(Clone)]
pub(crate) struct Run {
    pub(crate) field: TrainingFree,
    pub(crate) scheme: &'static str,
    pub(crate) early_termination: f32,
}

impl Default for Run {
    fn default() -> Run {
        Run { field: TrainingFree::default(), scheme: "error:alpha=1", early_termination: 1.0 / 256.0 }
    }
}

impl Run {
    /// The target's picture from the sources.
    pub(crate) fn picture(&self, sources: &SourceImages, target: &Camera) -> Result<Rendered, FieldError> {
        let quiet = Silent;
        let weighting = Weighting::open(self.scheme).expect("a scheme");
        let renderer = On { device: &Cpu, field: &self.field };
        let options = RenderOptions::default();
        let mut stage = Stage::of_sources(Arc::new(sources.clone()), &renderer, &options, &quiet)?;
        stage.weigh_by(&relevance(sources, &weighting), &quiet)?;
        let all: Vec<_> = sources.images.iter().map(|image| image.camera.pose).collect();
        let all = Sources::<MAX_SOURCES>::new(&all).expect("sources");
        let weights = weighting.weigh(&all, &target.pose);
        stage.picture(target, &weights, self.early_termination, &quiet)
    }
}

/// The weights of all sources for each as a target; its own is 0.
fn relevance(sources: &SourceImages, weighting: &Weighting) -> Vec<SourceWeights> {
    let poses: Vec<_> = sources.images.iter().map(|image| image.camera.pose).collect();
    (0..poses.len())
        .map(|own| {
            let mut others = poses.clone();
            others.remove(own);
            let others = Sources::<MAX_SOURCES>::new(&others).expect("two sources or more");
            let mut scores = weighting.weigh(&others, &poses[own]).values().to_vec();
            scores.insert(own, 0.0);
            let scores: [f32; MAX_SOURCES] = std::array::from_fn(|view| scores[view]);
            Weights::from_scores(&scores, poses.len() as u32)
        })
        .collect()
}

/// A photograph as a source.
pub(crate) fn source(camera: Camera, pixels: &RgbaImage) -> SourceImage {
    let level = |value: u8| f32::from(value) / 255.0;
    let texels = pixels
        .pixels()
        .map(|pixel| {
            let alpha = level(pixel[3]);
            [level(pixel[0]) * alpha, level(pixel[1]) * alpha, level(pixel[2]) * alpha, alpha]
        })
        .collect();
    SourceImage { camera, texels }
}

/// An object seen by cameras, on white.
pub(crate) fn views(object: &Object, cameras: &[Camera]) -> SourceImages {
    let images = cameras.iter().map(|camera| source(*camera, &render(object, camera))).collect();
    SourceImages {
        images,
        background: [1.0; 3],
        has_silhouettes: true,
        points: Vec::new(),
        near_far: None,
        warnings: Vec::new(),
    }
}

/// A ball around the origin with a pattern all over it.
pub(crate) fn ball() -> Object {
    let colours = [Vec3::new(0.9, 0.3, 0.1), Vec3::new(0.1, 0.4, 0.8)];
    let texture = Texture::Mottle { colours, cell: Vec3::splat(0.06), seed: 3 };
    let finish = Finish { texture, gloss: 0.0 };
    let part = Part { shape: Shape::Sphere { radius: RADIUS }, placement: Placement::at(0.0, 0.0, 0.0), finish };
    Object::new(vec![part]).expect("a sound ball")
}

/// Cameras at distance 1.3 with square pictures.
pub(crate) fn orbit(side: u32) -> Orbit {
    let pinhole = Pinhole::new([1.025 * side as f32; 2], [0.5 * side as f32; 2], side, side);
    Orbit { radius: 1.3, pinhole: pinhole.expect("sound intrinsics") }
}

/// The ball from 16 sides.
pub(crate) fn ball_views(side: u32) -> SourceImages {
    views(&ball(), &orbit(side).spiral(16, [-0.8, 0.9]).expect("cameras off the pole"))
}

/// The sample's lorry from a third of its places, in small.
pub(crate) fn lorry_views(side: u32) -> SourceImages {
    let cameras: Vec<Camera> = training_cameras()
        .expect("training cameras")
        .into_iter()
        .step_by(3)
        .map(|camera| Camera { pinhole: orbit(side).pinhole, ..camera })
        .collect();
    views(&lorry().expect("the lorry"), &cameras)
}

/// A camera that is none of the sources.
pub(crate) fn target(side: u32) -> Camera {
    orbit(side).camera(2.0, 0.35).expect("a camera off the pole")
}

/// Largest difference of any channel of any pixel.
pub(crate) fn largest_difference(a: &Rendered, b: &Rendered) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    differences(a, b).fold(0.0, f32::max)
}

/// Share of pixels no channel of which differs by more than `bound`.
pub(crate) fn share_within(a: &Rendered, b: &Rendered, bound: f32) -> f64 {
    let within = differences(a, b).filter(|difference| *difference <= bound).count();
    within as f64 / a.colours.len() as f64
}

fn differences<'a>(a: &'a Rendered, b: &'a Rendered) -> impl Iterator<Item = f32> + 'a {
    a.colours.iter().zip(&b.colours).map(|(a, b)| {
        let channels = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        channels.fold(0.0, |largest, difference| if difference <= largest { largest } else { difference })
    })
}

/// The picture shows something and something else.
pub(crate) fn assert_shows_an_object(picture: &Rendered) {
    let opaque = picture.colours.iter().filter(|colour| colour[3] > 0.9).count();
    let empty = picture.colours.iter().filter(|colour| colour[3] < 0.1).count();
    assert!(opaque * 20 > picture.colours.len(), "{opaque} opaque pixels");
    assert!(empty * 20 > picture.colours.len(), "{empty} empty pixels");
}

/// Nothing is NaN or infinite, colours lie in their range.
pub(crate) fn assert_sound(picture: &Rendered) {
    let in_range = |value: &f32| (-1.0e-5..=1.0 + 1.0e-5).contains(value);
    assert!(picture.colours.iter().all(|colour| colour.iter().all(in_range)), "a colour out of range or not finite");
    assert!(picture.depths.iter().all(|depth| depth.is_finite() && *depth >= 0.0), "a depth that is not finite");
    assert_eq!(picture.colours.len(), (picture.width * picture.height) as usize);
}
