//! Settings of a PixelNeRF to compare.

use super::{Omissions, PixelNerf, PixelNerfOptions, Sampling};
use crate::AnyField;
use crate::render::RenderOptions;
use crate::row::{ALL, EXACT, Preset};

const NONE: Omissions = Omissions::NONE;
const VIEWS: Omissions = Omissions { unused_views: true, ..NONE };
const PROBED: Omissions = Omissions { empty_space: 4, probe_error: 1.0 / 128.0, ..NONE };
const HIDDEN: Omissions = Omissions { hidden_samples: true, ..NONE };

/// Each of these alone, everything else exact. Words, what is left out, `--leave-out`,
/// `--early-termination`.
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

/// The presets. `field` gives the sampling; `options` give what `all` leaves out, the size and the background. What the
/// field itself leaves out is ignored.
pub(super) fn of(field: &AnyField, options: &RenderOptions, _target_count: usize) -> Vec<Preset> {
    let Some(field) = field.downcast_ref::<PixelNerf>() else { return Vec::new() };
    let full = field.options().sampling;
    let preset = |words: &str, sampling, omissions, leave_out, early_termination| Preset {
        words: words.to_owned(),
        field: AnyField::new(field.with_options(PixelNerfOptions { sampling, omissions })),
        options: RenderOptions { leave_out, early_termination, ..options.clone() },
    };
    let all = |words: &str, sampling| {
        preset(words, sampling, Omissions::default(), options.leave_out, options.early_termination)
    };
    let mut presets = vec![preset(EXACT, full, NONE, 0.0, 0.0)];
    presets.extend(ALONE.map(|(words, omissions, leave_out, early_termination)| {
        preset(words, full, omissions, leave_out, early_termination)
    }));
    presets.push(all(ALL, full));
    presets.extend(ALL_BUT.map(|(words, omissions)| {
        // Without `views` there is nothing to leave out of the weights either.
        let leave_out = if omissions.unused_views { options.leave_out } else { 0.0 };
        preset(&format!("{ALL} but {words}"), full, omissions, leave_out, options.early_termination)
    }));
    presets.extend(SAMPLES.map(|[first, second]| {
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
    presets
}
