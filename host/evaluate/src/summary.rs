//! The tables of an evaluation: means with intervals, and how each scheme compares with averaging the views and with
//! the baselines.
//!
//! Every scene has the same weight: the targets and trials of a scene are averaged first, then the scenes. The
//! difference of two rows is computed scene by scene before it is averaged, so that the difficulty of a scene cancels.
//! For a single scene the views replace the scenes ([`Unit::Views`]): the intervals then apply to other views of this
//! scene, not to other scenes.
//!
//! ```text
//! metric    how a metric is written
//! verdict   comparison of each scheme with the baselines, in words
//! latex     a table for a paper
//! ```

mod latex;
mod metric;
mod verdict;

pub use metric::Metric;
pub use verdict::{Comparison, Standing};

use crate::Score;
use crate::baseline::Baseline;
use crate::metrics::interval::Interval;
use crate::metrics::masked::PSNR_MASKED;
use crate::run_folder::Finished;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// The scheme that others are compared with: what published systems do.
pub const REFERENCE: &str = "mean";

/// The sampling unit of the intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Scenes, of which there are several.
    Scenes,
    /// Targets of one scene.
    Views,
}

/// All schemes under the same conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// The numbers of sources of its jobs, ascending.
    pub source_counts: Vec<usize>,
    /// Number of scenes.
    pub scene_count: usize,
    /// Number of pictures of every scheme.
    pub target_count: usize,
    /// Different views that these show.
    pub view_count: usize,
    /// The sampling unit of the intervals.
    pub unit: Unit,
    /// The metrics, in the order of their columns.
    pub metrics: Vec<Metric>,
    /// The metric that rows are compared by: an index into the metrics.
    pub headline: usize,
    /// The baselines first, then the schemes in the requested order.
    pub rows: Vec<Row>,
    /// Every scheme's difference from every baseline in the headline metric.
    pub comparisons: Vec<Comparison>,
}

/// A scheme, or a baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its name.
    pub scheme: String,
    /// Whether it is a baseline.
    pub is_baseline: bool,
    /// One value for each metric; `None` where no picture has it.
    pub cells: Vec<Option<Cell>>,
    /// Mean time of a picture in seconds; `None` for baselines.
    pub seconds: Option<f64>,
}

/// A row's metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Over the scenes, or the views of one.
    pub value: Interval,
    /// The difference from [`REFERENCE`], if that is in the table and this is another.
    pub versus_reference: Option<Interval>,
    /// The difference from copying the nearest source, if that is in the table and this is another.
    pub versus_copy: Option<Interval>,
    /// Rank in the column by the printed value: 1 for the best, 2 for the next; equal values share a rank.
    pub place: usize,
    /// Whether it is the best of the column, or does not differ from the best beyond the interval of their difference.
    /// `false` for all rows if it would be true for all, or with a single scene or view.
    pub leads: bool,
}

/// A column of a table as it is shown, behind the rows' names and before their times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// A metric, by its index.
    Value(usize),
    /// The difference of the headline metric from that of copying the nearest source.
    OverCopy,
    /// Its difference from that of [`REFERENCE`].
    OverReference,
}

impl Column {
    /// The metric that the column is of, by its index.
    pub fn metric(self, table: &Table) -> usize {
        match self {
            Column::Value(metric) => metric,
            Column::OverCopy | Column::OverReference => table.headline,
        }
    }

    /// The difference that a cell of the column shows; `None` for columns of values.
    pub fn difference(self, cell: Option<&Cell>) -> Option<Interval> {
        match self {
            Column::Value(_) => None,
            Column::OverCopy => cell?.versus_copy,
            Column::OverReference => cell?.versus_reference,
        }
    }
}

impl Table {
    /// The columns that are shown: every metric, and after the headline metric its differences from the reference rows
    /// in the table.
    pub fn columns(&self) -> Vec<Column> {
        let has = |scheme: &str| self.rows.iter().any(|row| row.scheme == scheme);
        let mut columns = Vec::new();
        for metric in 0..self.metrics.len() {
            columns.push(Column::Value(metric));
            if metric == self.headline {
                columns.extend(has(Baseline::NearestCopy.name()).then_some(Column::OverCopy));
                columns.extend(has(REFERENCE).then_some(Column::OverReference));
            }
        }
        columns
    }

    /// The heading of a column.
    pub fn heading(&self, column: Column) -> String {
        match column {
            Column::Value(metric) => self.metrics[metric].heading(),
            Column::OverCopy => "over copy".to_owned(),
            Column::OverReference => format!("over {REFERENCE}"),
        }
    }
}

/// A score and its origin.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// The scene.
    pub scene: usize,
    /// The score.
    pub score: &'a Score,
}

/// The tables of finished jobs: one, or one for each number of sources.
pub fn tables<'a>(finished: impl IntoIterator<Item = &'a Finished>, by_source_count: bool) -> Vec<Table> {
    let mut groups: BTreeMap<usize, Vec<Observation<'_>>> = BTreeMap::new();
    for Finished { scene, scores, sources, .. } in finished {
        let group = groups.entry(if by_source_count { sources.len() } else { 0 }).or_default();
        group.extend(scores.iter().map(|score| Observation { scene: *scene, score }));
    }
    groups.values().map(|observations| table(observations)).collect()
}

/// A sampling unit: a scene, or a view.
type Counted<'a> = (usize, &'a str);

