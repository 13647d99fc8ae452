//! Which attempt is accepted, and which of its photographs.
//!
//! ```text
//! candidates   at least three photographs; a plausible focal length; parallax
//! agreement    an attempt with other features, or another guess of the focal length, has the same rotations
//! held out     each photograph, rendered from the others, is met at its pose and nowhere else: it is sure
//! ties         one whose neighbours are too far away for that shares many points with others, and the attempts agree
//!              closely: it is doubtful, and at least one photograph beside it must be sure; where all are too far
//!              away, one other attempt must have all rotations as closely
//! ```
//!
//! Photographs that fail are taken out and the rest is looked at again, until none fails. The first candidate that
//! keeps at least three is accepted. The limits were set on scenes with known poses (`host/results/poses.md`).

use crate::agreement::differences;
use crate::attempt::Attempt;
use crate::focal::Cameras;
use crate::held_out::hold_out_all;
use crate::intake::Photo;
use crate::posed;
use crate::solution::Solution;
use crate::ties::Ties;
use crate::trust::{MAX_FAR_DIFFERENCE, Trust, Verified, doubt, trust};
use std::path::Path;
use viewfuse_field::render::RenderError;
use viewfuse_job::progress::{Part, Progress};
use viewfuse_scene::Scene;

/// Fewest photographs: each must be seen again by two others.
pub(crate) const MIN_PHOTOGRAPHS: usize = 3;
/// Plausible focal lengths, in widths of the photograph.
const PLAUSIBLE_WIDTHS: std::ops::RangeInclusive<f64> = 0.5..=3.0;
/// Most that unknown focal lengths of two attempts may differ, as a share.
const MAX_FOCAL_DIFFERENCE: f64 = 0.1;
/// Least median parallax in degrees.
const MIN_PARALLAX: f64 = 1.0;
/// Least thickness of the points where the focal length is unknown: points in a plane leave it open.
const MIN_THICKNESS: f64 = 0.03;
/// Most degrees between the relative rotations of two attempts.
const MAX_ROTATION_DIFFERENCE: f64 = 1.5;

/// Of so many photographs that fail, one is taken out at once.
const WORST: usize = 4;

/// What was accepted.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// The attempt, as an index.
    pub attempt: usize,
    /// Its scene of the accepted photographs.
    pub scene: Scene,
    /// The attempt's solution.
    pub solution: Solution,
    /// The accepted photographs, as indices, ascending.
    pub photos: Vec<usize>,
    /// What each accepted photograph passed.
    pub verified: Vec<Verified>,
    /// Photographs that were taken out, as indices, with the reason.
    pub taken_out: Vec<(usize, String)>,
}

impl Verdict {
    /// The accepted photographs whose poses are doubtful, by name.
    pub fn doubtful(&self) -> Vec<&str> {
        let doubtful = self.verified.iter().filter(|passed| passed.trust == Trust::Doubtful);
        doubtful.map(|passed| passed.held_out.photograph.as_str()).collect()
    }
}

/// Why nothing was accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// For each attempt, in one line.
    pub reasons: Vec<String>,
}

impl Refusal {
    /// The reason of the attempt that came furthest: the longest way through the checks has the most to tell.
    pub fn main(&self) -> &str {
        let all = || self.reasons.iter().map(String::as_str);
        let stage = |reason: &&str| {
            let later = ["held out", "held-out", "no other attempt", "lie in a plane", "hardly moved", "focal length"];
            later.iter().position(|words| reason.contains(words)).map_or(0, |place| later.len() - place)
        };
        all().max_by_key(stage).unwrap_or("no attempt was made")
    }
}

