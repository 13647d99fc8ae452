//! Estimates a picture's error from a picture of less effort, as solvers with embedded solutions of two orders do.

use super::Estimate;
use super::check::square;
use crate::Rendered;

/// The estimates' upper end over the estimate: what the ratio of two efforts' errors varies by from scene to scene.
pub(super) const SAFETY: f64 = 1.5;

/// The errors of two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    pub(super) better: Estimate,
    pub(super) cheaper: Estimate,
}

/// The errors of `better` and of `cheaper`, from their difference; that of `cheaper` is larger by the factor `ratio`
/// above 1. What `better` resolves and `cheaper` does not is taken to be uncorrelated with what neither resolves: the
/// squares of the errors then differ by the square of the difference.
pub(super) fn estimate(better: &Rendered, cheaper: &Rendered, ratio: f64) -> Pair {
    let count = better.colours.len().max(1) as f64;
    let squares: f64 = better.colours.iter().zip(&cheaper.colours).map(|(a, b)| square(a, b)).sum();
    let of = |square: f64| {
        let value = if square.is_finite() { square.sqrt() } else { f64::INFINITY };
        Estimate { value, upper: SAFETY * value, pixels: 0 }
    };
    let (difference, excess) = (squares / count, ratio * ratio - 1.0);
    // Without an error of the better picture, the difference is the cheaper one's error.
    let better = if ratio.is_finite() { difference / excess } else { 0.0 };
    Pair { better: of(better), cheaper: of(difference + better) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_add_up() {
        // The truth is 0; what neither resolves has the root mean square 0.01, what only the better one does 0.02.
        let picture = |errors: [f32; 4]| Rendered {
            colours: errors.map(|value| [value; 4]).to_vec(),
            depths: Vec::new(),
            confidences: Vec::new(),
            width: 2,
            height: 2,
        };
        let (better, cheaper) = (picture([0.01, -0.01, 0.01, -0.01]), picture([0.03, 0.01, -0.01, -0.03]));
        let found = estimate(&better, &cheaper, 5.0_f64.sqrt());
        assert!((found.better.value - 0.01).abs() < 1.0e-6, "{found:?}");
        assert!((found.cheaper.value - 5.0_f64.sqrt() * 0.01).abs() < 1.0e-6, "{found:?}");
        assert!(found.better.upper > found.better.value);
        let exact = estimate(&better, &cheaper, f64::INFINITY);
        assert!(exact.better.value == 0.0 && (exact.cheaper.value - 0.02).abs() < 1.0e-6, "{exact:?}");
        assert_eq!(estimate(&picture([f32::NAN; 4]), &cheaper, 2.0).better.upper, f64::INFINITY);
    }
}
