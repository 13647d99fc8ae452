//! The constants of the expected score: weighted ridge regression, cross-validated by scene.

use faer::Mat;
use faer::linalg::solvers::Solve;
use std::collections::BTreeMap;
use viewfuse_field::auto::TERMS;

/// The penalty of each constant but the first, for terms with a deviation of 1 and scenes with a weight of 1.
const PENALTY: f64 = 0.1;

/// A target whose true score is known.
pub(crate) struct Row {
    /// Its scene: all rows of a scene together weigh 1, and are left out together.
    pub(crate) scene: String,
    /// What the constants multiply; the first is 1.
    pub(crate) terms: [f64; TERMS],
    /// True score over the mean score of the sources that were left out, decibels.
    pub(crate) above: f64,
}

/// Constants, and the errors in decibels with those that were fitted to the other scenes.
pub(crate) fn fit(rows: &[Row]) -> ([f64; TERMS], Vec<f64>) {
    let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
    for row in rows {
        *counts.entry(&row.scene).or_default() += 1.0;
    }
    let solved = |left_out: Option<&str>| {
        let kept = rows.iter().filter(|row| Some(row.scene.as_str()) != left_out);
        let weighted: Vec<(&Row, f64)> = kept.map(|row| (row, 1.0 / counts[row.scene.as_str()])).collect();
        solve(&weighted)
    };
    let constants: BTreeMap<&str, [f64; TERMS]> = counts.keys().map(|scene| (*scene, solved(Some(scene)))).collect();
    let errors = rows.iter().map(|row| dot(&constants[row.scene.as_str()], &row.terms) - row.above).collect();
    (solved(None), errors)
}

/// The constants that minimise the weighted squares plus the penalty on the standardised constants.
fn solve(rows: &[(&Row, f64)]) -> [f64; TERMS] {
    let all: f64 = rows.iter().map(|(_, weight)| weight).sum();
    let mean = |term: usize| rows.iter().map(|(row, weight)| weight * row.terms[term]).sum::<f64>() / all;
    let centres: [f64; TERMS] = std::array::from_fn(|term| if term == 0 { 0.0 } else { mean(term) });
    let deviations: [f64; TERMS] = std::array::from_fn(|term| {
        let squares = rows.iter().map(|(row, weight)| weight * (row.terms[term] - centres[term]).powi(2));
        (squares.sum::<f64>() / all).sqrt().max(1.0e-9)
    });
    let standard = |row: &Row, term: usize| (row.terms[term] - centres[term]) / deviations[term];
    let matrix = Mat::from_fn(TERMS, TERMS, |a, b| {
        let products = rows.iter().map(|(row, weight)| weight * standard(row, a) * standard(row, b));
        products.sum::<f64>() + if a == b && a > 0 { PENALTY } else { 0.0 }
    });
    let right = Mat::from_fn(TERMS, 1, |term, _| {
        rows.iter().map(|(row, weight)| weight * standard(row, term) * row.above).sum::<f64>()
    });
    let solution = matrix.full_piv_lu().solve(&right);
    let mut constants: [f64; TERMS] = std::array::from_fn(|term| solution[(term, 0)] / deviations[term]);
    constants[0] -= (1..TERMS).map(|term| constants[term] * centres[term]).sum::<f64>();
    constants
}

/// The sum of the products.
fn dot(constants: &[f64; TERMS], terms: &[f64; TERMS]) -> f64 {
    constants.iter().zip(terms).map(|(constant, term)| constant * term).sum()
}