/// The verdict on attempts; each that is no candidate is told why.
pub(crate) fn verdict(
    folder: &Path,
    photos: &[Photo],
    cameras: &Cameras,
    attempts: &mut [Attempt],
    progress: &dyn Progress,
) -> Result<Result<Verdict, Refusal>, RenderError> {
    // Beside more attempts than before, each is judged anew.
    attempts.iter_mut().filter(|attempt| attempt.solution.is_some()).for_each(|attempt| attempt.tried.refused = None);
    let candidates = candidates(cameras, attempts);
    let count = candidates.len();
    for (index, (attempt, confirmed)) in candidates.into_iter().enumerate() {
        let part = Part::begin(progress, "leaving photographs out", index..index + 1, count);
        let Some(solution) = &attempts[attempt].solution else { continue };
        let others = attempts.iter().filter(|other| is_independent(&attempts[attempt].tried, &other.tried));
        let others = others.filter_map(|other| other.solution.as_ref()).collect();
        let mut trial = Trial { folder, photos, cameras, solution, others, taken_out: Vec::new() };
        trial.taken_out.extend(trial.unconfirmed(&confirmed));
        match trial.run(confirmed, &part)? {
            Ok((scene, kept)) => {
                let taken_out = trial.taken_out;
                let (photos, verified) = kept.into_iter().unzip();
                return Ok(Ok(Verdict { attempt, scene, solution: solution.clone(), photos, verified, taken_out }));
            }
            Err(reason) => attempts[attempt].tried.refused = Some(reason),
        }
    }
    let reason = |attempt: &Attempt| {
        attempt.tried.refused.clone().unwrap_or_else(|| "no other attempt agrees with it".to_owned())
    };
    Ok(Err(Refusal { reasons: attempts.iter().map(reason).collect() }))
}

/// Attempts that may be accepted, the most promising first, each with the photographs that another one confirms and by
/// how much.
fn candidates(cameras: &Cameras, attempts: &mut [Attempt]) -> Vec<(usize, Vec<(usize, f64)>)> {
    for attempt in attempts.iter_mut().filter(|attempt| attempt.tried.refused.is_none()) {
        attempt.tried.refused = implausible(cameras, attempt);
    }
    let mut found: Vec<(usize, Vec<(usize, f64)>)> = Vec::new();
    for index in 0..attempts.len() {
        if attempts[index].tried.refused.is_some() {
            continue;
        }
        let confirmed = confirmed(cameras, attempts, index);
        if confirmed.len() < MIN_PHOTOGRAPHS {
            attempts[index].tried.refused = Some(format!(
                "no other attempt has the same rotations, to {MAX_ROTATION_DIFFERENCE} degrees, for {MIN_PHOTOGRAPHS} \
                    photographs"
            ));
        } else {
            found.push((index, confirmed));
        }
    }
    found.sort_by_key(|(index, confirmed)| {
        (std::cmp::Reverse(confirmed.len()), std::cmp::Reverse(attempts[*index].tried.points))
    });
    found
}

/// What rules an attempt out by itself.
fn implausible(cameras: &Cameras, attempt: &Attempt) -> Option<String> {
    let tried = &attempt.tried;
    if tried.registered < MIN_PHOTOGRAPHS {
        return Some(format!("{} photographs have a pose, {MIN_PHOTOGRAPHS} are needed", tried.registered));
    }
    for (focal, group) in tried.focal.iter().zip(&cameras.groups) {
        let width = f64::from(group.size[0]);
        if !PLAUSIBLE_WIDTHS.contains(&(focal / width)) && group.focal.is_none() {
            return Some(format!("a focal length of {:.2} widths is not plausible", focal / width));
        }
    }
    if let Some([focal, known]) = cameras.changed_focal(&tried.focal) {
        return Some(format!("the focal length became {focal:.0} pixels where {known:.0} are known"));
    }
    let support = tried.support?;
    if support.parallax < MIN_PARALLAX {
        let parallax = support.parallax;
        return Some(format!("the camera hardly moved: {parallax:.1} degrees of parallax, {MIN_PARALLAX} are needed"));
    }
    if !cameras.are_known() && support.thickness < MIN_THICKNESS {
        return Some("all points lie in a plane, which leaves the focal length open".to_owned());
    }
    None
}

/// The photographs of an attempt whose relative rotations another one confirms, each with the least difference in
/// degrees.
fn confirmed(cameras: &Cameras, attempts: &[Attempt], judged: usize) -> Vec<(usize, f64)> {
    let Some(solution) = &attempts[judged].solution else { return Vec::new() };
    let mut least = vec![f64::INFINITY; solution.photographs.len()];
    for (index, other) in attempts.iter().enumerate() {
        let (a, b) = (&attempts[judged].tried, &other.tried);
        let Some(others) = other.solution.as_ref().filter(|_| index != judged && is_independent(a, b)) else {
            continue;
        };
        let near = a.focal.iter().zip(&b.focal).all(|(a, b)| (a / b - 1.0).abs() <= MAX_FOCAL_DIFFERENCE);
        let common: Vec<usize> = solution
            .registered()
            .into_iter()
            .filter(|photo| others.photographs[*photo].camera_from_world.is_some())
            .collect();
        if common.len() < MIN_PHOTOGRAPHS || !near && !cameras.are_known() {
            continue;
        }
        for (photo, difference) in common.iter().zip(differences(solution, others, &common)) {
            least[*photo] = least[*photo].min(difference);
        }
    }
    let all = least.into_iter().enumerate();
    all.filter(|(_, difference)| *difference <= MAX_ROTATION_DIFFERENCE).collect()
}

