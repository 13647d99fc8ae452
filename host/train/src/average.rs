//! A moving average of the parameters: what a short run ends with wanders less than its last step.

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
    /// The parameters as they are. `decay` is what a step leaves of the average, as soon as there have been many steps.
    pub(crate) fn new(parameters: &Parameters, decay: f64) -> Result<Average> {
        let copied = |(name, variable): (&str, &Var)| Ok((name.to_owned(), Var::from_tensor(&variable.copy()?)?));
        Ok(Average { values: parameters.iter().map(copied).collect::<Result<_>>()?, decay })
    }

    /// Takes in the parameters after step `step`, counted from 0. At first, when they still change much, the average
    /// follows sooner.
    pub(crate) fn step(&self, parameters: &Parameters, step: u32) -> Result<()> {
        let decay = self.decay.min((1.0 + f64::from(step)) / (10.0 + f64::from(step)));
        for (name, variable) in parameters.iter() {
            if let Some(average) = self.values.get(name) {
                // In this form, what does not change stays what it is, to the bit.
                let change = (variable.as_tensor() - average.as_tensor())?;
                let next = (average.as_tensor() + (change * (1.0 - decay))?)?;
                average.set(&next)?;
            }
        }
        Ok(())
    }

    /// Does something while the parameters are the averages.
    pub(crate) fn during<R, E: From<candle_core::Error>>(
        &self,
        parameters: &Parameters,
        work: impl FnOnce() -> std::result::Result<R, E>,
    ) -> std::result::Result<R, E> {
        let mut own: Vec<(&Var, Tensor)> = Vec::new();
        for (name, variable) in parameters.iter() {
            if let Some(average) = self.values.get(name) {
                own.push((variable, variable.copy()?));
                variable.set(average)?;
            }
        }
        let result = work();
        for (variable, own) in own {
            variable.set(&own)?;
        }
        result
    }
}
