//! Camera weighting by formula: how relevant each source pose is to the target pose.
//!
//! The schemes are those of "Pay Attention to Where You Looked" (section 3, deterministic weighting) and of its
//! published code (`cam_weighting.py`). Each turns a source and the target into an error `e >= 0`; the weights are
//! proportional to `1 / (e + 1e-6)`, except for the Gaussian. Where the published code gives NaN (coinciding centres,
//! underflow of every Gaussian, overflow of squares) these give the limit.
//!
//! Accuracy, relative to an `f64` evaluation on the same `f32` poses, in units of `2^-24`. An error `e` with `k`
//! roundings gives a weight with at most `2 (k + 1) + S + 3`: `k + 1` in the numerator (the offset adds one), as many
//! in the sum, two quotients, `S - 1` additions, the reciprocal of the sum and the product with it. Counted roundings
//! `k`, and the largest error of a weight that was measured for up to 32 sources (random poses at scales from 1e-20 to
//! 1e29, rings, near-coincident cameras):
//!
//! | scheme | `k` | measured |
//! |---|---|---|
//! | mean | 0 | 0.5 |
//! | distance, power 1, 2, 3 | 5.5, 11, 16.5; 2 a power more where norms are scaled | 6.3, 8.9, 14.9 |
//! | error | 23 (angle 18.5, its share 2.5, two additions); `2 l / e` more where lengths of axes differ by `l` | 8.8 |
//! | L1 | 12 | 6.6 |
//! | Frobenius | 7.5; 9.5 where norms are scaled | 7.3 |
//! | relative Frobenius | `12 + (18 abs(c_t) + abs(c_s)) / e`, as its translation may cancel | 8.0; 34 on a ring of radius 800 |
//! | Gaussian | `8 + 40 beta (d^2 + n^2) / 2^24`, `n` the nearest distance; beyond a distance or beta of 1e6 `11 beta (d^2 + n^2) + 4 beta abs(d^2 - n^2) + 4` | 6.8 while `beta d^2` is below 1e7, 15 at 1e8, 47 at 3e8 |
//!
//! The Gaussian's exponent is kept with its rounding error, because an error of an exponent is a relative error of the
//! weight; where squares approach overflow it is not. Weights below 4e-38 may be 0.
//! `viewfuse::check::oracle` derives these bounds, and tests assert them for each weight.
//!
//! [`Formula`], [`ROWS`] and [`weigh`] come from one list below: a scheme is one row of it, and a function in
//! `formulas`.

mod formulas;
mod scheme;

pub use scheme::{Choice, Parameter, Row, Scheme, SchemeError};

use crate::pose::Pose;
use crate::sources::Sources;
use crate::weights::Weights;
use scheme::Limits;

/// Added to every error before the reciprocal, as in the published code.
pub const ERROR_OFFSET: f32 = 1.0e-6;

/// Makes [`Formula`], [`ROWS`] and [`weigh`] from one row a scheme. Of a row the documentation, the number and the
/// columns are those of [`Row`]; `weigh` is the formula's function.
macro_rules! schemes {
    ($($(#[doc = $doc:literal])+ $formula:ident = $number:literal {
        name: $name:literal,
        parameter: $parameter:expr,
        choice: $choice:expr,
        tables: $tables:expr,
        weigh: $weigh:path,
    })+) => {
        /// The formulas of camera weighting. Weights are proportional to `1 / (e + 1e-6)`, except for the Gaussian.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u32)]
        pub enum Formula {
            $($(#[doc = $doc])+ $formula = $number,)+
        }

        /// All schemes, in the order of help texts and tables.
        pub const ROWS: &[Row] = &[$(Row {
            formula: Formula::$formula,
            variant: stringify!($formula),
            name: $name,
            parameter: $parameter,
            choice: $choice,
            tables: &$tables,
            doc: concat!($($doc, "\n"),+),
        },)+];

        impl Formula {
            /// The formula with this number; the mean if there is none.
            #[inline]
            fn numbered_or_mean(number: u32) -> Formula {
                match number {
                    $($number => Formula::$formula,)+
                    _ => Formula::Mean,
                }
            }

            /// The ranges of choice and parameter.
            #[inline]
            const fn limits(self) -> Limits {
                match self {
                    $(Formula::$formula => const { Limits::of($parameter, $choice) },)+
                }
            }
        }

        /// The weights of the sources for a target, by formula. Sums run in view order. A single source has weight 1.
        pub fn weigh<const S: usize>(scheme: Scheme, sources: &Sources<S>, target: &Pose) -> Weights<S> {
            match scheme.formula {
                $(Formula::$formula => $weigh(sources, target, scheme.choice, scheme.parameter),)+
            }
        }
    };
}

schemes! {
    /// All weights are equal. Choice and parameter are not used.
    Mean = 0 {
        name: "mean",
        parameter: None,
        choice: None,
        tables: ["mean"],
        weigh: formulas::mean,
    }
    /// `e` is the sum of the absolute differences of the two matrices. Choice and parameter are not used.
    L1 = 4 {
        name: "l1",
        parameter: None,
        choice: None,
        tables: ["l1"],
        weigh: formulas::l1,
    }
    /// `e` is the Frobenius norm of the difference of the two matrices. Choice and parameter are not used.
    Frobenius = 5 {
        name: "frobenius",
        parameter: None,
        choice: None,
        tables: ["frobenius"],
        weigh: formulas::frobenius,
    }
    /// `e` is the Frobenius norm of the relative pose. Choice and parameter are not used.
    RelativeFrobenius = 6 {
        name: "relative-frobenius",
        parameter: None,
        choice: None,
        tables: ["relative-frobenius"],
        weigh: formulas::relative_frobenius,
    }
    /// `exp(-parameter d^2)` with `d` the distance of the centres; the parameter is finite and at least 0.
    Gaussian = 1 {
        name: "gaussian",
        parameter: Some(Parameter { key: "beta", least: 0.0, most: f32::MAX, default: 1.0, range: "finite and at least \
            0" }),
        choice: None,
        tables: ["gaussian:beta=1"],
        weigh: formulas::gaussian,
    }
    /// `e = d^choice`; the choice is 1, 2 or 3, the parameter is not used.
    Distance = 2 {
        name: "distance",
        parameter: None,
        choice: Some(Choice { key: "power", first: 1, options: &["1", "2", "3"] }),
        tables: ["distance:power=1", "distance:power=2", "distance:power=3"],
        weigh: formulas::distance,
    }
    /// `e = parameter angle / pi + (1 - parameter) d / max d`; the parameter lies in 0 to 1, the choice is a
    /// viewfuse_angle. With the parameter 1 and the angle between principal axes the best of the formulas.
    Error = 3 {
        name: "error",
        parameter: Some(Parameter { key: "alpha", least: 0.0, most: 1.0, default: 1.0, range: "between 0 and 1" }),
        choice: Some(Choice { key: "angle", first: AngleKind::PrincipalAxis as u32, options: &["axis", "full"] }),
        tables: ["error:alpha=1", "error:alpha=0.5", "error:alpha=1,angle=full"],
        weigh: formulas::error,
    }
}

/// Which angle between two cameras error weighting uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u32)]
pub enum AngleKind {
    /// Between the principal axes, as the paper defines it.
    PrincipalAxis = 0,
    /// Of the full relative rotation, roll included, as the published code computes it.
    FullRotation = 1,
}
