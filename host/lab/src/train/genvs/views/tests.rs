//! Sources of a GeNVS show what their cameras say.

use super::super::super::gradient_check::{numbers, scene};
use super::{Draw, ObjectViews, SourceDraw, ViewCounts};
use candle_core::DType;

/// Three sources and a target of each of two objects of 32 pixels.
fn views(least_crop: f32) -> ObjectViews {
    let counts = ViewCounts { sources: SourceDraw { least_crop, ..SourceDraw::whole(3) }, targets: 1 };
    ObjectViews::of(&[&scene(32, 6), &scene(32, 7)], &Draw { seed: 5, step: 1 }, counts, DType::F32).expect("views")
}

#[test]
fn cropped_sources_keep_their_side_and_change_their_cameras_only() {
    let [whole, cropped] = [1.0, 0.5].map(views);
    assert_eq!((whole.pictures.dims(), cropped.pictures.dims()), (&[6, 32, 32, 3][..], &[6, 32, 32, 3][..]));
    assert_ne!(numbers::<f32>(&whole.pictures), numbers::<f32>(&cropped.pictures));
    assert_eq!(numbers::<f32>(&whole.truth), numbers::<f32>(&cropped.truth));
    for (whole, cropped) in whole.sources.iter().flatten().zip(cropped.sources.iter().flatten()) {
        assert_eq!(whole.pose, cropped.pose);
        // A part at the whole's size is seen through a longer lens.
        assert!(cropped.pinhole.focal()[0] >= whole.pinhole.focal()[0]);
    }
    let blocks = |views: &ObjectViews| views.sources.iter().flatten().map(|camera| camera.block(0)).collect::<Vec<_>>();
    assert_eq!(cropped.cameras.concat(), blocks(&cropped));
    assert_ne!(blocks(&cropped), blocks(&whole));
}
