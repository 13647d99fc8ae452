//! The row of PixelNeRF, and how its network is opened with a person's options.

use super::{PixelNerf, PixelNerfOptions, test_networks, variants};
use crate::AnyField;
use crate::learned::{NEAR_FAR, parse_near_far};
use crate::options::{BOUNDS_OR_EXACT, Given, OpenError, count, flags, list, number, switch};
use crate::record::{Omission, VIEWS};
use crate::row::{Origin, Row, Small, TestNetwork};
use viewfuse_nn::checkpoint::Checkpoint;

/// PixelNeRF's row.
pub(crate) const ROW: Row = Row {
    name: "pixelnerf",
    title: "PixelNeRF",
    heading: "Options of PixelNeRF",
    origin: Origin::Learned {
        prefix: "encoder.model.",
        test_networks: &[
            TestNetwork { name: "formula", small: Small::Width, checkpoint: test_networks::deterministic_of_width },
            TestNetwork { name: "body", small: Small::Width, checkpoint: test_networks::body_of_width },
        ],
        open,
    },
    flags: FLAGS,
    omissions: &[LAYERS, BEHIND, SPACE, RAYS, PARTS, HIDDEN],
    drawn: variants::drawn,
};

pub(super) const LAYERS: Omission = Omission {
    name: "layers",
    what: "latent layers at points",
    part: "in place of once on the grid",
    typical_error: "rounding",
};
pub(super) const BEHIND: Omission = Omission {
    name: "behind",
    what: "views at points",
    part: "behind their cameras, where their weight is 0",
    typical_error: "nothing",
};
pub(super) const SPACE: Omission = Omission {
    name: "space",
    what: "first-pass samples",
    part: "in empty space",
    typical_error: "objects between the probes; see `viewfuse pareto`",
};
pub(super) const RAYS: Omission = Omission {
    name: "rays",
    what: "second-pass samples",
    part: "on empty rays",
    typical_error: "surfaces that the first pass missed; those behind have at most the transmittance of early \
        termination",
};
const PARTS: Omission = Omission { name: "parts", part: "in empty parts of rays", ..RAYS };
const HIDDEN: Omission = Omission { name: "hidden", part: "behind surfaces", ..RAYS };

flags! {
    PixelNerfOptions;
    "samples", "N,N,N|N", parse_samples, Picture, &[],
        "Samples on a ray of a PixelNeRF: in the first pass, in the second pass by weight, and in the second pass \
         around the depth [default: 64,16,16]",
        |options, counts: [u32; 3]| {
            let sampling = &mut options.sampling;
            [sampling.coarse_count, sampling.importance_count, sampling.depth_count] = counts;
        };
    "near-far", "NEAR,FAR", parse_near_far, Picture, &[], NEAR_FAR, |options,
    bounds| options.sampling.near_far = Some(bounds);
    "published-depth", "", switch, Picture, &[],
        "Place second-pass samples around the depth of the published code (the sum of weights times depths, too \
         near on rays that are not opaque) instead of the mean depth",
        |options, ()| options.sampling.published_depth = true;
    "probe-step", "PIXELS", parse_step, Effort, BOUNDS_OR_EXACT,
        "Probe one ray in every square of this many pixels on a side for empty space [default: 4]",
        |options, step| options.omissions.empty_space = step;
    "probe-error", "ERROR", parse_error, Effort, BOUNDS_OR_EXACT,
        "Raise the threshold of empty space while the probes' colours change by at most this, root mean square; 1 \
         is from black to white [default: 1/128]",
        |options, error| options.omissions.probe_error = error;
    "half-latents", "", switch, Effort, BOUNDS_OR_EXACT,
        "Keep the latents that points look up in half precision (f16): half of their memory",
        |options, ()| options.omissions.half_latents = true;
}

/// In the first pass, in the second by weight, and in the second around the depth.
fn parse_samples(text: &str) -> Result<[u32; 3], String> {
    let counts: Option<[u32; 3]> = list(text).and_then(|counts| counts.try_into().ok());
    let fits = |counts: &[u32; 3]| counts[0] >= 1 && counts.iter().all(|count| *count <= 1024);
    counts.filter(fits).ok_or_else(|| "three numbers up to 1024, the first at least 1, for example 64,16,16".to_owned())
}

fn parse_step(text: &str) -> Result<u32, String> {
    count(text, 2..=64)
}

fn parse_error(text: &str) -> Result<f32, String> {
    number(text, |error| (0.0..1.0).contains(&error), "a number, at least 0 and less than 1")
}

/// Opens the network with what is given.
fn open(checkpoint: Checkpoint, given: &Given) -> Result<AnyField, OpenError> {
    let mut options = taken(given, PixelNerfOptions::default());
    options.sampling.seed = given.seed;
    let omissions = &mut options.omissions;
    omissions.unused_views = !given.computes(&VIEWS);
    omissions.latent_layers = !given.computes(&LAYERS);
    omissions.unseen_points = !given.computes(&BEHIND);
    omissions.empty_rays = !given.computes(&RAYS);
    omissions.empty_parts = !given.computes(&PARTS);
    omissions.hidden_samples = !given.computes(&HIDDEN);
    if given.computes(&SPACE) {
        omissions.empty_space = 0;
    }
    if given.exact {
        omissions.probe_error = 0.0;
    }
    Ok(AnyField::new(PixelNerf::new(&checkpoint, options)?))
}
