//! The text form of a weighting, parsed and checked. No file is opened here.
//!
//! Names, keys, ranges and defaults of the formulas are those of [`viewfuse_core::weighting::ROWS`].

use crate::attention::AttentionError;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use viewfuse_core::weighting::{Choice, Parameter, ROWS, Row, Scheme};
use viewfuse_job::text::nearest;

/// The published attention without parameters.
const CROSS_ATTENTION: &str = "cross-attention";

/// Learned attention; its file follows the colon.
const ATTENTION: &str = "attention";

/// Every scheme that needs no file, with its default parameters, in text form: the rows of tables over all schemes.
pub fn scheme_names() -> Vec<&'static str> {
    ROWS.iter().flat_map(|row| row.tables).copied().chain([CROSS_ATTENTION]).collect()
}

/// The text form of the automatic choice, which is no label either.
pub(crate) const AUTO: &str = "auto";

/// The text forms, for help texts: `mean, l1, ..., gaussian:beta=B, ..., attention:FILE`.
pub fn grammar() -> String {
    let formulas = ROWS.iter().map(row_grammar);
    formulas.chain([CROSS_ATTENTION.to_owned(), format!("{ATTENTION}:FILE")]).collect::<Vec<_>>().join(", ")
}

fn row_grammar(row: &Row) -> String {
    // A number is called by its key's first letter.
    let number = |p: Parameter| format!("{}={}", p.key, p.key[..1].to_uppercase());
    let options = |choice: Choice| format!("{}={}", choice.key, choice.options.join("|"));
    match (row.parameter.map(number), row.choice.map(options)) {
        (None, None) => row.name.to_owned(),
        (Some(one), None) | (None, Some(one)) => format!("{}:{one}", row.name),
        (Some(first), Some(second)) => format!("{}:{first}[,{second}]", row.name),
    }
}

/// The text forms, for help texts: `auto` before those of [`grammar`].
pub fn choice_grammar() -> String {
    format!("{AUTO} (the best for the scene), {}", grammar())
}

/// The text forms, with `auto` where a choice is possible.
fn known(or_auto: bool) -> String {
    if or_auto { choice_grammar() } else { grammar() }
}

/// The scheme that was nearly written, as a part of a sentence.
fn meant(name: &str, or_auto: bool) -> String {
    let schemes = ROWS.iter().map(|row| row.name).chain([CROSS_ATTENTION, ATTENTION]).chain(or_auto.then_some(AUTO));
    let found = nearest(name, schemes, 1);
    found.first().map_or_else(String::new, |found| format!(", the nearest is '{found}'"))
}

/// Why a text is not a weighting.
#[derive(Debug, thiserror::Error)]
pub enum WeightingError {
    /// No scheme has this name.
    #[error("unknown weighting scheme '{name}'{}; there are: {}", meant(name, *or_auto), known(*or_auto))]
    UnknownScheme {
        /// The given text.
        name: String,
        /// Whether it could also have been `auto`.
        or_auto: bool,
    },
    /// The scheme has no such parameter.
    #[error("weighting scheme '{0}' has no parameter '{1}'; there are: {schemes}", schemes = grammar())]
    UnknownParameter(String, String),
    /// In a scheme, a parameter is given twice.
    #[error("weighting scheme '{0}': {1} is given twice")]
    Repeated(String, String),
    /// The parameter's value is invalid.
    #[error("weighting scheme '{scheme}': {key} must be {range}, not '{value}'")]
    BadValue {
        /// The scheme.
        scheme: String,
        /// The parameter.
        key: String,
        /// The allowed values, as text.
        range: String,
        /// The given text.
        value: String,
    },
    /// A label that could not stand in a table.
    #[error("'{0}' is not a label of a weighting: letters, digits, '-', '_', '.' and blanks")]
    BadLabel(String),
    /// A label that would be read as another weighting.
    #[error("'{0}' is a weighting itself, and no label of one")]
    TakenLabel(String),
    /// Learned attention without its parameters.
    #[error("weighting scheme '{ATTENTION}' needs a file of parameters: {ATTENTION}:FILE")]
    NoFile,
    /// The attention parameters could not be read: an error of opening, not of parsing.
    #[error(transparent)]
    Attention(#[from] AttentionError),
}

/// A parsed and checked weighting; no file is read yet. `open` turns it into a
/// [`Weighting`](crate::Weighting).
#[derive(Clone, Debug, PartialEq)]
pub struct WeightingSpec {
    pub(crate) text: String,
    pub(crate) kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Formula(Scheme),
    CrossAttention,
    Attention(PathBuf),
}

impl WeightingSpec {
    /// The file that opening reads, if any.
    pub fn file(&self) -> Option<&Path> {
        match &self.kind {
            Kind::Attention(path) => Some(path),
            Kind::Formula(_) | Kind::CrossAttention => None,
        }
    }

