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

/// Most characters of a line about a scheme.
const MAX_LINE: usize = 100;

impl Table {
    /// Where schemes are below a baseline, or not shown to be above one, a line of at most 100 characters for each such
    /// scheme; one line if there is none. Nothing without schemes or baselines.
    pub fn verdicts(&self) -> Vec<String> {
        let Some(metric) = self.metrics.get(self.headline) else { return Vec::new() };
        let lines: Vec<String> = self.schemes_in_doubt().map(|row| self.line(&row.scheme)).collect();
        if lines.is_empty() && !self.comparisons.is_empty() {
            return vec![format!("every scheme is above every baseline in {} beyond the interval", metric.label)];
        }
        lines
    }

    /// The same with the differences and their intervals.
    pub fn details(&self) -> Vec<String> {
        let Some(metric) = self.metrics.get(self.headline) else { return Vec::new() };
        let of_row = |row: &Row| {
            let compared = self.comparisons_of(&row.scheme).filter(|comparison| comparison.standing != Standing::Above);
            let parts: Vec<String> = compared.map(|comparison| words(comparison, metric)).collect();
            format!("{}: {}", row.scheme, parts.join("; "))
        };
        self.schemes_in_doubt().map(of_row).collect()
    }

    fn comparisons_of<'a>(&'a self, scheme: &'a str) -> impl Iterator<Item = &'a Comparison> {
        self.comparisons.iter().filter(move |comparison| comparison.scheme == scheme)
    }

    /// The schemes that are not above every baseline.
    fn schemes_in_doubt(&self) -> impl Iterator<Item = &Row> {
        let is_in_doubt =
            |row: &&Row| self.comparisons_of(&row.scheme).any(|comparison| comparison.standing != Standing::Above);
        self.rows.iter().filter(move |row| !row.is_baseline && is_in_doubt(row))
    }

    /// How a scheme stands to the baselines, as short as it has to be.
    fn line(&self, scheme: &str) -> String {
        let baselines = |standings: &[Standing]| -> Vec<&str> {
            let compared = self.comparisons_of(scheme).filter(|comparison| standings.contains(&comparison.standing));
            compared.map(|comparison| comparison.baseline.as_str()).collect()
        };
        let groups = [
            ("below", baselines(&[Standing::Below])),
            ("not shown to differ from", baselines(&[Standing::NotBelow, Standing::PerhapsBelow])),
        ];
        let join = |told: &dyn Fn(&[&str]) -> String| -> String {
            let parts = groups.iter().filter(|(_, names)| !names.is_empty());
            parts.map(|(what, names)| format!("{what} {}", told(names))).collect::<Vec<_>>().join("; ")
        };
        let named = format!("{scheme}: {}", join(&|names| format!("the {}", names.join(", the "))));
        if named.chars().count() <= MAX_LINE {
            return named;
        }
        let counted = join(&|names| match names {
            [name] => format!("the {name}"),
            names => format!("{} baselines", names.len()),
        });
        // A scheme may be the path of a file: its end tells more.
        let room = MAX_LINE.saturating_sub(counted.chars().count() + 2);
        let length = scheme.chars().count();
        if length <= room {
            return format!("{scheme}: {counted}");
        }
        let end: String = scheme.chars().skip(length + 1 - room.max(1)).collect();
        format!("\u{2026}{end}: {counted}")
    }

    /// The sampling unit of this table's intervals, in words.
    pub fn interval_words(&self) -> String {
        match self.unit {
            Unit::Scenes => format!("±: 95 % intervals over {} scenes", self.scene_count),
            Unit::Views if self.view_count < 2 => "one view of one scene: no intervals".to_owned(),
            Unit::Views => format!(
                "±: 95 % intervals over {} views of one scene; they say nothing about other scenes",
                self.view_count
            ),
        }
    }
}

/// A comparison with its numbers.
fn words(comparison: &Comparison, metric: &Metric) -> String {
    let Comparison { baseline, difference, standing, .. } = comparison;
    let shown = format!("{} {}", metric.interval_text(difference, true), metric.unit);
    let shown = shown.trim_end();
    match (standing, difference.half_width.is_some()) {
        (Standing::Above, _) => format!("above the {baseline} ({shown})"),
        (Standing::Below, _) => format!("below the {baseline} ({shown})"),
        (_, true) => format!("not shown to differ from the {baseline} ({shown})"),
        (_, false) => format!("not shown to differ from the {baseline} ({shown}, no interval)"),
    }
}
