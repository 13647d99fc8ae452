//! How far a photograph's pose is to be trusted, by what it passed.
//!
//! Held-out pictures tell where neighbours are near. From some 20 degrees on they may be no better than copies at
//! true poses, too: then attempts must agree more closely and over many points, with a focal length that is known, as a
//! wrong one turns photographs in all attempts alike.

use crate::agreement::median;
use crate::focal::Cameras;
use crate::held_out::HeldOutScores;
use crate::ties::Ties;

/// Least decibels by which a held-out photograph is met better at its pose than at disturbed ones.
const MIN_SHARPNESS: f64 = 0.5;
/// Least decibels by which one is met better than its copies.
const MIN_GAIN: f64 = 0.5;
/// Least decibels by which held-out photographs are met better than their copies, in the median.
const MIN_MEDIAN_GAIN: f64 = 1.0;

/// Degrees to the nearest photograph from which on a held-out picture does not tell: at true poses, too, it may be met
/// no better than copies.
const MAX_TOLD: f32 = 20.0;
/// Most degrees between attempts, and fewest points, of a photograph whose held-out picture does not tell.
pub(crate) const MAX_FAR_DIFFERENCE: f64 = 1.0;
const MIN_POINTS_OF_THREE: usize = 30;
const MIN_SECOND_SHARED: usize = 20;

/// How far an accepted pose is to be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Trust {
    /// Attempts agree on it, and so do the photographs: held out, it is met at its pose.
    Sure,
    /// Attempts agree on it closely and over many points; its neighbours are too far away for more.
    Doubtful,
}

/// What a photograph passed.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verified {
    /// The verdict on its pose.
    #[serde(rename = "verdict")]
    pub trust: Trust,
    /// Degrees between its relative rotations and those of the attempt that agrees best.
    pub rotation_difference: f64,
    /// What ties it to the other accepted ones.
    #[serde(flatten)]
    pub ties: Ties,
    /// The scores when it was held out.
    #[serde(flatten)]
    pub held_out: HeldOutScores,
}

/// How far a photograph is to be trusted by what it passed, or why it is not.
pub(crate) fn trust(passed: &Verified, cameras: &Cameras) -> Result<Trust, String> {
    let Verified { rotation_difference, ties, held_out, .. } = passed;
    let Some(failure) = failure(held_out) else { return Ok(Trust::Sure) };
    if tells(passed, cameras) {
        return Err(failure);
    }
    let far =
        format!("the nearest photograph is {:.0} degrees away, too far for a held-out picture to tell", ties.nearest);
    if *rotation_difference > MAX_FAR_DIFFERENCE {
        return Err(format!("{far}, and attempts differ by {rotation_difference:.1} degrees"));
    }
    if ties.points_of_three < MIN_POINTS_OF_THREE || ties.second_shared < MIN_SECOND_SHARED {
        let Ties { points_of_three, second_shared, .. } = ties;
        return Err(format!(
            "{far}, and it shares few points with others ({points_of_three} with at least two, {second_shared} with \
             its second neighbour)"
        ));
    }
    Ok(Trust::Doubtful)
}

/// Whether a photograph's held-out picture tells. With an unknown focal length nothing else does: a wrong one turns
/// photographs in all attempts alike.
fn tells(passed: &Verified, cameras: &Cameras) -> bool {
    passed.ties.nearest <= MAX_TOLD || !cameras.are_known()
}

/// Why photographs that are trusted one by one are not together. `is_confirmed` says whether one other attempt has the
/// rotations of all of them to [`MAX_FAR_DIFFERENCE`].
pub(crate) fn doubt(all: &[&Verified], cameras: &Cameras, is_confirmed: impl FnOnce() -> bool) -> Option<String> {
    let told = all.iter().filter(|passed| tells(passed, cameras));
    let gains: Vec<f64> = told.map(|passed| passed.held_out.gain()).collect();
    if gains.is_empty() && !is_confirmed() {
        return Some(format!(
            "all photographs are more than {MAX_TOLD} degrees apart, too far for held-out pictures to tell, and no \
             other attempt has all their rotations to {MAX_FAR_DIFFERENCE} degree"
        ));
    }
    if all.iter().all(|passed| passed.trust == Trust::Doubtful) {
        return Some("all photographs are too far apart for held-out pictures to tell".to_owned());
    }
    let has_told = !gains.is_empty();
    let gain = median(gains);
    (has_told && gain < MIN_MEDIAN_GAIN).then(|| {
        format!(
            "photographs that were held out are met {gain:.1} dB better than by copies of their neighbours, \
             {MIN_MEDIAN_GAIN} are needed"
        )
    })
}

