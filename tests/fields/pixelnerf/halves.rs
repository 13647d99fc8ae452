//! Latents in half precision (f16): what they cost and what they save.

use super::{Omissions, body, largest_difference, mist, omitting, recorded, sources, target};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::pixelnerf::PixelNerf;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::line;

const SIDE: u32 = 32;

/// Latents on the grid and at points, in full and in half precision.
fn both(latent_layers: bool) -> [Omissions; 2] {
    [false, true].map(|half_latents| Omissions { latent_layers, half_latents, ..Omissions::NONE })
}

/// What is looked up are means of four latents: off by no more than one is. The rest of the network may grow that;
/// measured are 2.1e-3 for the mist with layers on the grid, 3.1e-3 at points, and 6e-5 for the body.
#[test]
fn pictures_hardly_change() {
    let (sources, target) = (sources(3), target(24));
    for latent_layers in [true, false] {
        for field in [mist as fn(_) -> _, body] {
            let [whole, halves] = both(latent_layers)
                .map(|omissions| recorded(&field(omitting(omissions)), &sources, &Weights::mean(3), &target, 0.0).0);
            let difference = largest_difference(&whole.colours, &halves.colours);
            // A fine sample may fall into the next part where two sums round apart.
            assert!(difference > 0.0 && difference < 1.0e-2, "{difference}");
        }
    }
}

#[test]
fn half_the_memory() {
    let sources = sources(3);
    for latent_layers in [true, false] {
        let [whole, halves] = both(latent_layers).map(|omissions| mist(omitting(omissions)));
        let bytes = |field: &PixelNerf| {
            let (_, record) = recorded(field, &sources, &Weights::mean(3), &target(8), 0.0);
            line(&record, "latent bytes")
        };
        let (kept, saved) = (bytes(&whole), bytes(&halves));
        assert_eq!((kept.switch, kept.left_out), (false, 0));
        assert_eq!((saved.switch, saved.left_out * 2, saved.of), (true, kept.of, kept.of));
        // A grid has half of the image's rows and columns.
        let architecture = whole.architecture();
        let channels = match latent_layers {
            true => 2 * architecture.injected_count * architecture.width,
            false => architecture.latent_channels(),
        };
        assert_eq!(kept.of, 3 * u64::from(SIDE * SIDE / 4) * 4 * channels as u64);
        // Before anything is there, every further view costs less by as much.
        let per_view = |field: &PixelNerf| {
            let estimate = |count| field.memory_estimate(&Cpu, &vec![[SIDE; 2]; count]);
            (estimate(257) - estimate(1)) / 256
        };
        let saved_a_view = per_view(&whole) - per_view(&halves);
        assert!(saved_a_view.abs_diff(kept.of / 6) <= 64, "{saved_a_view} of {}", kept.of / 3);
    }
}
