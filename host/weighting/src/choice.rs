//! A named scheme, or `auto`: the best one for the scene.

pub use crate::spec::choice_grammar;
use crate::spec::{AUTO, WeightingError, WeightingSpec};
use std::fmt;
use std::str::FromStr;

/// Which scheme a run uses.
#[derive(Clone, Debug, PartialEq)]
pub enum WeightingChoice {
    /// The best one for the scene, found from the sources alone.
    Auto,
    /// This one.
    Given(WeightingSpec),
}

impl FromStr for WeightingChoice {
    type Err = WeightingError;

    /// `auto`, or the text of a [`WeightingSpec`].
    fn from_str(text: &str) -> Result<WeightingChoice, WeightingError> {
        if text == AUTO {
            return Ok(WeightingChoice::Auto);
        }
        text.parse().map(WeightingChoice::Given).map_err(|error| match error {
            WeightingError::UnknownScheme { name, .. } => WeightingError::UnknownScheme { name, or_auto: true },
            error => error,
        })
    }
}

impl fmt::Display for WeightingChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WeightingChoice::Auto => f.write_str(AUTO),
            WeightingChoice::Given(spec) => spec.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{WeightingChoice, choice_grammar};
    use crate::WeightingError;

    #[test]
    fn auto_or_a_scheme() -> Result<(), WeightingError> {
        for text in ["auto", "mean", "gaussian:beta=2"] {
            let choice: WeightingChoice = text.parse()?;
            assert_eq!((choice.to_string().as_str(), choice == WeightingChoice::Auto), (text, text == "auto"));
        }
        let error = "autto".parse::<WeightingChoice>().expect_err("no scheme").to_string();
        assert!(error.contains("the nearest is 'auto'; there are: auto (the best"), "{error}");
        let error = "eror:alpha=1".parse::<WeightingChoice>().expect_err("no scheme").to_string();
        assert!(error.contains("unknown weighting scheme 'eror', the nearest is 'error'; there are: auto"), "{error}");
        assert!(choice_grammar().starts_with("auto") && choice_grammar().contains("error:alpha=A"));
        Ok(())
    }
}
