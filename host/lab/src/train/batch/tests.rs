//! Sources show what their cameras say.

use super::super::gradient_check::{numbers, scene};
use super::{Batch, Cut, SourceDraw, Targets};
use crate::train::draw::Draw;
use candle_core::DType;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

/// Three sources of each of two objects of 32 pixels.
fn batch(step: u32, drawn: SourceDraw) -> Batch {
    let scenes = [scene(32, 6), scene(32, 7)];
    Batch::of(&scenes, &[0, 1], &Draw { seed: 5, step }, 4, drawn, Targets::One, DType::F32).expect("a batch")
}

fn pictures(batch: &Batch) -> Vec<f32> {
    numbers(&batch.pictures)
}

/// A point is where it was, seen from the corner of the part, at the part's scale.
#[test]
fn a_part_of_a_picture_has_its_camera() {
    let scene = scene(32, 3);
    let (camera, picture) = scene.source(1, Cut { left: 5, top: 3, size: 24, side: 48 }).expect("a source");
    assert_eq!((picture.dimensions(), camera.pinhole.width(), camera.pinhole.height()), ((48, 48), 48, 48));
    for point in [[0.1, 0.2, -0.1], [-0.2, 0.05, 0.1], [0.0, 0.0, 0.0]] {
        let [whole, part] = [scene.cameras[1], camera].map(|camera| camera.project(point.into()));
        let [x, y] = [(whole.x - 5.0) * 2.0, (whole.y - 3.0) * 2.0];
        // Two roundings of coordinates below 64.
        assert!((part.x - x).abs() < 1.0e-5 && (part.y - y).abs() < 1.0e-5, "{part:?} instead of {x}, {y}");
        assert_eq!(part.depth, whole.depth);
    }
    // Not resampled, the pixels are the picture's own.
    let (_, part) = scene.source(1, Cut { left: 5, top: 3, size: 16, side: 16 }).expect("a source");
    assert!(part.enumerate_pixels().all(|(x, y, pixel)| pixel == scene.pictures[1].get_pixel(x + 5, y + 3)));
    let (same, whole) = scene.source(1, Cut { left: 0, top: 0, size: 32, side: 32 }).expect("a source");
    assert_eq!((same, &whole), (scene.cameras[1], &scene.pictures[1]));
}

#[test]
fn parts_lie_within_pictures_and_have_all_allowed_sizes() {
    let drawn = SourceDraw { count: 3, side: Some(16), least_crop: 0.5 };
    let (mut sizes, mut places) = (Vec::new(), Vec::new());
    for index in 0..2000 {
        let cut = drawn.cut(&Draw { seed: 1, step: 2 }, index, 32);
        assert!(cut.left + cut.size <= 32 && cut.top + cut.size <= 32 && cut.side == 16, "{cut:?}");
        sizes.push(cut.size);
        places.extend([cut.left, cut.top]);
    }
    let ends = |all: &[u32]| (all.iter().min().copied(), all.iter().max().copied());
    assert_eq!((ends(&sizes), ends(&places)), ((Some(16), Some(32)), (Some(0), Some(16))));
}

#[test]
fn whole_sources_are_the_photographs_and_others_have_their_size() {
    let whole = batch(1, SourceDraw::whole(3));
    assert_eq!(whole.pictures.dims(), [6, 32, 32, 3]);
    assert!(whole.sources.iter().flatten().all(|camera| camera.pinhole.width() == 32));
    let small = batch(1, SourceDraw { side: Some(16), ..SourceDraw::whole(3) });
    assert_eq!(small.pictures.dims(), [6, 16, 16, 3]);
    assert!(small.cameras.iter().flatten().all(|camera| [camera.width, camera.height] == [16, 16]));
    // Whole photographs, twice as small: about the same brightness. The truth and its rays are the same.
    let mean = |batch: &Batch| pictures(batch).iter().sum::<f32>() / pictures(batch).len() as f32;
    assert!((mean(&whole) - mean(&small)).abs() < 0.01);
    assert_eq!((&whole.rays, &whole.targets), (&small.rays, &small.targets));
    let cropped = batch(1, SourceDraw { least_crop: 0.5, ..SourceDraw::whole(3) });
    assert_ne!(pictures(&cropped), pictures(&whole));
    assert_eq!(pictures(&cropped), pictures(&batch(1, SourceDraw { least_crop: 0.5, ..SourceDraw::whole(3) })));
}

#[test]
fn weights_are_those_of_the_scheme_for_the_target() {
    let batch = batch(3, SourceDraw { least_crop: 0.5, ..SourceDraw::whole(3) });
    let rows = |scheme| batch.weights(scheme).and_then(|weights| weights.to_vec2::<f32>()).expect("weights");
    assert_eq!(rows(Scheme::MEAN), vec![vec![1.0 / 3.0; 3]; 2]);
    let scheme = Weighting::from(Scheme::ERROR);
    for ((row, sources), target) in rows(Scheme::ERROR).iter().zip(&batch.sources).zip(&batch.targets) {
        let poses: Vec<Pose> = sources.iter().map(|camera| camera.pose).collect();
        let poses = SourcePoses::new(&poses).expect("sources");
        assert_eq!(row, &scheme.weigh(&poses, &target.pose).values()[..3]);
        assert!(row.iter().any(|weight| (weight - 1.0 / 3.0).abs() > 0.01), "{row:?}");
    }
}
