//! The table: means over the pictures of a group.

use super::super::planes::samples::Colour;
use super::oracle::{Oracles, Picture, errors};
use std::fmt::Write;

/// The gains, in the order of the columns.
const GAINS: [&str; 10] = [
    "temperature",
    "visibility",
    "one source",
    "blend",
    "plane",
    "plane and blend",
    "depth",
    "depth and visibility",
    "depth and blend",
    "opacity",
];

/// What is known of a picture.
pub(crate) struct Row {
    /// The group that it belongs to.
    pub(crate) group: String,
    /// Score of the field, and of the plane sweep, decibels.
    pub(crate) scores: [f64; 2],
    /// What each oracle gains over the plane sweep, decibels.
    pub(crate) gains: [Option<f64>; 10],
    /// Shares of the pixels that no source sees by the field's own visibility and by exact depths, and the former's share of
    /// the squared error.
    pub(crate) unseen: [Option<f64>; 3],
}

/// A target as it is scored.
pub(crate) struct Target<'a> {
    /// Its photograph.
    pub(crate) truth: &'a [Colour],
    /// The pixels that count.
    pub(crate) seen: &'a [bool],
    /// The field's opacity.
    pub(crate) opacity: &'a [f32],
    /// The photograph's.
    pub(crate) alpha: Option<&'a [f32]>,
    /// What is behind.
    pub(crate) background: Colour,
}

impl Target<'_> {
    /// The score of a picture that is laid over the background, decibels.
    fn score(&self, picture: &Picture, opacity: &[f32]) -> f64 {
        let (sum, count) = self.error(picture, opacity, |_| true);
        10.0 * (3.0 * count as f64 / sum.max(1.0e-12)).log10()
    }

    /// Sum of the squared errors of the pixels that count, and their number.
    fn error(&self, picture: &Picture, opacity: &[f32], counts: impl Fn(usize) -> bool) -> (f64, usize) {
        let over = |(colour, opacity): (&Colour, &f32)| {
            [0, 1, 2].map(|channel| {
                let value = colour[channel] * opacity + self.background[channel] * (1.0 - opacity);
                value.clamp(0.0, 1.0)
            })
        };
        let shown: Picture = picture.iter().zip(opacity).map(over).collect();
        let errors = errors(&shown, self.truth);
        let own = (0..errors.len()).filter(|pixel| self.seen[*pixel] && counts(*pixel));
        own.fold((0.0, 0), |(sum, count), pixel| (sum + f64::from(errors[pixel]), count + 1))
    }

    /// The row of a picture; `field` is the score of the field as it is.
    pub(crate) fn row(&self, group: &str, field: f64, oracles: &Oracles) -> Row {
        let own = self.score(&oracles.base, self.opacity);
        let gain = |picture: &Picture| Some(self.score(picture, self.opacity) - own);
        let exact = oracles.exact.as_ref();
        let gains = [
            gain(&oracles.temperature),
            gain(&oracles.visibility),
            gain(&oracles.source),
            gain(&oracles.blend),
            gain(&oracles.depth),
            gain(&oracles.depth_blend),
            exact.and_then(|exact| gain(&exact.depth)),
            exact.and_then(|exact| gain(&exact.visibility)),
            exact.and_then(|exact| gain(&exact.blend)),
            self.alpha.map(|alpha| self.score(&oracles.base, alpha) - own),
        ];
        let (all, count) = self.error(&oracles.base, self.opacity, |_| true);
        let (error, unseen) = self.error(&oracles.base, self.opacity, |pixel| oracles.unseen[pixel] > 0.5);
        let share = |pixels: usize| pixels as f64 / count.max(1) as f64;
        let exactly = exact.map(|exact| {
            let known: Vec<bool> = exact.unseen.iter().filter_map(|unseen| *unseen).collect();
            known.iter().filter(|unseen| **unseen).count() as f64 / known.len().max(1) as f64
        });
        Row {
            group: group.to_owned(),
            scores: [field, own],
            gains,
            unseen: [Some(share(unseen)), exactly, Some(error / all.max(1.0e-12))],
        }
    }
}

/// The table as text: a line for each group, in the order of the rows.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut text =
        format!("| scenes | pictures | field | sweep | {} | unseen | unseen, exact | its error |\n", GAINS.join(" | "));
    text += &format!("|---|{}\n", "---|".repeat(GAINS.len() + 6));
    let mut groups: Vec<&str> = Vec::new();
    rows.iter().for_each(|row| {
        if !groups.contains(&row.group.as_str()) {
            groups.push(&row.group);
        }
    });
    for group in groups {
        let own: Vec<&Row> = rows.iter().filter(|row| row.group == group).collect();
        let mean = |value: &dyn Fn(&Row) -> Option<f64>| -> Option<f64> {
            let values: Vec<f64> = own.iter().filter_map(|row| value(row)).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let _ = write!(text, "| {group} | {} |", own.len());
        for score in 0..2 {
            let _ = write!(text, " {:.2} |", mean(&|row| Some(row.scores[score])).unwrap_or(f64::NAN));
        }
        for gain in 0..GAINS.len() {
            let _ = match mean(&|row| row.gains[gain]) {
                Some(gain) => write!(text, " {gain:+.2} |"),
                None => write!(text, " |"),
            };
        }
        for unseen in 0..3 {
            let _ = match mean(&|row| row.unseen[unseen]) {
                Some(share) => write!(text, " {:.1} % |", 100.0 * share),
                None => write!(text, " |"),
            };
        }
        text.push('\n');
    }
    text
}
