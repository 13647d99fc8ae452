//! Sources of a GeNVS show what their cameras say, and are weighted for their target.

use super::super::super::gradient_check::scene;
use super::{Draw, SourceDraw, ViewCounts, Views};
use candle_core::{DType, Tensor};
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

/// Three sources and a target of each of two objects of 32 pixels.
fn views(least_crop: f32) -> Views {
    let counts = ViewCounts { sources: SourceDraw { least_crop, ..SourceDraw::whole(3) }, targets: 1 };
    Views::of(&[&scene(32, 6), &scene(32, 7)], &Draw { seed: 5, step: 1 }, counts, DType::F32).expect("views")
}

fn numbers(tensor: &Tensor) -> Vec<f32> {
    tensor.flatten_all().and_then(|all| all.to_vec1()).expect("numbers")
}

#[test]
fn cropped_sources_keep_their_side_and_change_their_cameras_only() {
    let [whole, cropped] = [1.0, 0.5].map(views);
    assert_eq!((whole.pictures.dims(), cropped.pictures.dims()), (&[6, 32, 32, 3][..], &[6, 32, 32, 3][..]));
    assert_ne!(numbers(&whole.pictures), numbers(&cropped.pictures));
    assert_eq!(numbers(&whole.truth), numbers(&cropped.truth));
    for (whole, cropped) in whole.sources.iter().flatten().zip(cropped.sources.iter().flatten()) {
        assert_eq!(whole.pose, cropped.pose);
        // A part at the whole's size is seen through a longer lens.
        assert!(cropped.pinhole.focal()[0] >= whole.pinhole.focal()[0]);
    }
    let blocks = |views: &Views| views.sources.iter().flatten().map(|camera| camera.block(0)).collect::<Vec<_>>();
    assert_eq!(cropped.cameras.concat(), blocks(&cropped));
    assert_ne!(blocks(&cropped), blocks(&whole));
}

#[test]
fn weights_are_those_of_the_scheme_for_the_first_target() {
    let views = views(1.0);
    let rows = |scheme| views.weights(scheme).and_then(|weights| weights.to_vec2::<f32>()).expect("weights");
    assert_eq!(rows(Scheme::MEAN), vec![vec![1.0 / 3.0; 3]; 2]);
    let scheme = Weighting::from(Scheme::ERROR);
    for ((own, sources), targets) in rows(Scheme::ERROR).iter().zip(&views.sources).zip(&views.target_cameras) {
        let poses: Vec<Pose> = sources.iter().map(|camera| camera.pose).collect();
        let poses = SourcePoses::new(&poses).expect("sources");
        assert_eq!(own, &scheme.weigh(&poses, &targets[0].pose).values()[..3]);
        assert!(own.iter().any(|weight| (weight - 1.0 / 3.0).abs() > 0.01), "{own:?}");
    }
}
