//! The settings tried for each field: the presets of its row, and bounds on the error. The first one leaves nothing out.

use super::Preset;
use viewfuse_field::AnyField;
use viewfuse_field::budget::Bound;
use viewfuse_field::render::RenderOptions;
use viewfuse_field::row::{ALL, EXACT};
use viewfuse_field::rows;

/// The settings whose names begin with this leave the choice to a bound on the error.
pub const BOUNDED: &str = "at most ";
/// The bounds, decibels from the exact pictures.
const BOUNDS: [u32; 6] = [25, 30, 35, 40, 45, 50];

/// The settings of a field for this many targets: its row's presets, and bounds on the error for which it chooses what to
/// leave out. `options` give what `all` leaves out, the size and the background. A field without presets has two: nothing
/// left out, and `options` as they are.
pub fn of(field: &AnyField, options: &RenderOptions, target_count: usize) -> Vec<Preset> {
    let preset = |words: String, options| Preset { words, field: field.clone(), options };
    let row = rows::named(field.about().name);
    let mut presets = row.map_or_else(Vec::new, |row| (row.presets)(field, options, target_count));
    if presets.is_empty() {
        let exact = RenderOptions { leave_out: 0.0, early_termination: 0.0, ..options.clone() };
        presets = vec![preset(EXACT.to_owned(), exact), preset(ALL.to_owned(), options.clone())];
    }
    presets.extend(BOUNDS.map(|decibels| {
        let bound = Some(Bound::Error(10.0_f32.powf(-(decibels as f32) / 20.0)));
        preset(format!("{BOUNDED}{decibels} dB"), RenderOptions { bound, ..options.clone() })
    }));
    presets
}
