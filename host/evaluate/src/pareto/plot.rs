//! Error against run time as a picture (SVG): time on a logarithmic axis, nearness to the exact pictures in decibels
//! upwards, a colour and a shape for each device, the points on the Pareto front ringed, joined and named.

mod axis;
mod labels;

use super::record::{DeviceRecord, PointRecord};
use super::settings::BOUNDED;
use axis::Scale;
use labels::{Labels, Space};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;

/// The picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct PlotError(String);

const SIZE: (u32, u32) = (1100, 720);
/// Distinguishable also with colour blindness (Okabe and Ito).
pub const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(120, 94, 40),
];
const FONT: &str = "sans-serif";
const LABEL_SIZE: i32 = 13;
const KEY_SIZE: i32 = 14;
const KEY_LINE: i32 = 22;
const MARKER: i32 = 4;
const RING: i32 = 8;

type Failure = Box<dyn Error>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws the points of all devices. Points whose time or difference is NaN are dropped. Settings that are chosen by a
/// bound ([`BOUNDED`]) are a line of their own.
///
/// # Errors
/// [`PlotError`]; none is known to happen.
pub fn svg(title: &str, devices: &[DeviceRecord]) -> Result<String, PlotError> {
    let lines: Vec<DeviceRecord> = devices.iter().flat_map(lines_of).collect();
    let mut picture = String::new();
    draw(&mut picture, title, &lines).map_err(|error| PlotError(error.to_string()))?;
    Ok(picture)
}

/// A device's fixed settings, and those that a bound chooses, if there are any.
fn lines_of(device: &DeviceRecord) -> Vec<DeviceRecord> {
    let (mut bounded, fixed): (Vec<PointRecord>, Vec<PointRecord>) =
        device.points.iter().cloned().partition(|point| point.setting.starts_with(BOUNDED));
    let fixed = DeviceRecord { points: fixed, ..device.clone() };
    if bounded.is_empty() {
        return vec![fixed];
    }
    bounded.iter_mut().for_each(|point| point.best = true);
    let name = format!("{}, chosen by a bound on the error", device.device);
    vec![fixed, DeviceRecord { device: name, points: bounded, ..device.clone() }]
}

fn draw(picture: &mut String, title: &str, devices: &[DeviceRecord]) -> Result<(), Failure> {
    let scale = Scale::of(devices);
    let root = SVGBackend::with_string(picture, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, (FONT, 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(58)
        .build_cartesian_2d(scale.times(), scale.heights())?;
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .x_desc("seconds a picture, encoding included")
        .y_desc("PSNR against the exact pictures, dB")
        .x_label_formatter(&Scale::time_label)
        .y_label_formatter(&|height| scale.height_label(*height))
        .label_style((FONT, 13))
        .axis_desc_style((FONT, 14))
        .draw()?;

    let area = chart.plotting_area().strip_coord_spec();
    let (width, height) = area.dim_in_pixel();
    let size = [width as i32, height as i32];
    let (left, top) = area.get_base_pixel();
    let on_area = |point: &PointRecord| {
        let (x, y) = chart.backend_coord(&scale.place(point)?);
        Some([x - left, y - top])
    };
    let places: Vec<Vec<Option<[i32; 2]>>> =
        devices.iter().map(|device| device.points.iter().map(on_area).collect()).collect();

    let mut labels = Labels::new(size);
    places.iter().flatten().flatten().for_each(|at| labels.avoid(Space::around(*at, MARKER + 1)));
    for (index, device) in devices.iter().enumerate() {
        let row = size[1] - KEY_LINE * (devices.len() - index) as i32;
        labels.avoid(key(&area, Style::of(index), [size[0] - 12, row], &device.device)?);
    }
    for (index, (device, places)) in devices.iter().zip(&places).enumerate() {
        let style = Style::of(index);
        let mut best: Vec<([i32; 2], &str)> = Vec::new();
        for (point, at) in device.points.iter().zip(places) {
            let Some(at) = *at else { continue };
            style.mark(&area, at)?;
            if point.best {
                best.push((at, &point.setting));
            }
        }
        best.sort_unstable();
        let line: Vec<(i32, i32)> = best.iter().map(|([x, y], _)| (*x, *y)).collect();
        area.draw(&PathElement::new(line, style.colour.mix(0.5).stroke_width(1)))?;
        for (at, words) in best {
            area.draw(&Circle::new((at[0], at[1]), RING, style.colour.stroke_width(2)))?;
            let label = labels.place(at, words, LABEL_SIZE, RING);
            if label.is_far(at, RING) {
                area.draw(&PathElement::new([(at[0], at[1]), label.nearest(at)], style.colour.mix(0.4)))?;
            }
            // Lines and text stay separate elements.
            let Space { left, right, top, bottom } = label;
            area.draw(&Rectangle::new([(left, top), (right, bottom)], WHITE.mix(0.8).filled()))?;
            text(&area, words, label.middle(), LABEL_SIZE, HPos::Center, style.colour)?;
        }
    }
    root.present()?;
    Ok(())
}

/// How the points of a line look.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Their colour.
    pub colour: RGBColor,
    /// Circles (0), squares (1) or triangles.
    pub shape: usize,
}

impl Style {
    fn of(device: usize) -> Style {
        Style { colour: COLOURS[device % COLOURS.len()], shape: device % 3 }
    }

    /// Draws a point.
    ///
    /// # Errors
    /// None is known to happen.
    pub fn mark(self, area: &DrawingArea<SVGBackend<'_>, Shift>, [x, y]: [i32; 2]) -> Result<(), Box<dyn Error>> {
        let style = self.colour.filled();
        match self.shape {
            0 => area.draw(&Circle::new((x, y), MARKER, style))?,
            1 => area.draw(&Rectangle::new([(x - MARKER, y - MARKER), (x + MARKER, y + MARKER)], style))?,
            _ => area.draw(&TriangleMarker::new((x, y), MARKER + 2, style))?,
        }
        Ok(())
    }
}

/// A line of the key whose right end is at `end`; returns the space that it takes.
fn key(area: &Area<'_>, style: Style, [x, y]: [i32; 2], name: &str) -> Result<Space, Failure> {
    style.mark(area, [x, y])?;
    text(area, name, [x - 14, y], KEY_SIZE, HPos::Right, BLACK)?;
    let words = Space::of_text([0, 0], name, KEY_SIZE);
    Ok(Space { left: x - 14 - words.right, right: x + MARKER, top: y - KEY_LINE / 2, bottom: y + KEY_LINE / 2 })
}

fn text(
    area: &Area<'_>,
    words: &str,
    [x, y]: [i32; 2],
    size: i32,
    side: HPos,
    colour: RGBColor,
) -> Result<(), Failure> {
    let style = TextStyle::from((FONT, size).into_font()).color(&colour).pos(Pos::new(side, VPos::Center));
    area.draw(&Text::new(words.to_owned(), (x, y), style))?;
    Ok(())
}
