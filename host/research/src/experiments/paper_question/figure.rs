//! The figure: the gain of error weighting over the mean by number of sources, a line for each field and kind of scenes.

use super::{Column, ERROR, Group, PAPER, cell};
use anyhow::anyhow;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::error::Error;
use viewfuse_evaluate::metrics::interval::Interval;

const SIZE: (u32, u32) = (760, 420);
const FONT: &str = "sans-serif";
/// A colour for each field.
const COLOURS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(120, 120, 120)];
/// Horizontal distance of neighbouring lines' points, in columns.
const SHIFT: f64 = 0.06;
/// Gains above this are not drawn to scale but named.
const HIGHEST: f64 = 3.2;

/// A line, or the paper's points.
struct Line {
    label: String,
    colour: RGBColor,
    is_paper: bool,
    points: Vec<(Column, f64, Option<f64>)>,
}

/// The figure as SVG.
pub(crate) fn svg(groups: &[Group]) -> anyhow::Result<String> {
    let mut picture = String::new();
    draw(&mut picture, &lines(groups)).map_err(|error| anyhow!("the figure: {error}"))?;
    Ok(picture)
}

fn lines(groups: &[Group]) -> Vec<Line> {
    let mut fields: Vec<&str> = Vec::new();
    groups.iter().for_each(|group| {
        if !fields.contains(&group.field.as_str()) {
            fields.push(&group.field);
        }
    });
    let colour = |field: &str| COLOURS[fields.iter().position(|own| *own == field).unwrap_or(0) % COLOURS.len()];
    let mut lines = Vec::new();
    for group in groups {
        let tables = group.tables();
        let point = |(column, table): &(Column, viewfuse_evaluate::summary::Table)| {
            let Interval { mean, half_width, .. } = cell(table, ERROR)?;
            (*column != Column::Own).then_some((*column, mean, half_width))
        };
        let points: Vec<_> = tables.iter().filter_map(point).collect();
        if !points.is_empty() {
            lines.push(Line { label: group.title(), colour: colour(&group.field), is_paper: false, points });
        }
    }
    for (name, points) in PAPER {
        if let Some(field) = fields.iter().find(|field| field.to_lowercase().contains(name)) {
            let points = points.iter().map(|(column, gain)| (*column, *gain, None)).collect();
            lines.push(Line { label: format!("the paper, {field}"), colour: colour(field), is_paper: true, points });
        }
    }
    lines
}

fn draw(picture: &mut String, lines: &[Line]) -> Result<(), Box<dyn Error>> {
    let mut columns: Vec<Column> = lines.iter().flat_map(|line| line.points.iter().map(|point| point.0)).collect();
    columns.sort_by_key(|column| column.place());
    columns.dedup();
    let ends = || lines.iter().flat_map(|line| line.points.iter());
    let lowest = ends().map(|(_, mean, half)| mean - half.unwrap_or(0.0)).fold(0.0, f64::min);
    let highest = ends().map(|(_, mean, half)| mean + half.unwrap_or(0.0)).fold(0.0, f64::max).min(HIGHEST);
    let root = SVGBackend::with_string(picture, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(-0.5..columns.len() as f64 - 0.5, lowest - 0.1..highest + 0.15)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .x_labels(2 * columns.len() + 1)
        .x_label_formatter(&|place| {
            let column = columns.get(place.round() as usize).filter(|_| (place - place.round()).abs() < 1.0e-6);
            column.map_or(String::new(), |column| column.label())
        })
        .x_desc("source views")
        .y_desc(format!("PSNR of {ERROR} over mean, dB"))
        .label_style((FONT, 15))
        .axis_desc_style((FONT, 16))
        .draw()?;
    for (index, line) in lines.iter().enumerate() {
        let shift = SHIFT * (index as f64 - 0.5 * (lines.len() as f64 - 1.0));
        let at = |column: Column| columns.iter().position(|own| *own == column).unwrap_or(0) as f64 + shift;
        let points: Vec<(f64, f64)> =
            line.points.iter().map(|(column, mean, _)| (at(*column), mean.min(HIGHEST))).collect();
        let colour = line.colour;
        for ((column, mean, half), point) in line.points.iter().zip(&points) {
            if let Some(half) = half {
                let ends = [(at(*column), mean - half), (at(*column), (mean + half).min(HIGHEST))];
                chart.draw_series([PathElement::new(ends, colour.mix(0.4).stroke_width(1))])?;
            }
            if *mean > HIGHEST {
                chart.draw_series([Text::new(format!("{mean:+.2}"), *point, (FONT, 14).into_font().color(&colour))])?;
            }
        }
        let label = line.label.clone();
        if line.is_paper {
            let crosses = points.iter().map(|point| Cross::new(*point, 5, colour.stroke_width(2)));
            let key = move |(x, y)| Cross::new((x + 10, y), 5, colour.stroke_width(2));
            chart.draw_series(crosses)?.label(label).legend(key);
        } else {
            // The second kind of scenes of a field is dashed.
            let is_second = lines[..index].iter().any(|other| other.colour == colour);
            let style = colour.stroke_width(2);
            let key = move |(x, y)| PathElement::new([(x, y), (x + 20, y)], style);
            match is_second {
                true => {
                    let dashed = DashedLineSeries::new(points.clone(), 6, 4, style);
                    let key = move |(x, y)| DashedPathElement::new([(x, y), (x + 20, y)], 6, 4, style);
                    chart.draw_series(dashed)?.label(label).legend(key)
                }
                false => chart.draw_series(LineSeries::new(points.clone(), style))?.label(label).legend(key),
            };
            chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.2))
        .label_font((FONT, 13))
        .draw()?;
    root.present()?;
    Ok(())
}
