//! The settings tried for each field. The first one of a list skips nothing.

mod genvs;

use super::Setting;
use genvs::of_genvs;
use viewfuse_field::AnyField;
use viewfuse_field::budget::Bound;
use viewfuse_field::genvs::Genvs;
use viewfuse_field::pixelnerf::{Omissions, PixelNerf, PixelNerfOptions, Sampling};
use viewfuse_field::render::RenderOptions;
use viewfuse_field::training_free::TrainingFree;

/// Name of the setting that skips nothing.
pub const EXACT: &str = "exact";
/// Name of the setting that skips everything that a run skips by default.
pub const ALL: &str = "all";

/// The settings whose names begin with this leave the choice to a bound on the error.
pub const BOUNDED: &str = "at most ";
/// The bounds, decibels from the exact pictures.
const BOUNDS: [u32; 6] = [25, 30, 35, 40, 45, 50];

/// The settings of a field for this many targets: its own list, and bounds on the error for which it chooses what to leave out.
/// `options` give what `all` skips, the size and the background.
pub fn of(field: &AnyField, options: &RenderOptions, target_count: usize) -> Vec<Setting> {
    let bounded = |decibels: u32| {
        let bound = Some(Bound::Error(10.0_f32.powf(-(decibels as f32) / 20.0)));
        let options = RenderOptions { bound, ..options.clone() };
        Setting { words: format!("{BOUNDED}{decibels} dB"), field: field.clone(), options }
    };
    fixed(field, options, target_count).into_iter().chain(BOUNDS.map(bounded)).collect()
}

/// The settings of a field's own list for this many targets. `options` give what `all` skips, the size and the background. A field
/// without a list of its own has two settings: nothing skipped, and `options` as they are.
fn fixed(field: &AnyField, options: &RenderOptions, target_count: usize) -> Vec<Setting> {
    if let Some(field) = field.downcast_ref::<TrainingFree>() {
        of_training_free(field, options)
    } else if let Some(field) = field.downcast_ref::<PixelNerf>() {
        of_pixelnerf(field, options)
    } else if let Some(field) = field.downcast_ref::<Genvs>() {
        of_genvs(field, options, target_count)
    } else {
        let exact = RenderOptions { leave_out: 0.0, early_termination: 0.0, ..options.clone() };
        let setting = |words: &str, options| Setting { words: words.to_owned(), field: field.clone(), options };
        vec![setting(EXACT, exact), setting(ALL, options.clone())]
    }
}

const NONE: Omissions = Omissions::NONE;
const VIEWS: Omissions = Omissions { unused_views: true, ..NONE };
const PROBED: Omissions = Omissions { empty_space: 4, probe_error: 1.0 / 128.0, ..NONE };
const HIDDEN: Omissions = Omissions { hidden_samples: true, ..NONE };

/// PixelNeRF: each of these alone, everything else exact. Words, what is left out, `--leave-out`,
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

/// PixelNeRF: all but each of these, because omissions that are harmless alone may not be so together. Words as
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

/// PixelNeRF: with everything skipped, eighths of the exact picture's samples in the first and in the second pass.
const SAMPLES: [[u32; 2]; 8] = [[6, 6], [4, 4], [3, 3], [2, 2], [1, 1], [8, 0], [4, 0], [2, 0]];

/// The settings of a PixelNeRF. `field` gives the sampling; `options` give what `all` skips, the size and the
/// background. What the field itself skips is ignored.
fn of_pixelnerf(field: &PixelNerf, options: &RenderOptions) -> Vec<Setting> {
    let full = field.options().sampling;
    let setting = |words: &str, sampling, omissions, leave_out, early_termination| Setting {
        words: words.to_owned(),
        field: AnyField::from(field.with_options(PixelNerfOptions { sampling, omissions })),
        options: RenderOptions { leave_out, early_termination, ..options.clone() },
    };
    let all = |words: &str, sampling| {
        setting(words, sampling, Omissions::default(), options.leave_out, options.early_termination)
    };
    let mut settings = vec![setting(EXACT, full, NONE, 0.0, 0.0)];
    settings.extend(ALONE.map(|(words, omissions, leave_out, early_termination)| {
        setting(words, full, omissions, leave_out, early_termination)
    }));
    settings.push(all(ALL, full));
    settings.extend(ALL_BUT.map(|(words, omissions)| {
        // Without `views` there is nothing to leave out of the weights either.
        let leave_out = if omissions.unused_views { options.leave_out } else { 0.0 };
        setting(&format!("{ALL} but {words}"), full, omissions, leave_out, options.early_termination)
    }));
    settings.extend(SAMPLES.map(|[first, second]| {
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
    settings
}

/// The training-free field: words, `--leave-out`, `--early-termination`, alone.
const EARLY: [(&str, f32, f32); 8] = [
    ("leave out 0.01", 0.01, 0.0),
    ("leave out 0.05", 0.05, 0.0),
    ("leave out 0.1", 0.1, 0.0),
    ("leave out 0.2", 0.2, 0.0),
    ("leave out 0.4", 0.4, 0.0),
    ("early termination 1/256", 0.0, 1.0 / 256.0),
    ("early termination 1/64", 0.0, 1.0 / 64.0),
    ("early termination 1/16", 0.0, 1.0 / 16.0),
];

/// The training-free field: the sources' side as a share of the pictures', alone and with all.
const SOURCES: [(&str, f32); 3] = [("3/4", 0.75), ("1/2", 0.5), ("1/4", 0.25)];

/// The settings of the training-free field. `options` give what `all` skips, the size and the background.
fn of_training_free(field: &TrainingFree, options: &RenderOptions) -> Vec<Setting> {
    let setting = |words: &str, source_share, leave_out, early_termination| Setting {
        words: words.to_owned(),
        field: AnyField::from(TrainingFree { source_share, ..*field }),
        options: RenderOptions { leave_out, early_termination, ..options.clone() },
    };
    let mut settings = vec![setting(EXACT, 1.0, 0.0, 0.0)];
    settings
        .extend(EARLY.map(|(words, leave_out, early_termination)| setting(words, 1.0, leave_out, early_termination)));
    settings.extend(SOURCES.map(|(words, share)| setting(&format!("sources {words}"), share, 0.0, 0.0)));
    let RenderOptions { leave_out, early_termination, .. } = *options;
    settings.push(setting(ALL, 1.0, leave_out, early_termination));
    settings.extend(
        SOURCES.map(|(words, share)| setting(&format!("{ALL}, sources {words}"), share, leave_out, early_termination)),
    );
    settings
}
