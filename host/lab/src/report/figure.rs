//! A metric over the number of sources, a line for each scheme, with intervals.

use super::ReportError;
use maud::{Markup, html};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use std::error::Error;
use std::ops::Range;
use viewfuse_evaluate::baseline::Baseline;
use viewfuse_evaluate::metrics::interval::Interval;
use viewfuse_evaluate::pareto::plot::{COLOURS, Style};
use viewfuse_evaluate::summary::{REFERENCE, Table};

const SIZE: (u32, u32) = (520, 360);
/// The style of baselines, which are not schemes.
const COPY: RGBColor = RGBColor(138, 143, 152);
const FONT: &str = "sans-serif";
/// Horizontal distance of the first and the last scheme's intervals at one number of sources, in doublings.
const SPREAD: f64 = 0.3;

/// The baselines differ in the shape of their points.
fn baseline_shape(name: &str) -> usize {
    Baseline::ALL.iter().position(|baseline| baseline.name() == name).unwrap_or(0)
}

/// The style of a scheme's points: the reference is black, baselines are grey, the others, counted from 0, cycle
/// through colours and then shapes.
fn style(scheme: &str, other: usize) -> Style {
    match scheme {
        REFERENCE => Style { colour: BLACK, shape: 0 },
        baseline if Baseline::is_named(baseline) => Style { colour: COPY, shape: baseline_shape(baseline) },
        _ => Style { colour: COLOURS[other % COLOURS.len()], shape: other / COLOURS.len() % 3 },
    }
}

/// A scheme's line: by number of sources.
struct Line {
    style: Style,
    points: Vec<(usize, Interval)>,
}

/// Two figures for each metric: the metric, and the difference from the mean. There is one table for each number of
/// sources.
pub(super) fn all(tables: &[Table]) -> Result<Vec<String>, ReportError> {
    let mut figures = Vec::new();
    for (column, metric) in tables.first().map_or(&[][..], |table| &table.metrics).iter().enumerate() {
        let (values, differences) = (lines(tables, column, false), lines(tables, column, true));
        figures.push(svg(&metric.heading(), &values)?);
        if !differences.is_empty() {
            figures.push(svg(&format!("{} over {REFERENCE}", metric.heading()), &differences)?);
        }
    }
    Ok(figures)
}

/// The key of all figures.
pub(super) fn key(tables: &[Table]) -> Markup {
    html! {
        ul.key {
            @for (scheme, style) in styles(tables) {
                @let RGBColor(red, green, blue) = style.colour;
                @let colour = format!("#{red:02X}{green:02X}{blue:02X}");
                li {
                    span.drawn { svg width="12" height="12" viewBox="-6 -6 12 12" {
                        @match style.shape {
                            0 => circle r="4.5" fill=(colour) {},
                            1 => rect x="-4.5" y="-4.5" width="9" height="9" fill=(colour) {},
                            _ => polygon points="0,-5.5 5.5,4.5 -5.5,4.5" fill=(colour) {},
                        }
                    } }
                    " " (scheme)
                }
            }
        }
    }
}

/// The schemes with their styles.
fn styles(tables: &[Table]) -> Vec<(&str, Style)> {
    let schemes = tables.first().into_iter().flat_map(|table| &table.rows).map(|row| row.scheme.as_str());
    let mut others = 0;
    let styled = |scheme| {
        let style = style(scheme, others);
        others += usize::from(scheme != REFERENCE && !Baseline::is_named(scheme));
        (scheme, style)
    };
    schemes.map(styled).collect()
}

/// The lines of a metric. Baselines are not in figures of differences: their range would hide the differences between
/// schemes.
fn lines(tables: &[Table], column: usize, differences: bool) -> Vec<Line> {
    let point = |table: &Table, scheme: &str| {
        let cell = table.rows.iter().find(|row| row.scheme == scheme)?.cells.get(column)?.as_ref()?;
        let interval = if differences { cell.versus_reference? } else { cell.value };
        interval.mean.is_finite().then_some((*table.source_counts.first()?, interval))
    };
    let line = |(scheme, style): (&str, Style)| Line {
        style,
        points: tables.iter().filter_map(|table| point(table, scheme)).collect(),
    };
    let shown = styles(tables).into_iter().filter(|(scheme, _)| !(differences && Baseline::is_named(scheme)));
    shown.map(line).filter(|line| !line.points.is_empty()).collect()
}

fn svg(label: &str, lines: &[Line]) -> Result<String, ReportError> {
    let mut picture = String::new();
    draw(&mut picture, label, lines).map_err(|error| ReportError::Figure(error.to_string()))?;
    Ok(picture)
}

fn draw(picture: &mut String, label: &str, lines: &[Line]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::with_string(picture, SIZE).into_drawing_area();
    let heights = heights(lines);
    // As many decimals as make neighbouring labels different.
    let places = (1.0 - ((heights.end - heights.start) / 2.0).log10().floor()).clamp(0.0, 6.0) as usize;
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(Counts::of(lines), heights)?;
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .x_desc("number of sources")
        .y_desc(label)
        .y_labels(7)
        .x_label_formatter(&|position| format!("{:.0}", position.exp2()))
        .y_label_formatter(&|height| format!("{height:.places$}"))
        .label_style((FONT, 15))
        .axis_desc_style((FONT, 16))
        .draw()?;
    let area = chart.plotting_area().strip_coord_spec();
    let (left, top) = area.get_base_pixel();
    for (index, Line { style, points }) in lines.iter().enumerate() {
        // Side by side, so that intervals do not cover each other.
        let shift = SPREAD * ((index as f64 + 0.5) / lines.len() as f64 - 0.5);
        let place = |count: usize| (count as f64).log2() + shift;
        for (count, interval) in points {
            let Some(half) = interval.half_width else { continue };
            let ends = [(place(*count), interval.mean - half), (place(*count), interval.mean + half)];
            chart.draw_series([PathElement::new(ends, style.colour.mix(0.4).stroke_width(1))])?;
        }
        let points: Vec<(f64, f64)> = points.iter().map(|(count, interval)| (place(*count), interval.mean)).collect();
        chart.draw_series([PathElement::new(points.clone(), style.colour.mix(0.8).stroke_width(2))])?;
        for point in points {
            let (x, y) = chart.backend_coord(&point);
            style.mark(&area, [x - left, y - top])?;
        }
    }
    root.present()?;
    Ok(())
}

/// From below the lowest point to above the highest; intervals extend it at most by the range of the points.
fn heights(lines: &[Line]) -> Range<f64> {
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
    fn of(lines: &[Line]) -> Counts {
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
