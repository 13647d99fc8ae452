//! The settings tried for each field: the variants that its row draws, and bounds on the error. The first one omits
//! nothing.

use viewfuse_device::Precision;
use viewfuse_field::AnyField;
use viewfuse_field::budget::Bound;
use viewfuse_field::render::RenderOptions;
use viewfuse_field::row::{ALL, Drawn};
use viewfuse_field::rows;
use viewfuse_field::variant::Variant;

/// The settings whose names begin with this leave the choice to a bound on the error.
pub const BOUNDED: &str = "at most ";
/// The bounds, decibels from the exact pictures.
const BOUNDS: [u32; 6] = [25, 30, 35, 40, 45, 50];

/// The settings of a field for this many targets: its row's variants, and bounds on the error for which it chooses what
/// to omit. `options` give what `all` omits, the size and the background; `precisions` are those that the device has
/// besides the exact one. A field that draws none has two: nothing omitted, and `options` as they are.
pub fn of(field: &AnyField, options: &RenderOptions, target_count: usize, precisions: &[Precision]) -> Vec<Drawn> {
    let row = rows::named(field.about().name);
    let mut drawn = row.map_or_else(Vec::new, |row| (row.drawn)(field, options, target_count, precisions));
    if drawn.is_empty() {
        let exact = RenderOptions { leave_out: 0.0, early_termination: 0.0, ..options.clone() };
        drawn.push(Variant::exact((field.clone(), exact)));
        drawn.push(Variant::to_measure(ALL, (field.clone(), options.clone())));
    }
    drawn.extend(BOUNDS.map(|decibels| {
        let bound = Some(Bound::Error(10.0_f32.powf(-(decibels as f32) / 20.0)));
        let options = RenderOptions { bound, ..options.clone() };
        Variant::to_measure(format!("{BOUNDED}{decibels} dB"), (field.clone(), options))
    }));
    drawn
}