/// Why a held-out photograph fails.
fn failure(scores: &HeldOutScores) -> Option<String> {
    if scores.sharpness() < MIN_SHARPNESS {
        return Some(format!(
            "held out and rendered from the others, it is met no better at its pose ({:.1} dB) than two degrees beside \
             it ({:.1} dB)",
            scores.score, scores.disturbed
        ));
    }
    if scores.gain() < MIN_GAIN {
        return Some(format!(
            "held out and rendered from the others, it is met no better or hardly better ({:.1} dB) than by a copy of \
             its neighbour ({:.1} dB)",
            scores.score,
            scores.copy.max(scores.warp)
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::focal::{CameraGroup, FocalSource};

    /// A photograph so far from its neighbours, with such a gain over copies.
    fn passed(nearest: f32, gain: f64) -> Verified {
        let ties = Ties { nearest, points_of_three: 60, second_shared: 40 };
        let score = 20.0 + gain;
        let held_out = HeldOutScores { photograph: "a".to_owned(), score, copy: 20.0, warp: 19.0, disturbed: 18.0 };
        Verified { trust: Trust::Sure, rotation_difference: 0.4, ties, held_out }
    }

    fn cameras(focal: Option<f64>) -> Cameras {
        let source = if focal.is_some() { FocalSource::Exif } else { FocalSource::Unknown };
        Cameras {
            groups: vec![CameraGroup { focal, source, size: [4, 3], photos: vec![0], zoom: 1.0 }],
            of_photo: vec![0],
        }
    }

    #[test]
    fn pictures_tell_where_neighbours_are_near_and_points_where_they_are_far() {
        let known = cameras(Some(4.0));
        let reason = |passed: &Verified| trust(passed, &known).expect_err("a reason");
        assert_eq!(trust(&passed(12.0, 2.0), &known), Ok(Trust::Sure));
        assert_eq!(trust(&passed(40.0, 2.0), &known), Ok(Trust::Sure), "its picture is met all the same");
        assert!(reason(&passed(12.0, 0.1)).contains("hardly better"), "however many points it has");
        let far = passed(40.0, 0.1);
        assert_eq!(trust(&far, &known), Ok(Trust::Doubtful));
        let differing = Verified { rotation_difference: 1.2, ..far.clone() };
        assert!(reason(&differing).contains("differ by 1.2 degrees"));
        for ties in [Ties { points_of_three: 20, ..far.ties }, Ties { second_shared: 10, ..far.ties }] {
            assert!(reason(&Verified { ties, ..far.clone() }).contains("shares few points"));
        }
        let unknown = trust(&far, &cameras(None)).expect_err("a reason");
        assert!(unknown.contains("hardly better"), "with an unknown focal length its picture counts: {unknown}");
    }

    #[test]
    fn photographs_are_trusted_together() {
        let reason = |all: &[&Verified], focal, is_confirmed| doubt(all, &cameras(focal), || is_confirmed);
        let doubtful = |gain| Verified { trust: Trust::Doubtful, ..passed(40.0, gain) };
        let (near, far, unsure) = (passed(12.0, 2.0), passed(40.0, 2.0), doubtful(0.1));
        let low = passed(12.0, 0.6);
        assert_eq!(reason(&[&near, &near, &unsure], Some(4.0), false), None);
        assert!(reason(&[&low, &low, &far, &far, &far], Some(4.0), true).expect("a reason").contains("0.6 dB better"));
        // All far apart: one other attempt has all of them, and one picture is met.
        assert_eq!(reason(&[&far, &unsure, &unsure], Some(4.0), true), None);
        assert!(reason(&[&far, &far, &far], Some(4.0), false).expect("a reason").contains("no other attempt"));
        assert!(reason(&[&unsure, &unsure, &unsure], Some(4.0), true).expect("a reason").contains("too far apart"));
        // With an unknown focal length every picture counts, however far.
        assert_eq!(reason(&[&far, &far, &far], None, false), None);
        let low = passed(40.0, 0.6);
        assert!(reason(&[&low, &low, &near], None, true).expect("a reason").contains("0.6 dB better"));
    }
}
