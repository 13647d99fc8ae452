//! The ranges of the axes, and their grid lines. The coordinates are the decimal logarithm of the time in seconds,
//! and decibels.

use super::super::record::{DeviceRecord, DifferenceRecord, PointRecord};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use std::ops::Range;

/// Least distance from the nearest pictures that differ to the line of equal pictures, decibels.
const EQUAL_ABOVE: f64 = 10.0;

/// Both axes.
pub(super) struct Scale {
    /// Seconds.
    times: Range<f64>,
    /// Decibels.
    heights: Range<f64>,
    /// The height of pictures that are equal to the exact ones.
    equal: f64,
}

impl Scale {
    /// The scale that all points fit on.
    pub(super) fn of(devices: &[DeviceRecord]) -> Scale {
        let points = || devices.iter().flat_map(|device| &device.points).filter(|point| point.seconds > 0.0);
        let ratios = || points().filter_map(|point| point.versus_exact.psnr);
        let tens = |ratio: f64| 10.0 * (ratio / 10.0).floor();
        let equal = tens(ratios().fold(30.0, f64::max)) + 10.0 + EQUAL_ABOVE;
        let lowest = tens(ratios().fold(equal - 20.0, f64::min) - 1.0);
        let shortest = points().map(|point| point.seconds).fold(f64::INFINITY, f64::min);
        let longest = points().map(|point| point.seconds).fold(0.0, f64::max);
        // Margins for labels at both ends.
        let times = if shortest <= longest { 0.7 * shortest..1.5 * longest } else { 0.1..10.0 };
        Scale { times, heights: lowest..equal + 0.5 * EQUAL_ABOVE, equal }
    }

    /// The position of a point; `None` if its time or its difference is NaN.
    pub(super) fn place(&self, point: &PointRecord) -> Option<(f64, f64)> {
        let DifferenceRecord { root_mean_square, psnr, .. } = point.versus_exact;
        root_mean_square.filter(|_| point.seconds > 0.0).map(|_| (point.seconds.log10(), psnr.unwrap_or(self.equal)))
    }

    /// Lines at 1, 2 and 5 times powers of ten of a second.
    pub(super) fn times(&self) -> Axis {
        let ends = self.times.start.log10()..self.times.end.log10();
        let powers = ends.start.floor() as i32..=ends.end.ceil() as i32;
        let lines = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit: f64| f64::from(power) + digit.log10()));
        Axis { lines: lines.filter(|line| ends.contains(line)).collect(), ends }
    }

    /// The label of a time's grid line.
    pub(super) fn time_label(line: &f64) -> String {
        let places = (-line.floor()).max(0.0) as usize;
        format!("{:.places$}", 10.0_f64.powf(*line))
    }

    /// Lines every 10 or 20 decibels, and the line of equal pictures.
    pub(super) fn heights(&self) -> Axis {
        let step = if self.equal - self.heights.start > 120.0 { 20.0 } else { 10.0 };
        let count = ((self.equal - self.heights.start) / step) as u32;
        let below = (0..=count).map(|line| self.heights.start + step * f64::from(line));
        let below = below.filter(|height| *height <= self.equal - EQUAL_ABOVE);
        Axis { lines: below.chain([self.equal]).collect(), ends: self.heights.clone() }
    }

    /// The label of a height's grid line.
    pub(super) fn height_label(&self, line: f64) -> String {
        if line == self.equal { "equal".to_owned() } else { format!("{line}") }
    }
}

/// An axis with lines of our choice.
pub(super) struct Axis {
    ends: Range<f64>,
    lines: Vec<f64>,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let share = (value - self.ends.start) / (self.ends.end - self.ends.start);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // The same for bold and for light lines, which are not drawn.
        if hint.max_num_points() == 0 { Vec::new() } else { self.lines.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.ends.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_time() {
        let scale = Scale { times: 0.015..12.0, heights: 0.0..1.0, equal: 1.0 };
        let labels: Vec<String> = scale.times().lines.iter().map(Scale::time_label).collect();
        assert_eq!(labels, ["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10"]);
    }

    #[test]
    fn nothing_to_show_has_a_scale() {
        let scale = Scale::of(&[]);
        assert!(scale.times().lines.len() > 3 && scale.heights().lines.len() > 3);
    }
}
