//! PixelNeRF as a whole, on the CPU, with small made networks.

mod extremes;
mod halves;
mod omissions;
mod sizes;
mod visibility;

use viewfuse::device::cpu::Cpu;
use viewfuse::field::FieldError;
use viewfuse::field::pixelnerf::{Architecture, Omissions, PixelNerf, PixelNerfOptions, test_networks};
use viewfuse::field::{Field, Record, Rendered, SourceSide};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::sources::SourceWeights;
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields;
use viewfuse_tests::lorry::{orbit, photographs, target};

/// Width of the made networks.
const WIDTH: usize = 16;

/// A body in empty space.
fn body(options: PixelNerfOptions) -> PixelNerf {
    PixelNerf::new(&test_networks::body(&Architecture::small(WIDTH)), options).expect("a made network")
}

/// Space full of mist.
fn mist(options: PixelNerfOptions) -> PixelNerf {
    PixelNerf::new(&test_networks::deterministic(&Architecture::small(WIDTH)), options).expect("a made network")
}

fn leaving_out(omissions: Omissions) -> PixelNerfOptions {
    PixelNerfOptions { omissions, ..PixelNerfOptions::default() }
}

fn exact() -> PixelNerfOptions {
    leaving_out(Omissions::NONE)
}

/// The lorry from some sides, on white.
fn sources(count: u32) -> SourceImages {
    photographs(count, 32)
}

fn picture_with(
    field: &PixelNerf,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
    early_termination: f32,
) -> Rendered {
    recorded(field, sources, weights, target, early_termination).0
}

/// Whether there is no picture, because the network's outputs are not finite.
fn is_not_finite(
    field: &PixelNerf,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
    early_termination: f32,
) -> bool {
    let outcome = fields::picture(&Cpu, field, sources, weights, target, early_termination, &Silent);
    matches!(outcome, Err(FieldError::NotFinite(_)))
}

/// A picture, and what the field says of it.
fn recorded(
    field: &PixelNerf,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
    early_termination: f32,
) -> (Rendered, Record) {
    fields::picture(&Cpu, field, sources, weights, target, early_termination, &Silent).expect("a picture")
}

fn picture(field: &PixelNerf, sources: &SourceImages, target: &Camera) -> Rendered {
    picture_with(field, sources, &Weights::mean(sources.images.len() as u32), target, 1.0 / 256.0)
}

/// Largest difference of any channel of any pixel; NaN if there is one.
fn largest_difference(a: &Rendered, b: &Rendered) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let differences = a.colours.iter().flatten().zip(b.colours.iter().flatten()).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, |largest, difference| if difference <= largest { largest } else { difference })
}

fn assert_sound(picture: &Rendered) {
    let in_range = |value: &f32| (-1.0e-5..=1.0 + 1.0e-5).contains(value);
    assert!(picture.colours.iter().flatten().all(in_range), "a colour out of range or not finite");
    assert!(picture.depths.iter().all(|depth| depth.is_finite() && *depth >= 0.0), "a depth that is not finite");
    assert_eq!(picture.colours.len(), (picture.width * picture.height) as usize);
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let sources = sources(3);
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a thread pool");
        pool.install(|| picture(&body(PixelNerfOptions::default()), &sources, &target(24)))
    };
    let one = with_threads(1);
    assert_sound(&one);
    let opaque = one.colours.iter().filter(|colour| colour[3] > 0.9).count();
    let empty = one.colours.iter().filter(|colour| colour[3] == 0.0).count();
    assert!(opaque > 30 && empty > 200, "a body before nothing: {opaque} opaque and {empty} empty pixels");
    assert_eq!(one, with_threads(2), "bit for bit");
    assert_eq!(one, with_threads(3), "bit for bit");
}

#[test]
fn the_seed_decides() {
    let sources = sources(2);
    let with_seed = |seed| {
        let mut options = exact();
        options.sampling.seed = seed;
        picture(&mist(options), &sources, &target(16))
    };
    assert_eq!(with_seed(1), with_seed(1));
    let difference = largest_difference(&with_seed(1), &with_seed(1 << 40));
    assert!(difference > 1.0e-4, "seeds that differ in their high words only: {difference}");
    assert!(difference < 0.2, "samples move by a part of a ray, not more: {difference}");
}

#[test]
fn the_order_of_the_sources_is_only_rounding() {
    let sources = sources(3);
    let reversed = SourceImages { images: sources.images.iter().rev().cloned().collect(), ..sources.clone() };
    let weights = |scores: [f32; 3]| {
        let mut all = [0.0; viewfuse::weighting::sources::MAX_SOURCES];
        all[..3].copy_from_slice(&scores);
        Weights::from_scores(&all, 3)
    };
    let field = mist(exact());
    let one = picture_with(&field, &sources, &weights([0.6, 0.3, 0.1]), &target(16), 0.0);
    let other = picture_with(&field, &reversed, &weights([0.1, 0.3, 0.6]), &target(16), 0.0);
    let difference = largest_difference(&one, &other);
    println!("sources in reverse: {difference:.1e}");
    // A fine sample may fall into the next part where two sums round apart; it then moves by a 64th of the ray.
    assert!(difference < 2.0e-3, "{difference}");
    let unweighted = picture_with(&field, &sources, &Weights::mean(3), &target(16), 0.0);
    assert!(largest_difference(&one, &unweighted) > 1.0e-3, "weights change nothing");
}

#[test]
fn the_size_of_the_sources_is_the_networks_not_the_pictures() {
    let field = body(PixelNerfOptions::default());
    assert_eq!(field.about().source_side, SourceSide::Pixels(128));
    // The same place in a picture of twice the size has the same colour, up to sampling.
    let sources = sources(2);
    let (small, large) = (picture(&field, &sources, &target(16)), picture(&field, &sources, &target(32)));
    let opacity = |picture: &Rendered| {
        picture.colours.iter().map(|colour| f64::from(colour[3])).sum::<f64>() / picture.colours.len() as f64
    };
    assert!((opacity(&small) - opacity(&large)).abs() < 0.03, "{} and {}", opacity(&small), opacity(&large));
}
