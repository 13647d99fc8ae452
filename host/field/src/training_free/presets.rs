//! Settings of the training-free field to compare.

use super::TrainingFree;
use crate::AnyField;
use crate::render::RenderOptions;
use crate::row::{ALL, EXACT, Preset};

/// Words, `--leave-out`, `--early-termination`, alone.
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

/// The sources' side as a share of the pictures', alone and with all.
const SOURCES: [(&str, f32); 3] = [("3/4", 0.75), ("1/2", 0.5), ("1/4", 0.25)];

/// The presets; `options` give what `all` leaves out, the size and the background.
pub(super) fn of(field: &AnyField, options: &RenderOptions, _target_count: usize) -> Vec<Preset> {
    let Some(field) = field.downcast_ref::<TrainingFree>() else { return Vec::new() };
    let preset = |words: &str, source_share, leave_out, early_termination| Preset {
        words: words.to_owned(),
        field: AnyField::new(TrainingFree { source_share, ..field.clone() }),
        options: RenderOptions { leave_out, early_termination, ..options.clone() },
    };
    let mut presets = vec![preset(EXACT, 1.0, 0.0, 0.0)];
    presets.extend(EARLY.map(|(words, leave_out, early_termination)| preset(words, 1.0, leave_out, early_termination)));
    presets.extend(SOURCES.map(|(words, share)| preset(&format!("sources {words}"), share, 0.0, 0.0)));
    let RenderOptions { leave_out, early_termination, .. } = *options;
    presets.push(preset(ALL, 1.0, leave_out, early_termination));
    presets.extend(
        SOURCES.map(|(words, share)| preset(&format!("{ALL}, sources {words}"), share, leave_out, early_termination)),
    );
    presets
}
