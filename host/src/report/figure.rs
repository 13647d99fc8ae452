//! A metric over the number of sources, a line for each scheme, with intervals.

use super::ReportError;
use crate::evaluate::NEAREST_COPY;
use crate::pareto::plot::COLOURS;
use crate::summary::{Interval, REFERENCE, Table};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::ops::Range;

const SIZE: (u32, u32) = (720, 420);
/// Room for the names of the schemes on the right.
const KEY_WIDTH: u32 = 190;
const KEY_LINE: i32 = 20;
const FONT: &str = "sans-serif";
const MARKER: i32 = 4;
/// How far intervals of the first and the last scheme stand apart at one number of sources, in doublings.
const SPREAD: f64 = 0.3;

/// A scheme's line: by number of sources.
struct Line<'a> {
    scheme: &'a str,
    colour: RGBColor,
    shape: usize,
    points: Vec<(usize, Interval)>,
}

/// For each metric of the tables, one a number of sources, two figures: the metric, and the difference from the mean.
pub(super) fn all(tables: &[Table]) -> Result<Vec<String>, ReportError> {
    let mut figures = Vec::new();
    for (column, metric) in tables.first().map_or(&[][..], |table| &table.metrics).iter().enumerate() {
        let (values, differences) = (lines(tables, column, false), lines(tables, column, true));
        figures.push(svg(&metric.label, metric.decimals, &values)?);
        if !differences.is_empty() {
            figures.push(svg(&format!("{} over {REFERENCE}", metric.label), metric.decimals, &differences)?);
        }
    }
    Ok(figures)
}

/// The lines of a metric. Copies have no place among differences, and would hide those.
fn lines(tables: &[Table], column: usize, differences: bool) -> Vec<Line<'_>> {
    let schemes = tables.first().into_iter().flat_map(|table| &table.rows).map(|row| row.scheme.as_str());
    let point = |table: &Table, scheme: &str| {
        let cell = table.rows.iter().find(|row| row.scheme == scheme)?.cells.get(column)?.as_ref()?;
        let interval = if differences { cell.versus_reference? } else { cell.value };
        interval.mean.is_finite().then_some((*table.source_counts.first()?, interval))
    };
    let line = |(index, scheme): (usize, &'_ str)| {
        let points: Vec<_> = tables.iter().filter_map(|table| point(table, scheme)).collect();
        (points, index)
    };
    schemes
        .enumerate()
        .filter(|(_, scheme)| !(differences && *scheme == NEAREST_COPY))
        .map(|(index, scheme)| {
            let (points, index) = line((index, scheme));
            Line { scheme, colour: COLOURS[index % COLOURS.len()], shape: index / COLOURS.len(), points }
        })
        .filter(|line| !line.points.is_empty())
        .collect()
}

