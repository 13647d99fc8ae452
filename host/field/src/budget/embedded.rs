//! Estimates a picture's error from a picture of less effort, as solvers with embedded solutions of two orders do.

use super::Estimate;
use super::check::square;
use crate::Rendered;

/// The estimate's upper end over the estimate: what the ratio of two efforts' errors varies by from scene to scene.
const SAFETY: f64 = 1.5;

/// The error of `better`, from its difference from `cheaper`, whose error is larger by the factor `ratio` above 1. What
/// `better` resolves and `cheaper` does not is taken to be uncorrelated with what neither resolves: the squares of the
/// errors then differ by the square of the difference.
pub(super) fn estimate(better: &Rendered, cheaper: &Rendered, ratio: f64) -> Estimate {
    let count = better.colours.len().max(1) as f64;
    let squares: f64 = better.colours.iter().zip(&cheaper.colours).map(|(a, b)| square(a, b)).sum();
    let value = (squares / count / (ratio * ratio - 1.0)).sqrt();
    let value = if value.is_finite() { value } else { f64::INFINITY };
    Estimate { value, upper: SAFETY * value, pixels: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32) -> Rendered {
        Rendered { colours: vec![[value; 4]; 4], depths: Vec::new(), confidences: Vec::new(), width: 2, height: 2 }
    }

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
        assert!((found.value - 0.01).abs() < 1.0e-6, "{found:?}");
        assert!(found.upper > found.value);
        assert_eq!(estimate(&picture([f32::NAN; 4]), &cheaper, 2.0).upper, f64::INFINITY);
    }
}
