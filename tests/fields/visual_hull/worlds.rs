//! Views of synthetic objects in memory, and the field run on them from end to end.

use viewfuse::field::{AnyField, FieldError, Rendered};
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_lab::scenes::toy::{lorry, training_cameras};
use viewfuse_lab::scenes::{Finish, Object, Part, Placement, Shape, Texture, sources};
use viewfuse_tests::fields::weighted_picture;
use viewfuse_tests::lorry::orbit;

/// The sphere's radius, around the origin.
pub(crate) const RADIUS: f32 = 0.4;

/// The target's picture from the sources, with the usual options.
pub(crate) fn rendered(sources: &SourceImages, target: &Camera) -> Result<Rendered, FieldError> {
    weighted_picture(&AnyField::default(), "error:alpha=1", sources, target, 1.0 / 256.0)
}

/// A ball around the origin with a pattern all over it.
pub(crate) fn ball() -> Object {
    let colours = [Vec3::new(0.9, 0.3, 0.1), Vec3::new(0.1, 0.4, 0.8)];
    let texture = Texture::Mottle { colours, cell: Vec3::splat(0.06), seed: 3 };
    let finish = Finish { texture, gloss: 0.0 };
    let part = Part { shape: Shape::Sphere { radius: RADIUS }, placement: Placement::at(0.0, 0.0, 0.0), finish };
    Object::new(vec![part])
}

/// The ball from 16 sides.
pub(crate) fn ball_views(side: u32) -> SourceImages {
    sources(&ball(), &orbit(side).spiral(16, [-0.8, 0.9]).expect("cameras off the pole"))
}

/// The sample's lorry from a third of its places, in small.
pub(crate) fn lorry_views(side: u32) -> SourceImages {
    let cameras: Vec<Camera> = training_cameras()
        .expect("training cameras")
        .into_iter()
        .step_by(3)
        .map(|camera| Camera { pinhole: orbit(side).pinhole, ..camera })
        .collect();
    sources(&lorry(), &cameras)
}

/// The picture shows something and something else.
pub(crate) fn assert_shows_an_object(picture: &Rendered) {
    let opaque = picture.colours.iter().filter(|colour| colour[3] > 0.9).count();
    let empty = picture.colours.iter().filter(|colour| colour[3] < 0.1).count();
    assert!(opaque * 20 > picture.colours.len(), "{opaque} opaque pixels");
    assert!(empty * 20 > picture.colours.len(), "{empty} empty pixels");
}