/// One table of these scores.
pub fn table(observations: &[Observation<'_>]) -> Table {
    let (mut schemes, mut names): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    for Observation { score, .. } in observations {
        if !schemes.contains(&score.scheme.as_str()) {
            schemes.push(&score.scheme);
        }
        for (name, _) in &score.values {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
    }
    let scene_count = observations.iter().map(|observation| observation.scene).collect::<BTreeSet<_>>().len();
    let unit = if scene_count > 1 { Unit::Scenes } else { Unit::Views };
    // By scheme and metric: every scene's, or view's, values.
    let mut values: BTreeMap<(&str, &str), BTreeMap<Counted<'_>, Vec<f64>>> = BTreeMap::new();
    let mut times: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for Observation { scene, score, .. } in observations {
        let counted = match unit {
            Unit::Scenes => (*scene, ""),
            // However often a view is drawn, it is one.
            Unit::Views => (0, score.target.as_str()),
        };
        for (name, value) in &score.values {
            values.entry((&score.scheme, name)).or_default().entry(counted).or_default().push(*value);
        }
        times.entry(&score.scheme).or_default().push(score.time.as_secs_f64());
    }
    let means: Means<'_> = values
        .into_iter()
        .map(|(key, all)| (key, all.into_iter().map(|(counted, values)| (counted, mean(&values))).collect()))
        .collect();

    let metrics = Metric::all_named(&names);
    let headline = names.iter().position(|name| *name == PSNR_MASKED).unwrap_or(0);
    let row = |scheme: &&str| {
        let is_baseline = Baseline::is_named(scheme);
        Row {
            scheme: (*scheme).to_owned(),
            is_baseline,
            cells: metrics.iter().map(|metric| cell(&means, scheme, &metric.name)).collect(),
            seconds: times.get(scheme).map(|times| mean(times)).filter(|_| !is_baseline),
        }
    };
    let mut rows: Vec<Row> = schemes.iter().map(row).collect();
    for (column, metric) in metrics.iter().enumerate() {
        place(&mut rows, column, metric);
        lead(&mut rows, column, metric, &means);
    }
    let difference = |a: &str, b: &str| {
        let metric = metrics.get(headline)?;
        Interval::of_differences(means.get(&(a, &metric.name))?, means.get(&(b, &metric.name))?)
    };
    Table {
        source_counts: observations
            .iter()
            .map(|observation| observation.score.source_count)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect(),
        scene_count,
        target_count: times.values().map(Vec::len).max().unwrap_or(0),
        view_count: observations.iter().map(|one| (one.scene, &one.score.target)).collect::<BTreeSet<_>>().len(),
        unit,
        comparisons: verdict::comparisons(&rows, difference),
        metrics,
        headline,
        rows,
    }
}

/// By scheme and metric: the mean of every scene, or view.
type Means<'a> = BTreeMap<(&'a str, &'a str), BTreeMap<Counted<'a>, f64>>;

fn cell(means: &Means<'_>, scheme: &str, metric: &str) -> Option<Cell> {
    let scores = means.get(&(scheme, metric))?;
    let versus = |other: &str| {
        let other = means.get(&(other, metric)).filter(|_| scheme != other)?;
        Interval::of_differences(scores, other)
    };
    Some(Cell {
        value: Interval::of(&scores.values().copied().collect::<Vec<_>>())?,
        versus_reference: versus(REFERENCE),
        versus_copy: versus(Baseline::NearestCopy.name()),
        place: 0,
        leads: false,
    })
}

/// A row's value in a column as it is printed.
fn written(row: &Row, column: usize, metric: &Metric) -> Option<f64> {
    metric.text(row.cells[column].as_ref()?.value.mean).parse().ok()
}

/// Ranks in a column, by the printed values: values that print the same are equally good.
fn place(rows: &mut [Row], column: usize, metric: &Metric) {
    let mut values: Vec<f64> =
        rows.iter().filter_map(|row| written(row, column, metric)).filter(|value| !value.is_nan()).collect();
    values.sort_by(|a, b| if metric.larger_is_better { b.total_cmp(a) } else { a.total_cmp(b) });
    values.dedup();
    for row in rows {
        let shown = written(row, column, metric);
        let place = values.iter().position(|value| Some(*value) == shown).map_or(values.len(), |place| place) + 1;
        if let Some(cell) = &mut row.cells[column] {
            cell.place = place;
        }
    }
}

/// The rows of a column that no other row exceeds beyond the interval. Requires the ranks.
fn lead(rows: &mut [Row], column: usize, metric: &Metric, means: &Means<'_>) {
    let first = rows.iter().find(|row| row.cells[column].as_ref().is_some_and(|cell| cell.place == 1));
    let Some(best) = first.and_then(|row| means.get(&(row.scheme.as_str(), metric.name.as_str()))) else { return };
    if best.len() < 2 {
        return;
    }
    let leads: Vec<bool> = rows
        .iter()
        .map(|row| {
            let Some(cell) = &row.cells[column] else { return false };
            let scores = means.get(&(row.scheme.as_str(), metric.name.as_str()));
            let difference = scores.and_then(|means| Interval::of_differences(best, means));
            // Where the interval is unknown, as for infinite scores, the printed values decide.
            let is_close =
                difference.is_some_and(|interval| interval.half_width.is_some() && !interval.excludes_zero());
            cell.place == 1 || is_close
        })
        .collect();
    if leads.iter().all(|leads| *leads) {
        return;
    }
    for (row, leads) in rows.iter_mut().zip(leads) {
        if let Some(cell) = &mut row.cells[column] {
            cell.leads = leads;
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
