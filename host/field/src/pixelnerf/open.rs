//! The row of PixelNeRF, and how its network is opened with a person's options.

use super::{Omissions, PixelNerf, PixelNerfOptions, Sampling, presets, test_networks};
use crate::AnyField;
use crate::learned::NEAR_FAR;
use crate::options::{BOUNDS_OR_EXACT, FieldOptions, Flag, FlagAbout, OpenError, count, list, number};
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
            TestNetwork {
                name: "formula",
                small: Small::Width,
                checkpoint: test_networks::deterministic_of_width,
            },
            TestNetwork { name: "body", small: Small::Width, checkpoint: test_networks::body_of_width },
        ],
        open,
    },
    flags: &[
        Flag::new(
            SAMPLES,
            "N,N,N|N",
            "Samples on a ray of a PixelNeRF: in the first pass, in the second pass by weight, and in the second pass around \
             the depth [default: 64,16,16]",
            |text| parse_samples(text).map(drop),
        ),
        NEAR_FAR,
        Flag::switch(
            PUBLISHED_DEPTH,
            "Place second-pass samples around the depth of the published code (the sum of weights times depths, too near \
             on rays that are not opaque) instead of the mean depth",
        ),
        Flag::new(
            PROBE_STEP,
            "PIXELS",
            "Probe one ray in every square of this many pixels on a side for empty space [default: 4]",
            |text| parse_step(text).map(drop),
        )
        .about(FlagAbout::Effort, BOUNDS_OR_EXACT),
        Flag::new(
            PROBE_ERROR,
            "ERROR",
            "Raise the threshold of empty space while the probes' colours change by at most this, root mean square; 1 is \
             from black to white [default: 1/128]",
            |text| parse_error(text).map(drop),
        )
        .about(FlagAbout::Effort, BOUNDS_OR_EXACT),
        Flag::switch(
            HALF_LATENTS,
            "Keep the latents that points look up in half precision (f16): half of their memory",
        )
        .about(FlagAbout::Effort, BOUNDS_OR_EXACT),
    ],
    omissions: &[LAYERS, BEHIND, SPACE, RAYS, PARTS, HIDDEN],
    presets: presets::of,
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
    typical_error: "surfaces that the first pass missed; those behind have at most the transmittance of early termination",
};
const PARTS: Omission = Omission { name: "parts", part: "in empty parts of rays", ..RAYS };
const HIDDEN: Omission = Omission { name: "hidden", part: "behind surfaces", ..RAYS };

const SAMPLES: &str = "samples";
const PUBLISHED_DEPTH: &str = "published-depth";
const PROBE_STEP: &str = "probe-step";
const PROBE_ERROR: &str = "probe-error";
const HALF_LATENTS: &str = "half-latents";

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

/// Opens the network with these options.
fn open(checkpoint: Checkpoint, options: &FieldOptions) -> Result<AnyField, OpenError> {
    let default = Sampling::default();
    let [coarse_count, importance_count, depth_count] = options.value(SAMPLES, parse_samples).unwrap_or([
        default.coarse_count,
        default.importance_count,
        default.depth_count,
    ]);
    let sampling = Sampling {
        coarse_count,
        importance_count,
        depth_count,
        seed: options.seed,
        near_far: options.value(NEAR_FAR.name, crate::learned::parse_near_far),
        published_depth: options.is_given(PUBLISHED_DEPTH),
        ..default
    };
    let (usual, computes) = (Omissions::default(), |what| options.computes(what));
    let step = options.value(PROBE_STEP, parse_step).unwrap_or(usual.empty_space);
    let error = options.value(PROBE_ERROR, parse_error).unwrap_or(usual.probe_error);
    let omissions = Omissions {
        unused_views: !computes(VIEWS.name),
        latent_layers: !computes(LAYERS.name),
        half_latents: options.is_given(HALF_LATENTS),
        unseen_points: !computes(BEHIND.name),
        empty_space: if computes(SPACE.name) { 0 } else { step },
        probe_error: if options.exact { 0.0 } else { error },
        interpolation: usual.interpolation,
        nodes: usual.nodes,
        empty_rays: !computes(RAYS.name),
        empty_parts: !computes(PARTS.name),
        hidden_samples: !computes(HIDDEN.name),
    };
    Ok(AnyField::new(PixelNerf::new(&checkpoint, PixelNerfOptions { sampling, omissions })?))
}
