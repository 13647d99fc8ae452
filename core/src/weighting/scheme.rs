//! A scheme: what its row says, its checks, and its text.

use super::{AngleKind, Formula, ROWS};
use core::fmt;

/// The properties of a scheme, one row each.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Row {
    /// The formula, whose number the C face knows it by.
    pub formula: Formula,
    /// The formula's name in [`Formula`].
    pub variant: &'static str,
    /// Its name in text: `mean`, `l1`, ...
    pub name: &'static str,
    /// Its number, if it takes one.
    pub parameter: Option<Parameter>,
    /// Its choice among a few, if it has one.
    pub choice: Option<Choice>,
    /// Its entries in tables over all schemes, in text form.
    pub tables: &'static [&'static str],
    /// The formula's documentation, a line each, as in the C header.
    pub doc: &'static str,
}

/// A number that a scheme takes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Parameter {
    /// Its key in text.
    pub key: &'static str,
    /// The smallest value.
    pub least: f32,
    /// The largest value.
    pub most: f32,
    /// The default.
    pub default: f32,
    /// Its range as text: `key must be ...`.
    pub range: &'static str,
}

/// A choice among a few options; the first is the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Choice {
    /// Its key in text.
    pub key: &'static str,
    /// Number of the first option; the others count from there.
    pub first: u32,
    /// The options in text.
    pub options: &'static [&'static str],
}

/// Numbers of a row without its texts, for kernels: those that a scheme does not use are 0.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    least: f32,
    most: f32,
    default: f32,
    first: u32,
    last: u32,
}

impl Limits {
    pub(super) const fn of(parameter: Option<Parameter>, choice: Option<Choice>) -> Limits {
        let (least, most, default) = match parameter {
            Some(Parameter { least, most, default, .. }) => (least, most, default),
            None => (0.0, 0.0, 0.0),
        };
        let (first, last) = match choice {
            Some(Choice { first, options, .. }) => (first, first + options.len() as u32 - 1),
            None => (0, 0),
        };
        Limits { least, most, default, first, last }
    }
}

impl Formula {
    /// The formula's row.
    pub fn row(self) -> &'static Row {
        let mut rows = ROWS.iter();
        rows.find(|row| row.formula == self).unwrap_or(&ROWS[0])
    }
}

/// Why a scheme is not valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SchemeError {
    /// No formula has this number.
    Formula(u32),
    /// The parameter is out of its range.
    Parameter(Formula),
    /// The choice is none of the options.
    Choice(Formula),
}

impl fmt::Display for SchemeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SchemeError::Formula(number) => write!(f, "no formula has the number {number}"),
            SchemeError::Parameter(formula) => match formula.row().parameter {
                Some(Parameter { key, range, .. }) => write!(f, "{key} must be {range}"),
                None => f.write_str("the parameter is out of its range"),
            },
            SchemeError::Choice(formula) => match formula.row().choice {
                Some(choice) => write!(f, "{} must be {choice}", choice.key),
                None => f.write_str("the choice is out of its range"),
            },
        }
    }
}

impl core::error::Error for SchemeError {}

impl fmt::Display for Choice {
    /// The options: `1, 2 or 3`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, option) in self.options.iter().enumerate() {
            let before = match index {
                0 => "",
                _ if index + 1 == self.options.len() => " or ",
                _ => ", ",
            };
            write!(f, "{before}{option}")?;
        }
        Ok(())
    }
}

/// A weighting scheme given by a formula: the formula, its choice and its parameter, which are in their ranges. What a
/// formula does not use is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Scheme {
    pub(super) formula: Formula,
    pub(super) choice: u32,
    pub(super) parameter: f32,
}

