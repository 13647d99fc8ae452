//! Densities: negative values count as zero.
//!
//! With plain rectification, a network whose densities are all negative has no gradient and stays empty; training from
//! scratch on objects before white mostly ends so. Therefore a part of the gradient passes where a density of zero
//! should increase; where it should decrease, none passes, because it is minimal already.

use super::{Operation, Real};

/// Share of the gradient that passes where a density of zero should increase.
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
