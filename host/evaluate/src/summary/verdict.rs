//! Comparison of each scheme with the baselines, by the intervals.

use super::{Metric, Row, Table, Unit};
use crate::metrics::interval::Interval;
use serde::Serialize;

/// A scheme compared with a baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The scheme.
    pub scheme: String,
    /// The baseline.
    pub baseline: String,
    /// The difference of the scheme's headline metric from the baseline's.
    pub difference: Interval,
    /// The verdict on that difference.
    pub standing: Standing,
}

/// The verdict on a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// Better by more than the interval.
    Above,
    /// Worse by more than the interval.
    Below,
    /// Better or equal, but not by more than the interval, or without one.
    NotBelow,
    /// Worse, but not by more than the interval, or without one.
    PerhapsBelow,
}

impl Standing {
    /// From the difference of two PSNRs, of which the larger is better.
    fn of(difference: &Interval) -> Standing {
        match (difference.excludes_zero(), difference.mean >= 0.0) {
            (true, true) => Standing::Above,
            (true, false) => Standing::Below,
            (false, true) => Standing::NotBelow,
            (false, false) => Standing::PerhapsBelow,
        }
    }
}

/// Every scheme compared with every baseline.
pub(super) fn comparisons(rows: &[Row], difference: impl Fn(&str, &str) -> Option<Interval>) -> Vec<Comparison> {
    let mut comparisons = Vec::new();
    for scheme in rows.iter().filter(|row| !row.is_baseline) {
        for baseline in rows.iter().filter(|row| row.is_baseline) {
            if let Some(difference) = difference(&scheme.scheme, &baseline.scheme) {
                comparisons.push(Comparison {
                    scheme: scheme.scheme.clone(),
                    baseline: baseline.scheme.clone(),
                    standing: Standing::of(&difference),
                    difference,
                });
            }
        }
    }
    comparisons
}

impl Table {
    /// Where schemes are below a baseline, or not clearly above one, a sentence for each such scheme; one sentence if
    /// there is none. Nothing without schemes or baselines.
    pub fn verdicts(&self) -> Vec<String> {
        let Some(metric) = self.metrics.get(self.headline) else { return Vec::new() };
        let mut sentences = Vec::new();
        for row in self.rows.iter().filter(|row| !row.is_baseline) {
            let own = |own: &&Comparison| own.scheme == row.scheme && own.standing != Standing::Above;
            let parts: Vec<String> =
                self.comparisons.iter().filter(own).map(|comparison| self.words(comparison, metric)).collect();
            if !parts.is_empty() {
                sentences.push(format!("{}: {}", row.scheme, parts.join("; ")));
            }
        }
        if sentences.is_empty() && !self.comparisons.is_empty() {
            sentences.push(format!("every scheme is above every baseline in {} beyond the interval", metric.label));
        }
        sentences
    }

    /// The sampling unit of this table's intervals, in words.
    pub fn interval_words(&self) -> String {
        match self.unit {
            Unit::Scenes => format!("±: 95 % intervals over {} scenes", self.scene_count),
            Unit::Views if self.target_count < 2 => "one view of one scene: no intervals".to_owned(),
            Unit::Views => format!(
                "±: 95 % intervals over {} views of one scene; they say nothing about other scenes",
                self.target_count
            ),
        }
    }

    fn words(&self, comparison: &Comparison, metric: &Metric) -> String {
        let Comparison { baseline, difference, standing, .. } = comparison;
        let shown = format!("{} {}", metric.interval_text(difference, true), metric.unit);
        let shown = shown.trim_end();
        match (standing, difference.half_width.is_some()) {
            (Standing::Above, _) => format!("above the {baseline} ({shown})"),
            (Standing::Below, _) => format!("below the {baseline} ({shown})"),
            (Standing::PerhapsBelow, true) => format!("below the {baseline}, within the interval ({shown})"),
            (Standing::PerhapsBelow, false) => format!("below the {baseline} ({shown}, no interval)"),
            (Standing::NotBelow, true) => format!("no difference from the {baseline} beyond the interval ({shown})"),
            (Standing::NotBelow, false) => format!("above the {baseline} ({shown}, no interval)"),
        }
    }
}
