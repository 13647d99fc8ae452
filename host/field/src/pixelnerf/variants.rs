//! The variants of a PixelNeRF: its efforts, from the cheapest to the exact one, and what `pareto` draws. A new one is
//! a line of a table here.

use super::PixelNerf;
use super::node_picture::MAX_NODES;
use super::options::{Omissions, PixelNerfOptions, Sampling};
use crate::AnyField;
use crate::render::RenderOptions;
use crate::rounding::{Rounding, rounded};
use crate::row::{ALL, Drawn};
use crate::variant::{EXACT, Variant};
use viewfuse_device::Precision;

/// Nodes between which samples are interpolated, in 64ths of the samples of the first pass, with the largest difference
/// between the rays around an interpolated pixel, the error that is typical of it and its typical work. Measured on the
/// included network (`host/results/efforts.md`).
const NODES: [(u32, f32, f32, f32); 9] = [
    (12, 0.25, 0.03, 0.01),
    (16, 0.2, 0.021, 0.012),
    (20, 0.2, 0.0167, 0.014),
    (24, 0.2, 0.0135, 0.017),
    (32, 0.15, 0.0092, 0.021),
    (36, 0.13, 0.0078, 0.024),
    (40, 0.12, 0.0068, 0.028),
    (48, 0.1, 0.0054, 0.04),
    (64, 0.06, 0.0036, 0.09),
];
/// What rounded products are typically worth. Errors: emulated on the network of the published size, 62.7 dB from the
/// exact picture and more than 90; times: what products take of a picture, at the rates of prototypes on a GPU
/// (`host/results/efforts.md`).
const ROUNDINGS: [Rounding; 3] = [
    Rounding { precision: Precision::Half, typical_error: 8e-4, typical_share: 0.4 },
    Rounding { precision: Precision::TwoHalves, typical_error: 3e-5, typical_share: 0.55 },
    // No coarser than two parts, which round more.
    Rounding { precision: Precision::Fused, typical_error: 3e-5, typical_share: 0.7 },
];

/// Both passes, without nodes.
const TWO_PASSES: [(&str, Omissions, f32, f32); 2] = [
    (
        "both passes, empty space omitted",
        Omissions { interpolation: 0.05, probe_error: 1.0 / 512.0, ..Omissions::ALL },
        0.0021,
        0.32,
    ),
    ("both passes, empty parts omitted", Omissions { interpolation: 0.02, ..PARTS }, 0.0014, 0.42),
];
/// Second-pass samples in empty parts of rays are left out; rays stay independent of one another.
const PARTS: Omissions = Omissions { empty_space: 0, ..Omissions::ALL };

const NONE: Omissions = Omissions::NONE;
const VIEWS: Omissions = Omissions { unused_views: true, ..NONE };
const PROBED: Omissions = Omissions { empty_space: 4, probe_error: 1.0 / 128.0, ..NONE };
const HIDDEN: Omissions = Omissions { hidden_samples: true, ..NONE };

/// Each of these alone, everything else exact. Words, what is omitted, `--leave-out`, `--early-termination`.
#[rustfmt::skip]
const ALONE: [(&str, Omissions, f32, f32); 18] = [
    ("unused views",    VIEWS,                                     0.0,  0.0),
    ("leave out 0.01",  VIEWS,                                     0.01, 0.0),
    ("leave out 0.05",  VIEWS,                                     0.05, 0.0),
    ("leave out 0.1",   VIEWS,                                     0.1,  0.0),
    ("latent layers",   Omissions { latent_layers: true, ..NONE }, 0.0,  0.0),
    ("half latents",    Omissions { half_latents: true, ..NONE },  0.0,  0.0),
    ("unseen points",   Omissions { unseen_points: true, ..NONE }, 0.0,  0.0),
    ("empty space, 2",  Omissions { empty_space: 2, ..NONE },      0.0,  0.0),
    ("empty space, 4",  Omissions { empty_space: 4, ..NONE },      0.0,  0.0),
    ("empty space, 8",  Omissions { empty_space: 8, ..NONE },      0.0,  0.0),
    ("probe error 1/128", PROBED,                                  0.0,  0.0),
    ("probe error 1/64", Omissions { probe_error: 1.0 / 64.0, ..PROBED }, 0.0, 0.0),
    ("empty rays",      Omissions { empty_rays: true, ..NONE },    0.0,  0.0),
    ("empty parts",     Omissions { empty_parts: true, ..NONE },   0.0,  0.0),
    ("hidden, 1/256",   HIDDEN,                                    0.0,  1.0 / 256.0),
    ("hidden, 1/64",    HIDDEN,                                    0.0,  1.0 / 64.0),
    ("hidden, 1/16",    HIDDEN,                                    0.0,  1.0 / 16.0),
    ("hidden, 1/4",     HIDDEN,                                    0.0,  1.0 / 4.0),
];

