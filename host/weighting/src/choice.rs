//! A named scheme, or `auto`: the best one for the scene.

use crate::spec::{AUTO, WeightingError, WeightingSpec, grammar};
use std::fmt;
use std::str::FromStr;

/// The text forms, for help texts: `auto` before those of [`grammar`].
pub fn choice_grammar() -> String {
    format!("{AUTO} (the best for the scene), {}", grammar())
}

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
        if text == AUTO { Ok(WeightingChoice::Auto) } else { text.parse().map(WeightingChoice::Given) }
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
        assert!("automatic".parse::<WeightingChoice>().is_err());
        assert!(choice_grammar().starts_with("auto") && choice_grammar().contains("error:alpha=A"));
        Ok(())
    }
}
