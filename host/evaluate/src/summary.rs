//! The tables of an evaluation: means with intervals, and how each scheme compares with averaging the views and with the
//! baselines.
//!
//! Every scene counts the same: the targets and trials of a scene are averaged first, then the scenes. The difference of
//! two rows is taken scene by scene before it is averaged: how hard a scene is cancels out. Of a single scene the views
//! take the place of the scenes ([`Unit::Views`]): the intervals are then about other views of this scene, not about other
//! scenes.
//!
//! ```text
//! metric    how a metric is written
//! verdict   where a scheme stands against the baselines, in words
//! ```

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

/// What is counted: what intervals are over.
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
    /// The numbers of sources in it, ascending.
    pub source_counts: Vec<usize>,
    /// How many scenes.
    pub scene_count: usize,
    /// How many pictures of every scheme.
    pub target_count: usize,
    /// What intervals are over.
    pub unit: Unit,
    /// The metrics, in the order of their columns.
    pub metrics: Vec<Metric>,
    /// The metric that rows are compared by: an index into the metrics.
    pub headline: usize,
    /// The baselines first, then the schemes in the order in which they were asked for.
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
    /// One a metric; `None` where no picture has it.
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
    /// 1 for the best of the column as it is written, 2 for the next; equal ones share a place.
    pub place: usize,
    /// Whether it is the best of the column, or does not differ from the best beyond the interval of their difference.
    /// Nothing leads where that is true of all, or where there is a single scene or view to tell by.
    pub leads: bool,
}

/// A column of a table as it is shown, behind the rows' names and before their times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// A metric, by its index.
    Value(usize),
    /// What the headline metric is above that of copying the nearest source.
    OverCopy,
    /// What it is above that of [`REFERENCE`].
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

    /// The difference that a cell of the column's metric has in it; `None` for values.
    pub fn difference(self, cell: Option<&Cell>) -> Option<Interval> {
        match self {
            Column::Value(_) => None,
            Column::OverCopy => cell?.versus_copy,
            Column::OverReference => cell?.versus_reference,
        }
    }
}

impl Table {
    /// The columns that are shown: every metric, behind the headline metric its differences from the rows that are there.
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

    /// What stands above a column.
    pub fn heading(&self, column: Column) -> String {
        match column {
            Column::Value(metric) => self.metrics[metric].heading(),
            Column::OverCopy => "over copy".to_owned(),
            Column::OverReference => format!("over {REFERENCE}"),
        }
    }
}

/// A score and where it is from.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Which scene.
    pub scene: usize,
    /// Which job: what tells the targets of one name apart.
    pub job: usize,
    /// The score.
    pub score: &'a Score,
}

/// The tables of finished jobs: one, or one for each number of sources.
pub fn tables<'a>(finished: impl IntoIterator<Item = &'a Finished>, by_source_count: bool) -> Vec<Table> {
    let mut groups: BTreeMap<usize, Vec<Observation<'_>>> = BTreeMap::new();
    for Finished { job, scene, scores, sources, .. } in finished {
        let group = groups.entry(if by_source_count { sources.len() } else { 0 }).or_default();
        group.extend(scores.iter().map(|score| Observation { scene: *scene, job: *job, score }));
    }
    groups.values().map(|observations| table(observations)).collect()
}

/// What is counted once: a scene, or a target of a job.
type Counted<'a> = (usize, usize, &'a str);

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
    let scene_count = observations.iter().map(|own| own.scene).collect::<BTreeSet<_>>().len();
    let unit = if scene_count > 1 { Unit::Scenes } else { Unit::Views };
    // By scheme and metric: every scene's, or view's, values.
    let mut values: BTreeMap<(&str, &str), BTreeMap<Counted<'_>, Vec<f64>>> = BTreeMap::new();
    let mut times: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for Observation { scene, job, score } in observations {
        let counted = match unit {
            Unit::Scenes => (*scene, 0, ""),
            Unit::Views => (0, *job, score.target.as_str()),
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
            .map(|own| own.score.source_count)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect(),
        scene_count,
        target_count: times.values().map(Vec::len).max().unwrap_or(0),
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
    let own = means.get(&(scheme, metric))?;
    let versus = |other: &str| {
        let other = means.get(&(other, metric)).filter(|_| scheme != other)?;
        Interval::of_differences(own, other)
    };
    Some(Cell {
        value: Interval::of(&own.values().copied().collect::<Vec<_>>())?,
        versus_reference: versus(REFERENCE),
        versus_copy: versus(Baseline::NearestCopy.name()),
        place: 0,
        leads: false,
    })
}

/// A row's value in a column as it is written.
fn written(row: &Row, column: usize, metric: &Metric) -> Option<f64> {
    metric.text(row.cells[column].as_ref()?.value.mean).parse().ok()
}

/// Places in a column, by what is written: values that look the same are equally good.
fn place(rows: &mut [Row], column: usize, metric: &Metric) {
    let mut values: Vec<f64> =
        rows.iter().filter_map(|row| written(row, column, metric)).filter(|value| !value.is_nan()).collect();
    values.sort_by(|a, b| if metric.larger_is_better { b.total_cmp(a) } else { a.total_cmp(b) });
    values.dedup();
    for row in rows {
        let own = written(row, column, metric);
        let place = values.iter().position(|value| Some(*value) == own).map_or(values.len(), |place| place) + 1;
        if let Some(cell) = &mut row.cells[column] {
            cell.place = place;
        }
    }
}

/// Which rows of a column no other is above beyond the interval. Places must be there already.
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
            let own = means.get(&(row.scheme.as_str(), metric.name.as_str()));
            let difference = own.and_then(|own| Interval::of_differences(best, own));
            // Where the interval is not known, as of infinite scores, what is written decides.
            let is_close = difference.is_some_and(|own| own.half_width.is_some() && !own.excludes_zero());
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