/// All but each of these, because omissions that are harmless alone may not be so together. Words as
/// `--compute` takes them.
#[rustfmt::skip]
const ALL_BUT: [(&str, Omissions); 7] = [
    ("views",  Omissions { unused_views: false, ..Omissions::ALL }),
    ("layers", Omissions { latent_layers: false, ..Omissions::ALL }),
    ("behind", Omissions { unseen_points: false, ..Omissions::ALL }),
    ("space",  Omissions { empty_space: 0, ..Omissions::ALL }),
    ("rays",   Omissions { empty_rays: false, ..Omissions::ALL }),
    ("parts",  Omissions { empty_parts: false, ..Omissions::ALL }),
    ("hidden", Omissions { hidden_samples: false, ..Omissions::ALL }),
];

/// With everything left out, eighths of the exact picture's samples in the first and in the second pass.
const SAMPLES: [[u32; 2]; 8] = [[6, 6], [4, 4], [3, 3], [2, 2], [1, 1], [8, 0], [4, 0], [2, 0]];

/// The efforts of a network with these options, the cheapest first. Counts of samples are shares of the options'.
/// Whether latent layers are applied on the grid, and in which precision grids are kept, does not change: views are
/// encoded for it. On a device with other precisions than the exact one, all but the exact effort use them.
pub(super) fn efforts(options: &PixelNerfOptions, precisions: &[Precision]) -> Vec<Variant<PixelNerfOptions>> {
    let with = |omissions: Omissions| PixelNerfOptions { omissions: options.omissions.kept_in(omissions), ..*options };
    let between_nodes = NODES.map(|(share, interpolation, error, work)| {
        let nodes = (options.sampling.coarse_count * share).div_ceil(64).clamp(1, MAX_NODES);
        let omissions = Omissions { nodes, interpolation, ..Omissions::ALL };
        Variant::new(format!("{nodes} nodes"), with(omissions), error, work)
    });
    let two_passes =
        TWO_PASSES.map(|(label, omissions, error, work)| Variant::new(label, with(omissions), error, work));
    let all = between_nodes.into_iter().chain(two_passes).chain([Variant::exact(exact(options))]).collect();
    rounded(all, precisions, &ROUNDINGS, |options, precision| PixelNerfOptions { precision, ..*options })
}

/// Nothing is omitted of a picture but what costs nothing or rounding, and products are exact.
pub(super) fn exact(options: &PixelNerfOptions) -> PixelNerfOptions {
    let omissions = options.omissions.kept_in(Omissions::NONE);
    PixelNerfOptions { omissions, precision: Precision::Exact, ..*options }
}

/// What `pareto` draws. `field` gives the sampling; `options` give what `all` omits, the size and the background. What
/// the field itself omits is ignored.
pub(super) fn drawn(
    field: &AnyField,
    options: &RenderOptions,
    _target_count: usize,
    precisions: &[Precision],
) -> Vec<Drawn> {
    let Some(field) = field.downcast_ref::<PixelNerf>() else { return Vec::new() };
    let full = field.options().sampling;
    let variant = |label: &str, sampling, omissions, leave_out, early_termination| {
        let with = PixelNerfOptions { sampling, omissions, precision: Precision::Exact };
        let field = AnyField::new(field.with_options(with));
        Variant::to_measure(label, (field, RenderOptions { leave_out, early_termination, ..options.clone() }))
    };
    let in_precision = |precision: &Precision| {
        let with = PixelNerfOptions { sampling: full, omissions: NONE, precision: *precision };
        let options = RenderOptions { leave_out: 0.0, early_termination: 0.0, ..options.clone() };
        Variant::to_measure(precision.name(), (AnyField::new(field.with_options(with)), options))
    };
    let all =
        |label: &str, sampling| variant(label, sampling, Omissions::ALL, options.leave_out, options.early_termination);
    let mut drawn = vec![variant(EXACT, full, NONE, 0.0, 0.0)];
    drawn.extend(precisions.iter().map(in_precision));
    drawn.extend(ALONE.map(|(label, omissions, leave_out, early_termination)| {
        variant(label, full, omissions, leave_out, early_termination)
    }));
    drawn.push(all(ALL, full));
    drawn.extend(ALL_BUT.map(|(label, omissions)| {
        // Without `views` there is nothing to leave out of the weights either.
        let leave_out = if omissions.unused_views { options.leave_out } else { 0.0 };
        variant(&format!("{ALL} but {label}"), full, omissions, leave_out, options.early_termination)
    }));
    drawn.extend(SAMPLES.map(|[first, second]| {
        let share = |count: u32, eighths: u32| (count * eighths).div_ceil(8);
        let sampling = Sampling {
            coarse_count: share(full.coarse_count, first),
            importance_count: share(full.importance_count, second),
            depth_count: share(full.depth_count, second),
            ..full
        };
        let Sampling { coarse_count, importance_count, depth_count, .. } = sampling;
        all(&format!("{ALL}, {coarse_count}+{importance_count}+{depth_count}"), sampling)
    }));
    drawn
}
