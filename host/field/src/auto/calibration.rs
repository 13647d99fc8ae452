//! What a confidence means: the error that pixels of that confidence have in the pictures of held-out
//! sources.

use serde::Serialize;

/// Most groups of confidences; each has as many pixels.
const MAX_GROUPS: usize = 16;
/// Fewest pixels of a group.
const MIN_PIXELS: usize = 64;

/// A pixel of a held-out source: its confidence, and the mean square error of its colours, each in `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) confidence: f32,
    pub(super) square: f32,
}

/// The errors of pixels of about this confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Mean confidence.
    pub confidence: f32,
    /// Root mean square error of their colours, as a share of the range.
    pub error: f32,
}

/// The errors by confidence, ascending confidences; errors fall with confidence.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Calibration(Vec<Group>);

impl Calibration {
    /// From the pixels of all held-out sources; `None` if there are too few. Groups of equally many pixels, by
    /// confidence; groups that are out of order are joined (pool adjacent violators, which is the least-squares fit of
    /// a function that does not rise).
    pub(super) fn of(mut samples: Vec<Sample>) -> Option<Calibration> {
        samples.sort_unstable_by(|a, b| a.confidence.total_cmp(&b.confidence));
        let count = (samples.len() / MIN_PIXELS).min(MAX_GROUPS);
        // Sums of confidences and squares, and numbers of pixels.
        let mut groups: Vec<[f64; 3]> = Vec::with_capacity(count);
        for group in 0..count {
            let pixels = &samples[group * samples.len() / count..(group + 1) * samples.len() / count];
            let sum = |value: fn(&Sample) -> f32| pixels.iter().map(|sample| f64::from(value(sample))).sum::<f64>();
            let mut last = [sum(|sample| sample.confidence), sum(|sample| sample.square), pixels.len() as f64];
            while let Some(before) = groups.pop_if(|before| before[1] / before[2] <= last[1] / last[2]) {
                last = [0, 1, 2].map(|index| before[index] + last[index]);
            }
            groups.push(last);
        }
        let group = |[confidence, square, count]: [f64; 3]| Group {
            confidence: (confidence / count) as f32,
            error: (square / count).sqrt() as f32,
        };
        (count > 0).then(|| Calibration(groups.into_iter().map(group).collect()))
    }

    /// The expected mean square error of a pixel: linear between the groups, as at the first and last one beyond them.
    fn square(&self, confidence: f32) -> f32 {
        let after = self.0.partition_point(|group| group.confidence < confidence);
        let square = |index: usize| self.0[index].error.powi(2);
        if after == 0 || after == self.0.len() {
            return square(after.min(self.0.len() - 1));
        }
        let (low, high) = (self.0[after - 1].confidence, self.0[after].confidence);
        let share = (confidence - low) / (high - low);
        square(after - 1) + share * (square(after) - square(after - 1))
    }

    /// The mean square error that is expected of a picture with these confidences; `None` without any.
    pub(super) fn mean_square(&self, confidences: impl ExactSizeIterator<Item = f32>) -> Option<f64> {
        let count = confidences.len();
        let sum: f64 = confidences.map(|confidence| f64::from(self.square(confidence))).sum();
        (count > 0).then(|| sum / count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels whose mean square error falls from 0.04 to 0 as the confidence rises, with noise of mean 0.
    fn falling() -> Vec<Sample> {
        let sample = |index: usize| {
            let confidence = (index % 4096) as f32 / 4096.0;
            let noise = if index.is_multiple_of(2) { 0.5 } else { 1.5 };
            Sample { confidence, square: 0.04 * (1.0 - confidence) * noise }
        };
        (0..8192).map(sample).collect()
    }

    #[test]
    fn the_error_of_a_confidence_is_that_of_its_pixels() {
        let calibration = Calibration::of(falling()).expect("pixels");
        for confidence in [0.1, 0.5, 0.9] {
            let square = calibration.square(confidence);
            assert!((square - 0.04 * (1.0 - confidence)).abs() < 0.001, "{confidence}: {square}");
        }
        // Half of a picture with an error of 0.2 (nearly), half of one of 0.
        let square = calibration.mean_square([0.0, 1.0].into_iter()).expect("pixels");
        assert!((square - 0.02).abs() < 0.001, "{square}");
        assert_eq!(calibration.mean_square([].into_iter()), None);
    }

    #[test]
    fn an_error_does_not_rise_with_confidence() {
        let rising = falling().into_iter().map(|sample| Sample { confidence: 1.0 - sample.confidence, ..sample });
        let calibration = Calibration::of(rising.collect()).expect("pixels");
        assert_eq!(calibration.0.len(), 1, "{calibration:?}");
        assert!((calibration.square(0.3) - 0.02).abs() < 1.0e-4);
        let of_all = Calibration::of(falling()).expect("pixels");
        assert!(of_all.0.windows(2).all(|pair| pair[0].error > pair[1].error), "{of_all:?}");
        assert_eq!(Calibration::of(falling()[..MIN_PIXELS - 1].to_vec()), None);
    }
}
