//! What holds for every field, on the CPU.

use super::{genvs, pixelnerf, plane_sweep};
use viewfuse::check::verify;
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::field::genvs::sampling::Plan;
use viewfuse::field::pixelnerf::PixelNerfOptions;
use viewfuse::field::rows::ROWS;
use viewfuse::field::{AnyField, FieldError, Rendered};
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_tests::fields::{assert_sound, largest_difference, share_within, weighted_picture};
use viewfuse_tests::lorry::{photographs, target};

/// A field, photographs for it, and a camera that is none of theirs.
struct Subject {
    name: &'static str,
    field: AnyField,
    sources: SourceImages,
    target: Camera,
}

impl Subject {
    fn picture_from(&self, sources: &SourceImages) -> Result<Rendered, FieldError> {
        weighted_picture(&self.field, "error:alpha=1", sources, &self.target, 1.0 / 256.0)
    }

    fn picture(&self) -> Rendered {
        self.picture_from(&self.sources).expect("a picture")
    }
}

fn subjects() -> Vec<Subject> {
    let subject = |name, field, sources, target| Subject { name, field, sources, target };
    let body = AnyField::new(pixelnerf::body(PixelNerfOptions::default()));
    let mist = AnyField::new(pixelnerf::mist(pixelnerf::exact()));
    let features = AnyField::new(genvs::without_denoiser(genvs::exact()));
    let aside = plane_sweep::camera(Vec3::new(0.1, 0.1, 0.0), 72, 54);
    vec![
        subject("pixelnerf, body", body, photographs(3, 32), target(24)),
        subject("pixelnerf, mist", mist, photographs(3, 32), target(16)),
        subject("genvs", AnyField::new(genvs::made(genvs::exact())), photographs(2, 32), target(32)),
        subject("genvs without denoiser", features, photographs(3, 32), target(32)),
        subject("hull", AnyField::default(), photographs(7, 48), target(48)),
        subject("sweep", AnyField::default(), plane_sweep::wall([1.0; 3]), aside),
    ]
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    // The mist is nearly of one colour.
    for subject in subjects().into_iter().filter(|subject| subject.name != "pixelnerf, mist") {
        let with_threads = |count| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a thread pool");
            pool.install(|| subject.picture())
        };
        let one = with_threads(1);
        assert_sound(&one);
        let mean = one.colours.iter().map(|colour| colour[0]).sum::<f32>() / one.colours.len() as f32;
        let spread = one.colours.iter().map(|colour| (colour[0] - mean).abs()).sum::<f32>() / one.colours.len() as f32;
        assert!(spread > 1.0e-3, "{}: a picture of one colour", subject.name);
        for count in [2, 3] {
            assert!(one == with_threads(count), "{}: other bits with {count} threads", subject.name);
        }
    }
}

/// A plane, a sample or a part may change where two sums round apart: a few pixels then differ by more than rounding.
#[test]
fn the_order_of_the_sources_is_only_rounding() {
    for subject in subjects() {
        let SourceImages { images, .. } = &subject.sources;
        let with = |images: Vec<SourceImage>| subject.picture_from(&SourceImages { images, ..subject.sources.clone() });
        let one = subject.picture();
        let reversed = with(images.iter().rev().cloned().collect()).expect("a picture");
        let same = share_within(&one.colours, &reversed.colours, 2.0e-3);
        assert!(same >= 0.99, "{}: only {same} of the pixels are the same", subject.name);
        // With each other's cameras they show something else, or nothing.
        let next = images.iter().cycle().skip(1);
        let wrong = with(
            images.iter().zip(next).map(|(image, next)| SourceImage { camera: next.camera, ..image.clone() }).collect(),
        );
        let same = wrong.map_or(0.0, |wrong| share_within(&one.colours, &wrong.colours, 1.0e-4));
        assert!(same < 0.99, "{}: mixed-up cameras pass", subject.name);
    }
}

#[test]
fn the_seed_decides() {
    let of_pixelnerf = |seed| {
        let mut options = pixelnerf::exact();
        options.sampling.seed = seed;
        AnyField::new(pixelnerf::mist(options))
    };
    let of_genvs = |seed| {
        let options = genvs::exact();
        let plan = Plan { seed, ..options.plan };
        AnyField::new(genvs::made(GenvsOptions { plan, ..options }))
    };
    let seeded: [(&str, &dyn Fn(u64) -> AnyField); 2] = [("pixelnerf", &of_pixelnerf), ("genvs", &of_genvs)];
    for (name, seeded) in seeded {
        let picture =
            |seed| Subject { name, field: seeded(seed), sources: photographs(2, 32), target: target(16) }.picture();
        assert!(picture(1) == picture(1), "{name}");
        let difference = largest_difference(&picture(1).colours, &picture(1 << 40).colours);
        assert!(difference > 1.0e-4, "{name}: seeds that differ in their high words only: {difference}");
    }
}

/// Sources and targets that nobody would choose: learned fields give a sound picture.
#[test]
fn learned_fields_stand_any_sources_and_targets() {
    for field in
        [AnyField::new(pixelnerf::mist(PixelNerfOptions::default())), AnyField::new(genvs::made(genvs::exact()))]
    {
        let picture = |sources: &SourceImages, target: Camera| {
            let picture = weighted_picture(&field, "mean", sources, &target, 0.0).expect("a picture");
            assert_sound(&picture);
            assert_eq!([picture.width, picture.height], [target.pinhole.width(), target.pinhole.height()]);
        };
        for count in [1, 32] {
            picture(&photographs(count, 32), target(12));
        }
        let sources = photographs(3, 32);
        let with = |images: Vec<SourceImage>| SourceImages { images, ..sources.clone() };
        picture(&with(vec![sources.images[0].clone(); 3]), target(12));
        for colour in [[0.0, 0.0, 0.0, 1.0], [1.0; 4], [0.0; 4]] {
            let flat = |image: &SourceImage| SourceImage { texels: vec![colour; image.texels.len()], ..*image };
            picture(&with(sources.images.iter().map(flat).collect()), target(12));
        }
        // From a source's place; and from among them, so that points of rays lie behind some, at the centre of none.
        picture(&sources, Camera { pinhole: target(12).pinhole, ..sources.images[1].camera });
        let away = Pose::look_at(Vec3::new(0.9, 0.1, 0.2), Vec3::new(5.0, 0.3, 0.4), Vec3::Z).expect("a pose");
        picture(&sources, Camera { pose: away, ..target(12) });
        for (width, height) in [(1, 1), (33, 1), (1, 9), (100, 75)] {
            let pinhole = target(32).pinhole.resized(width, height).expect("a size");
            picture(&sources, Camera { pinhole, ..target(32) });
        }
    }
}

#[test]
fn every_learned_field_has_reference_values() {
    let learned: Vec<&str> = ROWS.iter().filter(|row| row.prefix().is_some()).map(|row| row.name).collect();
    assert_eq!(verify::fields(), learned);
}
