//! The Pareto front of time and error, and the recommended point.

use super::Point;

/// Largest invisible loss against the photographs, decibels.
pub const MAX_LOSS: f64 = 0.1;
/// Peak signal to noise ratio against the exact picture from which two pictures look the same, decibels: a difference
/// of 1 % of the range.
pub const SAME_LOOK: f64 = 40.0;

/// Marks the points, given as time and error, that no other point dominates: none is at most as slow and at most as far
/// off, and better in one of the two. Points that are equal in both are all marked. A point with a NaN is never marked
/// and dominates none.
pub fn best_for_their_time(points: &[[f64; 2]]) -> Vec<bool> {
    let is_number = |point: &[f64; 2]| point.iter().all(|value| !value.is_nan());
    let beats = |[time, error]: &[f64; 2], other: &[f64; 2]| {
        *time <= other[0] && *error <= other[1] && (*time < other[0] || *error < other[1])
    };
    points.iter().map(|point| is_number(point) && !points.iter().any(|other| beats(other, point))).collect()
}

/// The same for measured points: median time and root mean square difference from the exact pictures.
pub fn best_points(points: &[Point]) -> Vec<bool> {
    let pairs: Vec<_> = points.iter().map(|point| [point.seconds, point.difference.root_mean_square()]).collect();
    best_for_their_time(&pairs)
}

/// The loss of a point in PSNR against the photographs compared with the first point, decibels; negative if it is
/// nearer to them.
pub fn loss(points: &[Point], point: &Point) -> Option<f64> {
    Some(points.first()?.truth_psnr? - point.truth_psnr?)
}

/// The fastest point that loses at most [`MAX_LOSS`] against the photographs. `None` without photographs.
pub fn fastest_without_loss(points: &[Point]) -> Option<&Point> {
    fastest(points, |point| loss(points, point).is_some_and(|loss| loss <= MAX_LOSS))
}

/// The fastest point whose pictures have a PSNR of at least [`SAME_LOOK`] against the first one's.
pub fn fastest_of_same_look(points: &[Point]) -> Option<&Point> {
    fastest(points, |point| point.difference.psnr() >= SAME_LOOK)
}

fn fastest(points: &[Point], is_good: impl Fn(&Point) -> bool) -> Option<&Point> {
    points.iter().filter(|point| is_good(point)).min_by(|a, b| a.seconds.total_cmp(&b.seconds))
}

#[cfg(test)]
mod tests {
    use super::super::difference::Difference;
    use super::*;

    #[test]
    fn what_no_other_point_beats_is_marked() {
        /// What it shows, points, and which of them are marked.
        type Case<'a> = (&'a str, &'a [[f64; 2]], &'a [bool]);
        let nan = f64::NAN;
        let cases: [Case<'_>; 6] = [
            ("none", &[], &[]),
            ("one", &[[3.0, 7.0]], &[true]),
            (
                "slower and worse is beaten",
                &[[1.0, 5.0], [2.0, 3.0], [2.5, 4.0], [3.0, 0.0], [4.0, 0.0], [1.0, 6.0]],
                &[true, true, false, true, false, false],
            ),
            ("ties are all marked", &[[1.0, 2.0], [1.0, 2.0], [2.0, 2.0]], &[true, true, false]),
            ("NaN is not marked and beats nothing", &[[nan, 0.0], [0.0, nan], [5.0, 5.0]], &[false, false, true]),
            ("NaN alone", &[[nan, nan]], &[false]),
        ];
        for (case, points, marked) in cases {
            assert_eq!(best_for_their_time(points), marked, "{case}");
        }
    }

    fn point(setting: &str, seconds: f64, error: f32, truth_psnr: Option<f64>) -> Point {
        let mut difference = Difference::default();
        difference.add(&[[error; 4]], &[[0.0; 4]]);
        Point {
            setting: setting.to_owned(),
            seconds,
            seconds_range: [seconds; 2],
            encode_seconds: 0.0,
            difference,
            truth_psnr,
            record: viewfuse_field::Record::default(),
            is_repeatable: true,
        }
    }

    #[test]
    fn what_to_take() {
        let points = [
            point("exact", 9.0, 0.0, Some(20.0)),
            point("near", 5.0, 0.001, Some(20.3)),
            point("farther", 3.0, 0.02, Some(19.95)),
            point("far", 1.0, 0.3, Some(12.0)),
            point("broken", 0.1, f32::NAN, Some(f64::NAN)),
        ];
        assert_eq!(fastest_without_loss(&points).map(|point| point.setting.as_str()), Some("farther"));
        assert_eq!(fastest_of_same_look(&points).map(|point| point.setting.as_str()), Some("near"));
        assert_eq!(best_points(&points), [true, true, true, true, false]);
        let unknown = points.map(|point| Point { truth_psnr: None, ..point });
        assert_eq!(fastest_without_loss(&unknown), None);
        assert_eq!(fastest_of_same_look(&[]), None);
    }
}
