//! Efforts of a product: a learned field's variants on a device that multiplies faster where factors may be rounded, or
//! products and sums fused ([`Precision`]). What rounding costs is far below what is omitted by default, so every effort but the exact one
//! rounds, and two that omit nothing stand next to the exact one.
//!
//! Views are encoded exactly in all of them: what a bound is checked with is rendered from the same encodings, and a
//! picture that has to be exact in the end needs no other ones.

use super::error::FieldError;
use super::variant::Variant;
use viewfuse_device::Precision;
use viewfuse_job::progress::Progress;

/// What a precision is typically worth in a field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    pub(crate) precision: Precision,
    /// Root mean square difference from the exact picture, colours from 0 to 1.
    pub(crate) typical_error: f32,
    /// Share of the exact picture's time.
    pub(crate) typical_share: f32,
}

/// Whether a precision rounds about as much as `f32` does in another order of its sums. f16 does not: where a field's
/// density is steep, a sample that moves a little changes a single pixel by much.
const fn is_as_f32(precision: Precision) -> bool {
    !matches!(precision, Precision::Half)
}

/// Efforts, the exact one last, on a device with these precisions: each but the exact one in the coarsest, and the
/// exact one in each. Without any precision they stay as they are.
pub(crate) fn rounded<O: Clone>(
    mut efforts: Vec<Variant<O>>,
    precisions: &[Precision],
    roundings: &[Rounding],
    set: impl Fn(&O, Precision) -> O,
) -> Vec<Variant<O>> {
    let has = |rounding: &&Rounding| precisions.contains(&rounding.precision);
    let Some(coarsest) = roundings.iter().find(has) else { return efforts };
    let Some(exact) = efforts.pop() else { return efforts };
    for effort in &mut efforts {
        effort.label = format!("{}, {}", effort.label, coarsest.precision.name());
        effort.options = set(&effort.options, coarsest.precision);
        effort.typical_error = effort.typical_error.hypot(coarsest.typical_error);
        effort.typical_share *= coarsest.typical_share;
    }
    efforts.extend(roundings.iter().filter(has).map(|rounding| Variant {
        label: rounding.precision.name().to_owned(),
        options: set(&exact.options, rounding.precision),
        typical_error: rounding.typical_error,
        typical_share: rounding.typical_share,
        rounds_as_f32: is_as_f32(rounding.precision),
        omits_nothing: true,
    }));
    efforts.push(exact);
    efforts
}

/// Whether numbers of a network were too large for rounded factors: what gives NaN then is repeated exactly, and later
/// work is exact from the start.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Overflow {
    is_known: bool,
}

impl Overflow {
    /// The precision to work in where this one is wanted.
    pub(crate) fn limit(self, precision: Precision) -> Precision {
        if self.is_known { Precision::Exact } else { precision }
    }

    /// Whether work that ended so in a precision is to be repeated exactly.
    pub(crate) fn is_repeated<T>(outcome: &Result<T, FieldError>, precision: Precision) -> bool {
        Precision::ROUNDED.contains(&precision) && matches!(outcome, Err(FieldError::NotFinite(_)))
    }

    /// The exact repetition succeeded.
    pub(crate) fn tell(&mut self, progress: &dyn Progress) {
        if !self.is_known {
            self.is_known = true;
            progress.warn(OVERFLOW);
        }
    }

    /// For a record.
    pub(crate) fn notes(self) -> Vec<String> {
        if self.is_known { vec![OVERFLOW.to_owned()] } else { Vec::new() }
    }
}

/// What a run says once.
const OVERFLOW: &str = "numbers of this network are too large for products in f16; pictures are computed exactly";

#[cfg(test)]
mod tests {
    use super::*;

    const ROUNDINGS: [Rounding; 3] = [
        Rounding { precision: Precision::Half, typical_error: 3e-3, typical_share: 0.25 },
        Rounding { precision: Precision::TwoHalves, typical_error: 1e-5, typical_share: 0.5 },
        Rounding { precision: Precision::Fused, typical_error: 5e-6, typical_share: 0.75 },
    ];

    fn labels(precisions: &[Precision]) -> Vec<(String, Precision, f32, f32)> {
        let efforts = vec![Variant::new("some", Precision::Exact, 4e-3, 0.1), Variant::exact(Precision::Exact)];
        let efforts = rounded(efforts, precisions, &ROUNDINGS, |_, precision| precision);
        let is_f16 = |label: &str| label == "some" || label.ends_with("in f16");
        let is_told = |effort: &Variant<Precision>| effort.rounds_as_f32 != is_f16(&effort.label);
        assert!(efforts.iter().filter(|effort| !effort.label.starts_with("some, ")).all(is_told));
        let facts = |effort: Variant<Precision>| {
            let Variant { label, options, typical_error, typical_share, .. } = effort;
            (label, options, typical_error, typical_share)
        };
        efforts.into_iter().map(facts).collect()
    }

    #[test]
    fn every_effort_but_the_exact_one_rounds() {
        let exact = ("exact".to_owned(), Precision::Exact, 0.0, 1.0);
        let some = |label: &str, precision, error, share| (label.to_owned(), precision, error, share);
        assert_eq!(labels(&[]), [some("some", Precision::Exact, 4e-3, 0.1), exact.clone()]);
        let half = some("products in f16", Precision::Half, 3e-3, 0.25);
        let parts = some("products in two parts", Precision::TwoHalves, 1e-5, 0.5);
        let first = some("some, products in f16", Precision::Half, 4e-3_f32.hypot(3e-3), 0.025);
        assert_eq!(labels(&Precision::ROUNDED), [first, half, parts.clone(), exact.clone()]);
        // Where f16 is not trusted, the efforts take what is.
        let first = some("some, products in two parts", Precision::TwoHalves, 4e-3_f32.hypot(1e-5), 0.05);
        assert_eq!(labels(&[Precision::TwoHalves]), [first, parts, exact.clone()]);
        // Without matrix units.
        let fused = some("fused products", Precision::Fused, 5e-6, 0.75);
        let first = some("some, fused products", Precision::Fused, 4e-3_f32.hypot(5e-6), 0.075);
        assert_eq!(labels(&[Precision::Fused]), [first, fused, exact]);
    }
}