fn svg(label: &str, decimals: usize, lines: &[Line<'_>]) -> Result<String, ReportError> {
    let mut picture = String::new();
    draw(&mut picture, label, decimals, lines).map_err(|error| ReportError::Figure(error.to_string()))?;
    Ok(picture)
}

fn draw(picture: &mut String, label: &str, decimals: usize, lines: &[Line<'_>]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::with_string(picture, SIZE).into_drawing_area();
    let (plot, key) = root.split_horizontally(SIZE.0 - KEY_WIDTH);
    let counts = Counts::of(lines);
    let mut chart = ChartBuilder::on(&plot)
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(56)
        .build_cartesian_2d(counts, heights(lines))?;
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .x_desc("number of sources")
        .y_desc(label)
        .x_label_formatter(&|position| format!("{:.0}", position.exp2()))
        .y_label_formatter(&|height| format!("{height:.*}", decimals.saturating_sub(1)))
        .label_style((FONT, 14))
        .axis_desc_style((FONT, 15))
        .draw()?;
    for (index, line) in lines.iter().enumerate() {
        // Side by side, so that intervals do not cover each other.
        let shift = SPREAD * ((index as f64 + 0.5) / lines.len() as f64 - 0.5);
        let place = |count: usize| (count as f64).log2() + shift;
        for (count, interval) in &line.points {
            let Some(half) = interval.half_width else { continue };
            let ends = [(place(*count), interval.mean - half), (place(*count), interval.mean + half)];
            chart.draw_series([PathElement::new(ends, line.colour.mix(0.4).stroke_width(1))])?;
        }
        let points: Vec<(f64, f64)> =
            line.points.iter().map(|(count, interval)| (place(*count), interval.mean)).collect();
        chart.draw_series([PathElement::new(points.clone(), line.colour.mix(0.8).stroke_width(2))])?;
        let area = chart.plotting_area().strip_coord_spec();
        let (left, top) = area.get_base_pixel();
        for point in points {
            let (x, y) = chart.backend_coord(&point);
            mark(&area, line, (x - left, y - top))?;
        }
    }
    // In the order in which the lines end, the highest first.
    let mut sorted: Vec<&Line<'_>> = lines.iter().collect();
    let end = |line: &Line<'_>| line.points.last().map_or(f64::NAN, |(_, interval)| interval.mean);
    sorted.sort_by(|a, b| end(b).total_cmp(&end(a)));
    for (index, line) in sorted.into_iter().enumerate() {
        let y = 20 + KEY_LINE * index as i32;
        mark(&key, line, (10, y))?;
        let style = TextStyle::from((FONT, 14).into_font()).color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        key.draw(&Text::new(line.scheme.to_owned(), (22, y), style))?;
    }
    root.present()?;
    Ok(())
}

fn mark(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    line: &Line<'_>,
    at: (i32, i32),
) -> Result<(), Box<dyn Error>> {
    let style = line.colour.filled();
    match line.shape % 3 {
        0 => area.draw(&Circle::new(at, MARKER, style))?,
        1 => area.draw(&Rectangle::new([(at.0 - MARKER, at.1 - MARKER), (at.0 + MARKER, at.1 + MARKER)], style))?,
        _ => area.draw(&TriangleMarker::new(at, MARKER + 2, style))?,
    }
    Ok(())
}

/// From below the lowest point to above the highest; of intervals what reaches no farther than the points do again.
fn heights(lines: &[Line<'_>]) -> Range<f64> {
    let intervals = || lines.iter().flat_map(|line| line.points.iter().map(|(_, interval)| interval));
    let (least, most) = intervals().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), interval| {
        (least.min(interval.mean), most.max(interval.mean))
    });
    let reach = (most - least).max(1.0e-3 * most.abs()).max(1.0e-6);
    let (lower, upper) = intervals().fold((least, most), |(lower, upper), interval| {
        let half = interval.half_width.unwrap_or(0.0);
        (lower.min(interval.mean - half), upper.max(interval.mean + half))
    });
    let room = 0.05 * reach;
    lower.max(least - 0.6 * reach) - room..upper.min(most + 0.6 * reach) + room
}

/// Numbers of sources on a logarithmic axis, a line at each.
struct Counts {
    counts: Vec<usize>,
}

impl Counts {
    fn of(lines: &[Line<'_>]) -> Counts {
        let mut counts: Vec<usize> =
            lines.iter().flat_map(|line| line.points.iter().map(|(count, _)| *count)).collect();
        counts.sort_unstable();
        counts.dedup();
        Counts { counts }
    }
}

impl Ranged for Counts {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let Range { start, end } = self.range();
        first + ((value - start) / (end - start) * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.max_num_points() == 0 {
            Vec::new()
        } else {
            self.counts.iter().map(|count| (*count as f64).log2()).collect()
        }
    }

    fn range(&self) -> Range<f64> {
        let end = |count: Option<&usize>| count.map_or(0.0, |count| (*count as f64).log2());
        end(self.counts.first()) - 0.4..end(self.counts.last()) + 0.4
    }
}