/// Whether two attempts could be wrong in different ways.
fn is_independent(a: &crate::attempt::Tried, b: &crate::attempt::Tried) -> bool {
    a.features != b.features || a.solver.split(' ').next() != b.solver.split(' ').next()
}

/// A candidate that is looked at.
struct Trial<'a> {
    folder: &'a Path,
    photos: &'a [Photo],
    cameras: &'a Cameras,
    solution: &'a Solution,
    /// What attempts found that could be wrong in other ways.
    others: Vec<&'a Solution>,
    taken_out: Vec<(usize, String)>,
}

impl Trial<'_> {
    /// Whether one other attempt has the rotations of all of these.
    fn is_confirmed(&self, taken: &[usize]) -> bool {
        self.others.iter().any(|other| {
            taken.iter().all(|photo| other.photographs[*photo].camera_from_world.is_some())
                && differences(self.solution, other, taken).iter().all(|degrees| *degrees <= MAX_FAR_DIFFERENCE)
        })
    }

    fn unconfirmed(&self, confirmed: &[(usize, f64)]) -> Vec<(usize, String)> {
        let is_confirmed = |photo: &usize| confirmed.iter().any(|(known, _)| known == photo);
        let reason = format!("no other attempt has its rotation to {MAX_ROTATION_DIFFERENCE} degrees");
        let all = self.solution.registered().into_iter().filter(|photo| !is_confirmed(photo));
        all.map(|photo| (photo, reason.clone())).collect()
    }

    /// Excludes photographs until none fails: the scene and the photographs that stay, or why they do not.
    #[allow(clippy::type_complexity)]
    fn run(
        &mut self,
        mut kept: Vec<(usize, f64)>,
        progress: &dyn Progress,
    ) -> Result<Result<(Scene, Vec<(usize, Verified)>), String>, RenderError> {
        loop {
            if kept.len() < MIN_PHOTOGRAPHS {
                let first = self
                    .taken_out
                    .first()
                    .map_or(String::new(), |(photo, why)| format!("; {}: {why}", self.photos[*photo].name));
                return Ok(Err(format!("fewer than {MIN_PHOTOGRAPHS} photographs stay{first}")));
            }
            let taken: Vec<usize> = kept.iter().map(|(photo, _)| *photo).collect();
            let scene = posed::scene(self.folder, self.photos, self.cameras, self.solution, &taken)?;
            let (scores, ties) = (hold_out_all(&scene, progress)?, Ties::of_all(self.solution, &taken, &scene));
            let (mut verified, mut failed) = (Vec::new(), Vec::new());
            for (((photo, rotation_difference), held_out), ties) in kept.iter().zip(scores).zip(ties) {
                let mut passed =
                    Verified { trust: Trust::Sure, rotation_difference: *rotation_difference, ties, held_out };
                match trust(&passed, self.cameras) {
                    Ok(trust) => {
                        passed.trust = trust;
                        verified.push((*photo, passed));
                    }
                    Err(reason) => {
                        let worst = passed.held_out.sharpness().min(passed.held_out.gain());
                        failed.push((worst, *photo, reason));
                    }
                }
            }
            if failed.is_empty() {
                let all: Vec<&Verified> = verified.iter().map(|(_, passed)| passed).collect();
                if let Some(reason) = doubt(&all, self.cameras, || self.is_confirmed(&taken)) {
                    return Ok(Err(reason));
                }
                return Ok(Ok((scene, verified)));
            }
            // The worst first: what is wrong with it may be what is wrong with its neighbours.
            failed.sort_by(|a, b| a.0.total_cmp(&b.0));
            failed.truncate(failed.len().div_ceil(WORST));
            kept.retain(|(photo, _)| failed.iter().all(|(_, failing, _)| failing != photo));
            self.taken_out.extend(failed.into_iter().map(|(_, photo, reason)| (photo, reason)));
        }
    }
}
