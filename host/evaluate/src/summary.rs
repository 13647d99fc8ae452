//! The tables of an evaluation: means over scenes with intervals, and how each scheme compares with averaging the views.
//!
//! Every scene counts the same: the targets and trials of a scene are averaged first, then the scenes. The difference of
//! two schemes is taken scene by scene before it is averaged: how hard a scene is cancels out.

use crate::metrics::interval::Interval;
use crate::run_folder::Finished;
use crate::{NEAREST_COPY, PSNR, SSIM};
use std::collections::{BTreeMap, BTreeSet};

/// The scheme that others are compared with: what published systems do.
pub const REFERENCE: &str = "mean";

/// How a metric is written and read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Metric {
    /// Its name in files.
    pub name: String,
    /// Its name in tables.
    pub label: String,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// Digits behind the point.
    pub decimals: usize,
    /// Whether more is better.
    pub larger_is_better: bool,
}

impl Metric {
    /// The metric of this name. Those that are not known here are distances: less is better.
    pub fn named(name: &str) -> Metric {
        let (label, unit, decimals, larger_is_better) = match name {
            PSNR => ("PSNR".to_owned(), "dB", 2, true),
            SSIM => ("SSIM".to_owned(), "", 3, true),
            other => (words(other), "", 3, false),
        };
        Metric { name: name.to_owned(), label, unit, decimals, larger_is_better }
    }

    /// What stands above its column.
    pub fn heading(&self) -> String {
        format!("{} {}", self.label, self.unit).trim_end().to_owned()
    }

    /// A value as text.
    pub fn text(&self, value: f64) -> String {
        format!("{value:.*}", self.decimals)
    }

    /// An interval as text: the mean, and behind it half the interval's width where there is one.
    pub fn interval_text(&self, interval: &Interval, signed: bool) -> String {
        let decimals = self.decimals;
        let mean = if signed { format!("{:+.decimals$}", interval.mean) } else { self.text(interval.mean) };
        match interval.half_width {
            Some(half) => format!("{mean} ± {}", self.text(half)),
            None => mean,
        }
    }
}

/// `LPIPS alex` for `lpips-alex`.
fn words(name: &str) -> String {
    let (metric, network) = name.split_once('-').unwrap_or((name, ""));
    format!("{} {network}", metric.to_uppercase()).trim_end().to_owned()
}

/// All schemes under the same conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The numbers of sources in it, ascending.
    pub source_counts: Vec<usize>,
    /// How many scenes.
    pub scene_count: usize,
    /// How many pictures of every scheme.
    pub target_count: usize,
    /// The metrics, in the order of their columns.
    pub metrics: Vec<Metric>,
    /// Copying the nearest source first, then the schemes in the order in which they were asked for.
    pub rows: Vec<Row>,
}

/// A scheme.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its name, or [`NEAREST_COPY`].
    pub scheme: String,
    /// One a metric; `None` where no picture has it.
    pub cells: Vec<Option<Cell>>,
    /// Mean time of a picture in seconds; `None` for copies.
    pub seconds: Option<f64>,
}

/// A scheme's metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Over the scenes.
    pub value: Interval,
    /// The difference from [`REFERENCE`], if that is in the table and this is another.
    pub versus_reference: Option<Interval>,
    /// 1 for the best of the column as it is written, 2 for the next; equal ones share a place.
    pub place: usize,
}

/// The tables of finished jobs: one, or one for each number of sources.
pub fn tables<'a>(finished: impl IntoIterator<Item = &'a Finished>, by_source_count: bool) -> Vec<Table> {
    let mut groups: BTreeMap<usize, Vec<&Finished>> = BTreeMap::new();
    for job in finished {
        groups.entry(if by_source_count { job.sources.len() } else { 0 }).or_default().push(job);
    }
    groups.values().map(|jobs| table(jobs)).collect()
}

fn table(jobs: &[&Finished]) -> Table {
    let scores = || jobs.iter().flat_map(|job| job.scores.iter().map(|score| (job.scene, score)));
    let (mut schemes, mut names): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    for (_, score) in scores() {
        if !schemes.contains(&score.scheme.as_str()) {
            schemes.push(&score.scheme);
        }
        names.extend(
            score.values.iter().map(|(name, _)| name.as_str()).filter(|name| !names.contains(name)).collect::<Vec<_>>(),
        );
    }
    // By scheme and metric: every scene's values.
    let mut values: BTreeMap<(&str, &str), BTreeMap<usize, Vec<f64>>> = BTreeMap::new();
    let mut times: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (scene, score) in scores() {
        for (name, value) in &score.values {
            values.entry((&score.scheme, name)).or_default().entry(scene).or_default().push(*value);
        }
        times.entry(&score.scheme).or_default().push(score.time.as_secs_f64());
    }
    let means: BTreeMap<(&str, &str), BTreeMap<usize, f64>> = values
        .into_iter()
        .map(|(key, scenes)| (key, scenes.into_iter().map(|(scene, values)| (scene, mean(&values))).collect()))
        .collect();

    let metrics: Vec<Metric> = names.iter().map(|name| Metric::named(name)).collect();
    let cell = |scheme: &str, metric: &Metric| {
        let own = means.get(&(scheme, metric.name.as_str()))?;
        let reference = means.get(&(REFERENCE, metric.name.as_str())).filter(|_| scheme != REFERENCE);
        let value = Interval::of(&own.values().copied().collect::<Vec<_>>())?;
        let versus_reference = reference.and_then(|reference| Interval::of_differences(own, reference));
        Some(Cell { value, versus_reference, place: 0 })
    };
    let row = |scheme: &&str| Row {
        scheme: (*scheme).to_owned(),
        cells: metrics.iter().map(|metric| cell(scheme, metric)).collect(),
        seconds: times.get(scheme).map(|times| mean(times)).filter(|_| *scheme != NEAREST_COPY),
    };
    let mut rows: Vec<Row> = schemes.iter().map(row).collect();
    for (column, metric) in metrics.iter().enumerate() {
        place(&mut rows, column, metric);
    }
    let count = |scheme: &str| times.get(scheme).map_or(0, Vec::len);
    Table {
        source_counts: jobs.iter().map(|job| job.sources.len()).collect::<BTreeSet<_>>().into_iter().collect(),
        scene_count: jobs.iter().map(|job| job.scene).collect::<BTreeSet<_>>().len(),
        target_count: schemes.iter().map(|scheme| count(scheme)).max().unwrap_or(0),
        metrics,
        rows,
    }
}

/// Places in a column, by what is written: values that look the same are equally good.
fn place(rows: &mut [Row], column: usize, metric: &Metric) {
    let written = |row: &Row| -> Option<f64> { metric.text(row.cells[column].as_ref()?.value.mean).parse().ok() };
    let mut values: Vec<f64> = rows.iter().filter_map(written).filter(|value| !value.is_nan()).collect();
    values.sort_by(|a, b| if metric.larger_is_better { b.total_cmp(a) } else { a.total_cmp(b) });
    values.dedup();
    for row in rows {
        let own = written(row);
        let place = values.iter().position(|value| Some(*value) == own).map_or(values.len(), |place| place) + 1;
        if let Some(cell) = &mut row.cells[column] {
            cell.place = place;
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