    /// The formula, if it is one.
    pub fn formula(&self) -> Option<Scheme> {
        match self.kind {
            Kind::Formula(scheme) => Some(scheme),
            Kind::CrossAttention | Kind::Attention(_) => None,
        }
    }
}

impl Default for WeightingSpec {
    /// Error weighting with `alpha = 1`, the best of the paper's formulas.
    fn default() -> WeightingSpec {
        WeightingSpec::from(Scheme::ERROR)
    }
}

impl From<Scheme> for WeightingSpec {
    fn from(scheme: Scheme) -> WeightingSpec {
        WeightingSpec { text: scheme.to_string(), kind: Kind::Formula(scheme) }
    }
}

impl fmt::Display for WeightingSpec {
    /// The label, or the text as given.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for WeightingSpec {
    type Err = WeightingError;

    /// `NAME`, `NAME:KEY=VALUE[,KEY=VALUE]` or `attention:FILE`; the file is not read. `LABEL=` in front of any of them
    /// is what it is called in tables and records.
    fn from_str(text: &str) -> Result<WeightingSpec, WeightingError> {
        // A parameter's `=` comes after the colon.
        let label = text.split(':').next().and_then(|head| head.split_once('=')).map(|(label, _)| label);
        if let Some(label) = label {
            let is_label = |byte: u8| byte.is_ascii_alphanumeric() || b"-_. ".contains(&byte);
            if label.is_empty() || !label.bytes().all(is_label) {
                return Err(WeightingError::BadLabel(label.to_owned()));
            }
            if label == AUTO || label.parse::<WeightingSpec>().is_ok() {
                return Err(WeightingError::TakenLabel(label.to_owned()));
            }
            let rest = &text[label.len() + 1..];
            let spec: WeightingSpec = rest.parse()?;
            if spec.text != rest {
                return Err(WeightingError::BadLabel(text[..text.len() - spec.text.len()].to_owned()));
            }
            return Ok(WeightingSpec { text: label.to_owned(), ..spec });
        }
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        if name == ATTENTION {
            return match rest {
                "" => Err(WeightingError::NoFile),
                file => Ok(WeightingSpec { text: text.to_owned(), kind: Kind::Attention(PathBuf::from(file)) }),
            };
        }
        let mut pairs = Pairs::parse(name, rest);
        pairs.check_keys()?;
        let kind = if name == CROSS_ATTENTION {
            Kind::CrossAttention
        } else {
            let row = ROWS.iter().find(|row| row.name == name);
            let row = row.ok_or_else(|| WeightingError::UnknownScheme { name: name.to_owned(), or_auto: false })?;
            Kind::Formula(pairs.scheme(row)?)
        };
        pairs.finish()?;
        Ok(WeightingSpec { text: text.to_owned(), kind })
    }
}

/// The `KEY=VALUE` pairs behind a scheme's name, taken one by one.
struct Pairs<'a> {
    scheme: &'a str,
    pairs: Vec<(&'a str, &'a str)>,
}

impl<'a> Pairs<'a> {
    fn parse(scheme: &'a str, text: &'a str) -> Pairs<'a> {
        let pairs = text.split(',').filter(|pair| !pair.is_empty());
        Pairs { scheme, pairs: pairs.map(|pair| pair.split_once('=').unwrap_or((pair, ""))).collect() }
    }

    /// Refuses a key that is given twice: of two values, nobody knows which is meant.
    fn check_keys(&self) -> Result<(), WeightingError> {
        let is_repeated =
            |(place, (key, _)): &(usize, &(&str, &str))| self.pairs[..*place].iter().any(|(earlier, _)| earlier == key);
        match self.pairs.iter().enumerate().find(is_repeated) {
            Some((_, (key, _))) => Err(WeightingError::Repeated(self.scheme.to_owned(), (*key).to_owned())),
            None => Ok(()),
        }
    }

    /// The scheme of a row with the choice and the parameter that are given, else with the defaults.
    fn scheme(&mut self, row: &Row) -> Result<Scheme, WeightingError> {
        let default = Scheme::of(row.formula);
        let choice = match row.choice.and_then(|choice| Some((choice, self.take(choice.key)?))) {
            None => default.choice(),
            Some((choice, text)) => {
                numbered(&choice, text).ok_or_else(|| self.bad(choice.key, &choice.to_string(), text))?
            }
        };
        let (parameter, given) = match row.parameter.and_then(|parameter| Some((parameter, self.take(parameter.key)?)))
        {
            None => (default.parameter(), None),
            Some((parameter, text)) => {
                let value = text.parse().map_err(|_| self.bad(parameter.key, "a number", text))?;
                (value, Some((parameter, text)))
            }
        };
        Scheme::new(row.formula, choice, parameter).map_err(|_| match given {
            Some((Parameter { key, range, .. }, text)) => self.bad(key, range, text),
            // The defaults are in their ranges.
            None => WeightingError::UnknownScheme { name: self.scheme.to_owned(), or_auto: false },
        })
    }

    fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.pairs.iter().position(|(k, _)| *k == key)?;
        Some(self.pairs.remove(at).1)
    }

    fn bad(&self, key: &str, range: &str, value: &str) -> WeightingError {
        let [scheme, key, range, value] = [self.scheme, key, range, value].map(str::to_owned);
        WeightingError::BadValue { scheme, key, range, value }
    }

    fn finish(self) -> Result<(), WeightingError> {
        match self.pairs.first() {
            None => Ok(()),
            Some((key, _)) => Err(WeightingError::UnknownParameter(self.scheme.to_owned(), (*key).to_owned())),
        }
    }
}

