//! A moving average of the parameters, which varies less than the parameters after the last step of a short run.

use super::parameters::Parameters;
use candle_core::{Result, Tensor, Var};
use std::collections::BTreeMap;

/// Averages of every parameter.
#[derive(Clone, Debug)]
pub(crate) struct Average {
    /// By name.
    pub(crate) values: BTreeMap<String, Var>,
    decay: f64,
}

impl Average {
    /// Starts with the current parameters. `decay` is the factor of the average at each step, after many steps.
    pub(crate) fn new(parameters: &Parameters, decay: f64) -> Result<Average> {
        let copied = |(name, variable): (&str, &Var)| Ok((name.to_owned(), Var::from_tensor(&variable.copy()?)?));
        Ok(Average { values: parameters.iter().map(copied).collect::<Result<_>>()?, decay })
    }

    /// Adds the parameters after step `step`, counted from 0. In the first steps, when they change fast, the decay is
    /// stronger.
    pub(crate) fn step(&self, parameters: &Parameters, step: u32) -> Result<()> {
        let decay = self.decay.min((1.0 + f64::from(step)) / (10.0 + f64::from(step)));
        for (name, variable) in parameters.iter() {
            if let Some(average) = self.values.get(name) {
                // In this form, an unchanged parameter keeps its bits.
                let change = (variable.as_tensor() - average.as_tensor())?;
                let next = (average.as_tensor() + (change * (1.0 - decay))?)?;
                average.set(&next)?;
            }
        }
        Ok(())
    }

    /// Calls `work` while the parameters are the averages.
    pub(crate) fn during<R, E: From<candle_core::Error>>(
        &self,
        parameters: &Parameters,
        work: impl FnOnce() -> std::result::Result<R, E>,
    ) -> std::result::Result<R, E> {
        let mut kept: Vec<(&Var, Tensor)> = Vec::new();
        for (name, variable) in parameters.iter() {
            if let Some(average) = self.values.get(name) {
                kept.push((variable, variable.copy()?));
                variable.set(average)?;
            }
        }
        let result = work();
        for (variable, kept) in kept {
            variable.set(&kept)?;
        }
        result
    }
}
