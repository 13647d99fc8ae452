//! Densities: what is below zero counts as zero.
//!
//! Plainly rectified, a network whose densities are all below zero has no gradient at all and stays empty for ever; that is
//! how training from scratch on objects before white mostly ends. So where a density that is zero had better be larger,
//! part of the gradient passes; where it had better be smaller, none does, because it is as small as it can be.

use super::{Operation, Real};

/// Share of the gradient that passes where a density is zero and should not be.
pub(crate) const LEAK: f64 = 0.1;

/// Inputs: densities before rectification, of any shape.
pub(crate) struct RectifiedDensity {
    pub(crate) shape: Vec<usize>,
}

impl Operation<1> for RectifiedDensity {
    const NAME: &'static str = "rectified_density";

    fn shape(&self) -> Vec<usize> {
        self.shape.clone()
    }

    fn forward<T: Real>(&self, [values]: [&[T]; 1]) -> Vec<T> {
        values.iter().map(|value| if *value < T::zero() { T::zero() } else { *value }).collect()
    }

    fn backward<T: Real>(&self, [values]: [&[T]; 1], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 1] {
        let leak = T::from_f64(LEAK);
        let one = |(value, gradient): (&T, &T)| match (*value < T::zero(), *gradient < T::zero()) {
            (false, _) => *gradient,
            (true, true) => *gradient * leak,
            (true, false) => T::zero(),
        };
        [Some(values.iter().zip(gradient).map(one).collect())]
    }
}