/// The number of an option. Numeric options are compared by value: `2.0` is `2`.
fn numbered(choice: &Choice, text: &str) -> Option<u32> {
    let value = |text: &str| text.parse::<f32>().ok();
    let is_meant = |option: &&str| *option == text || value(option).is_some_and(|number| value(text) == Some(number));
    let place = choice.options.iter().position(is_meant)?;
    Some(choice.first + place as u32)
}

#[cfg(test)]
mod tests {
    use super::{Kind, ROWS, WeightingError, WeightingSpec, grammar, scheme_names};
    use std::path::Path;

    #[test]
    fn texts_of_tables_are_the_schemes_own() -> Result<(), WeightingError> {
        for row in ROWS {
            assert!(!row.tables.is_empty(), "{} is in no table", row.name);
            for text in row.tables {
                let spec: WeightingSpec = text.parse()?;
                let Kind::Formula(scheme) = spec.kind else { panic!("{text} is no formula") };
                assert_eq!((scheme.formula(), scheme.to_string().as_str()), (row.formula, *text));
            }
        }
        assert!(scheme_names().len() >= 12);
        Ok(())
    }

    #[test]
    fn what_can_be_typed_follows_from_the_rows() {
        // One of each form; rows that come later stand between them.
        for form in ["mean, ", "gaussian:beta=B", "distance:power=1|2|3", "error:alpha=A[,angle=axis|full]"] {
            assert!(grammar().contains(form), "{form} is not in {}", grammar());
        }
        assert!(grammar().ends_with("cross-attention, attention:FILE"), "{}", grammar());
    }

    #[test]
    fn defaults_and_numbers_as_a_person_writes_them() -> Result<(), WeightingError> {
        for (text, meant) in [
            ("gaussian", "gaussian:beta=1"),
            ("distance:power=2.0", "distance:power=2"),
            ("error:angle=full", "error:alpha=1,angle=full"),
            ("error:angle=axis,alpha=5e-1", "error:alpha=0.5"),
        ] {
            let (spec, meant): (WeightingSpec, WeightingSpec) = (text.parse()?, meant.parse()?);
            assert_eq!(spec.kind, meant.kind, "{text}");
            assert_eq!(spec.to_string(), text);
        }
        Ok(())
    }

    #[test]
    fn labels_stand_in_front() -> Result<(), WeightingError> {
        let (spec, meant): (WeightingSpec, WeightingSpec) =
            ("half=error:alpha=0.5".parse()?, "error:alpha=0.5".parse()?);
        assert_eq!((spec.to_string().as_str(), &spec.kind), ("half", &meant.kind));
        let spec: WeightingSpec = "cars=attention:a=b/c:d.safetensors".parse()?;
        assert_eq!((spec.to_string().as_str(), spec.file()), ("cars", Some(Path::new("a=b/c:d.safetensors"))));
        // A label has none itself, and is no scheme that it is not.
        for wrong in ["=mean", "a/b=mean", "a=b=mean", "a=nothing", "mean=error:alpha=1", "auto=mean"] {
            wrong.parse::<WeightingSpec>().expect_err(wrong);
        }
        Ok(())
    }

    #[test]
    fn parsing_opens_no_file() -> Result<(), WeightingError> {
        let spec: WeightingSpec = "attention:nowhere/is.safetensors".parse()?;
        assert_eq!(spec.file(), Some(Path::new("nowhere/is.safetensors")));
        let error = spec.open().expect_err("there is no such file").to_string();
        assert!(error.starts_with("nowhere/is.safetensors: cannot be read"), "{error}");
        Ok(())
    }
}