impl Scheme {
    /// Every source counts the same: what PixelNeRF and GeNVS do.
    pub const MEAN: Scheme = Scheme::of(Formula::Mean);
    /// `e = sum |T - S|` over the entries of the two 4x4 poses.
    pub const L1: Scheme = Scheme::of(Formula::L1);
    /// `e = |T - S|_F`, the Frobenius norm of the difference of the two 4x4 poses.
    pub const FROBENIUS: Scheme = Scheme::of(Formula::Frobenius);
    /// `e = |S T^-1|_F`, the Frobenius norm of the relative pose (in world axes, as published). Uniform on a ring of
    /// cameras that look at its centre.
    pub const RELATIVE_FROBENIUS: Scheme = Scheme::of(Formula::RelativeFrobenius);
    /// Error weighting with `alpha = 1` and the angle between principal axes: the best of the paper's formulas.
    pub const ERROR: Scheme = Scheme::of(Formula::Error);

    /// The formula with its default parameter and choice.
    pub const fn of(formula: Formula) -> Scheme {
        let Limits { default, first, .. } = formula.limits();
        Scheme { formula, choice: first, parameter: default }
    }

    /// The formula with this choice and parameter; a value that it does not use may be any.
    ///
    /// # Errors
    /// [`SchemeError::Choice`] or [`SchemeError::Parameter`] if it is out of the range that the formula's row gives.
    #[inline]
    pub const fn new(formula: Formula, choice: u32, parameter: f32) -> Result<Scheme, SchemeError> {
        let Limits { least, most, first, last, .. } = formula.limits();
        let choice = if last == 0 { 0 } else { choice };
        let parameter = if most == 0.0 { 0.0 } else { parameter };
        if choice < first || choice > last {
            return Err(SchemeError::Choice(formula));
        }
        if parameter >= least && parameter <= most {
            Ok(Scheme { formula, choice, parameter })
        } else {
            Err(SchemeError::Parameter(formula))
        }
    }

    /// As [`Scheme::new`], by the formula's number.
    ///
    /// # Errors
    /// Those of [`Scheme::new`], and [`SchemeError::Formula`] if no formula has the number.
    pub fn numbered(formula: u32, choice: u32, parameter: f32) -> Result<Scheme, SchemeError> {
        let found = Formula::numbered_or_mean(formula);
        if found as u32 == formula { Scheme::new(found, choice, parameter) } else { Err(SchemeError::Formula(formula)) }
    }

    /// Weights proportional to `exp(-beta d^2)` with `d` the distance of the centres in world units.
    ///
    /// # Errors
    /// [`SchemeError::Parameter`] unless `beta` is finite and at least 0.
    #[inline]
    pub fn gaussian(beta: f32) -> Result<Scheme, SchemeError> {
        Scheme::new(Formula::Gaussian, 0, beta)
    }

    /// `e = alpha * angle / pi + (1 - alpha) * d / max d`.
    ///
    /// # Errors
    /// [`SchemeError::Parameter`] unless `alpha` lies in `[0, 1]`.
    #[inline]
    pub fn error(alpha: f32, angle: AngleKind) -> Result<Scheme, SchemeError> {
        Scheme::new(Formula::Error, angle as u32, alpha)
    }

    /// `e = d^power` with `d` the distance of the centres in world units and `power` 1, 2 or 3.
    ///
    /// # Errors
    /// [`SchemeError::Choice`] for any other power.
    #[inline]
    pub fn distance(power: u32) -> Result<Scheme, SchemeError> {
        Scheme::new(Formula::Distance, power, 0.0)
    }

    /// Its formula.
    pub fn formula(&self) -> Formula {
        self.formula
    }

    /// Its choice; 0 if it has none.
    pub fn choice(&self) -> u32 {
        self.choice
    }

    /// Its parameter; 0 if it has none.
    pub fn parameter(&self) -> f32 {
        self.parameter
    }
}

impl fmt::Display for Scheme {
    /// The text form: `gaussian:beta=1`. A choice behind a parameter is left out where it is the default.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Row { name, parameter, choice, .. } = self.formula.row();
        f.write_str(name)?;
        if let Some(Parameter { key, .. }) = parameter {
            write!(f, ":{key}={}", self.parameter)?;
        }
        if let Some(Choice { key, first, options }) = choice
            && (parameter.is_none() || self.choice != *first)
        {
            let option = options.get((self.choice - first) as usize).unwrap_or(&"");
            write!(f, "{}{key}={option}", if parameter.is_some() { ',' } else { ':' })?;
        }
        Ok(())
    }
}
