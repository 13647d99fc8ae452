//! Adam (Kingma and Ba, ICLR 2015), with moments that can be saved and loaded. The library's own does not expose them,
//! so a continued run would give other results.

use super::parameters::Parameters;
use candle_core::backprop::GradStore;
use candle_core::{Result, Tensor, Var};
use std::collections::BTreeMap;

/// Decay of the means of gradients and of their squares.
const DECAYS: [f64; 2] = [0.9, 0.999];
/// Added to the root of the mean square (epsilon).
const FLOOR: f64 = 1.0e-8;

/// Moments of every parameter.
#[derive(Clone, Debug)]
pub(crate) struct Adam {
    /// Name to mean gradient and mean squared gradient.
    pub(crate) moments: BTreeMap<String, [Var; 2]>,
}

impl Adam {
    /// All zero.
    pub(crate) fn new(parameters: &Parameters) -> Result<Adam> {
        let zeros = |variable: &Var| Var::from_tensor(&variable.zeros_like()?);
        let moments = parameters
            .iter()
            .map(|(name, variable)| Ok((name.to_owned(), [zeros(variable)?, zeros(variable)?])))
            .collect::<Result<_>>()?;
        Ok(Adam { moments })
    }

    /// One step, number `step` counted from 0. All gradients are scaled down if their norm exceeds `most`. Returns whether
    /// they were finite; where they were not, nothing changes.
    pub(crate) fn step(
        &self,
        parameters: &Parameters,
        gradients: &GradStore,
        step: u32,
        rate: f64,
        most: f64,
    ) -> Result<bool> {
        let mut squares = 0.0;
        for (_, variable) in parameters.iter() {
            if let Some(gradient) = gradients.get(variable) {
                squares += gradient.sqr()?.sum_all()?.to_dtype(candle_core::DType::F64)?.to_scalar::<f64>()?;
            }
        }
        if !squares.is_finite() {
            return Ok(false);
        }
        let scale = if squares.sqrt() > most { most / squares.sqrt() } else { 1.0 };
        let [first, second] = DECAYS.map(|decay| 1.0 - decay.powi(step as i32 + 1));
        for (name, variable) in parameters.iter() {
            let (Some(gradient), Some([mean, square])) = (gradients.get(variable), self.moments.get(name)) else {
                continue;
            };
            let gradient = (gradient * scale)?;
            mean.set(&blended(mean, &gradient, DECAYS[0])?)?;
            square.set(&blended(square, &gradient.sqr()?, DECAYS[1])?)?;
            let root = ((square.as_tensor() / second)?.sqrt()? + FLOOR)?;
            variable.set(&(variable.as_tensor() - ((mean.as_tensor() * (rate / first))? / root)?)?)?;
        }
        Ok(true)
    }
}

fn blended(old: &Tensor, new: &Tensor, decay: f64) -> Result<Tensor> {
    (old * decay)? + (new * (1.0 - decay))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::DType;
    use viewfuse_nn::checkpoint::TensorShape;

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        let shape = TensorShape { name: "it".to_owned(), shape: vec![2] };
        let parameters = Parameters::new(&[shape], DType::F64, |_| Ok(vec![1.0, 2.0])).expect("parameters");
        let adam = Adam::new(&parameters).expect("moments");
        let value = || parameters.get("it").and_then(|it| it.to_vec1::<f64>()).expect("numbers");
        let step = |factor: f64| {
            let loss = (parameters.get("it").expect("it") * factor).and_then(|it| it.sum_all()).expect("a loss");
            adam.step(&parameters, &loss.backward().expect("gradients"), 0, 0.1, 1.0).expect("a step")
        };
        for factor in [f64::INFINITY, f64::NAN, 1e200] {
            assert!(!step(factor), "{factor}");
            assert_eq!(value(), [1.0, 2.0], "{factor}");
        }
        assert!(step(3.0) && value() < vec![1.0, 2.0]);
    }
}
