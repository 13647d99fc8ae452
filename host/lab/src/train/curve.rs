//! The curves of a run as a picture (SVG), loss on a logarithmic axis on the left, score in validation on the right;
//! and as numbers (CSV).

use super::state::Progressed;
use plotters::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

const SIZE: (u32, u32) = (900, 480);
const LOSS: RGBColor = RGBColor(0, 114, 178);
const SCORE: RGBColor = RGBColor(213, 94, 0);
/// Scores beyond this are drawn as this.
const MAX_SCORE: f64 = 1.0e6;
const FONT: &str = "sans-serif";

/// The curves as a table: the step, the mean loss since the point before, the score. Each line has a loss, a score or
/// both.
pub(crate) fn csv(so_far: &Progressed, score_name: &str) -> String {
    let mut lines: BTreeMap<u32, [String; 2]> = BTreeMap::new();
    for (column, points) in [&so_far.losses, &so_far.scores].into_iter().enumerate() {
        for (step, value) in points {
            lines.entry(*step).or_default()[column] = value.to_string();
        }
    }
    let line = |(step, [loss, score]): (u32, [String; 2])| format!("{step},{loss},{score}\n");
    format!("step,loss,{score_name}\n{}", lines.into_iter().map(line).collect::<String>())
}

/// Draws the curves; a run without points has empty axes.
pub(crate) fn svg(so_far: &Progressed, score_name: &str) -> String {
    let mut picture = String::new();
    // Drawing into memory does not fail; an error here must not stop a run.
    if draw(&mut picture, so_far, score_name).is_err() {
        picture.clear();
    }
    picture
}

fn draw(picture: &mut String, so_far: &Progressed, score_name: &str) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(picture, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let last = so_far.steps.max(1);
    let logarithm = |(step, loss): &(u32, f64)| (*step, loss.max(1.0e-12).log10());
    let losses: Vec<(u32, f64)> = so_far.losses.iter().map(logarithm).collect();
    // An axis has no steps between numbers that are so large.
    let scores: Vec<(u32, f64)> =
        so_far.scores.iter().map(|(step, score)| (*step, score.clamp(-MAX_SCORE, MAX_SCORE))).collect();
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .right_y_label_area_size(60)
        .build_cartesian_2d(0..last, span(&losses))?
        .set_secondary_coord(0..last, span(&scores));
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("step")
        .y_desc("loss")
        .y_label_formatter(&|power| format!("{:.2e}", 10_f64.powf(*power)))
        .axis_desc_style((FONT, 14).into_font().color(&LOSS))
        .draw()?;
    let style = (FONT, 14).into_font().color(&SCORE);
    chart.configure_secondary_axes().y_desc(score_name).axis_desc_style(style).draw()?;
    chart.draw_series(LineSeries::new(losses, LOSS))?;
    chart.draw_secondary_series(LineSeries::new(scores.iter().copied(), SCORE.stroke_width(2)))?;
    chart.draw_secondary_series(scores.into_iter().map(|at| Circle::new(at, 3, SCORE.filled())))?;
    root.present()?;
    Ok(())
}

/// The range of the values, with a margin; a default range without values.
fn span(points: &[(u32, f64)]) -> Range<f64> {
    let finite = || points.iter().map(|(_, value)| *value).filter(|value| value.is_finite());
    let (least, most) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    if least > most {
        return 0.0..1.0;
    }
    let room = 0.05 * (most - least).max(0.1);
    least - room..most + room
}
