//! The variants of the training-free field that `pareto` draws. A new one is a line of a table here.

use super::TrainingFree;
use crate::AnyField;
use crate::render::RenderOptions;
use crate::row::{ALL, Drawn};
use crate::variant::{EXACT, Variant};
use viewfuse_device::Precision;

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

/// What `pareto` draws; `options` give what `all` omits, the size and the background.
pub(super) fn drawn(
    field: &AnyField,
    options: &RenderOptions,
    _target_count: usize,
    _precisions: &[Precision],
) -> Vec<Drawn> {
    let Some(field) = field.downcast_ref::<TrainingFree>() else { return Vec::new() };
    let variant = |label: &str, source_share, leave_out, early_termination| {
        let field = AnyField::new(TrainingFree { source_share, ..field.clone() });
        Variant::to_measure(label, (field, RenderOptions { leave_out, early_termination, ..options.clone() }))
    };
    let mut drawn = vec![variant(EXACT, 1.0, 0.0, 0.0)];
    drawn.extend(EARLY.map(|(label, leave_out, early_termination)| variant(label, 1.0, leave_out, early_termination)));
    drawn.extend(SOURCES.map(|(label, share)| variant(&format!("sources {label}"), share, 0.0, 0.0)));
    let RenderOptions { leave_out, early_termination, .. } = *options;
    drawn.push(variant(ALL, 1.0, leave_out, early_termination));
    drawn.extend(
        SOURCES.map(|(label, share)| variant(&format!("{ALL}, sources {label}"), share, leave_out, early_termination)),
    );
    drawn
}
