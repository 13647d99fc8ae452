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
use viewfuse_tests::fields::{self, assert_sound, largest_difference};
use viewfuse_tests::lorry::{orbit, photographs, target};

/// Width of the made networks.
const WIDTH: usize = 16;

/// A body in empty space.
pub(super) fn body(options: PixelNerfOptions) -> PixelNerf {
    PixelNerf::new(&test_networks::body(&Architecture::small(WIDTH)), options).expect("a made network")
}

/// Space full of mist.
pub(super) fn mist(options: PixelNerfOptions) -> PixelNerf {
    PixelNerf::new(&test_networks::deterministic(&Architecture::small(WIDTH)), options).expect("a made network")
}

fn omitting(omissions: Omissions) -> PixelNerfOptions {
    PixelNerfOptions { omissions, ..PixelNerfOptions::default() }
}

pub(super) fn exact() -> PixelNerfOptions {
    omitting(Omissions::NONE)
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
fn is_not_finite(field: &PixelNerf, sources: &SourceImages, weights: &SourceWeights, target: &Camera) -> bool {
    let outcome = fields::picture(&Cpu, field, sources, weights, target, 0.0, &Silent);
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
