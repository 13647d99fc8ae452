//! The search for an effort, and what it keeps from picture to picture.

use super::check::{Sample, draw, draw_evenly};
use super::deadline::Deadline;
use super::expected::{CHEAP, Expected};
use super::{Bound, Estimate, Kept, Tried, embedded};
use crate::session::Session;
use crate::{Check, FieldError, Rendered, Variant};
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;
use viewfuse_weighting::sources::SourceWeights;

/// Exact pixels of a round of a check: as many as take this share of the picture's work, in these bounds; and the most
/// rounds until a check is decided.
const CHECK_WORK: f64 = 0.1;
const ROUND: [usize; 2] = [24, 256];
const ROUNDS: usize = 3;
/// Exact pixels of a trial, in the same way.
const TRIAL_WORK: f64 = 0.05;
const TRIAL: [usize; 2] = [8, 32];
/// What is expected counts as much as this many draws.
const EXPECTED_DRAWS: usize = 8;
/// Pictures that keep another picture's choice have this much more error at most.
const OTHER_PICTURES: f64 = 1.3;
/// The most work of two pictures that are compared, as a share of the exact one's: where the comparison fails, it was
/// for nothing, unless both render from the same encodings.
const MAX_COMPARED: f32 = 0.7;
/// The least error of a single pixel that checks must see. Where one that is off by less may have all of the error that
/// is allowed, few exact pixels tell nothing, and the picture is as exact as `f32` is (`host/results/bounds.md`).
const MIN_SINGLE: f64 = 0.134;
/// A picture whose error is below the bound by this factor lets the next one begin with less effort.
const FAR_LESS: f64 = 1.6;
/// After an exact picture, only one of so many tries less.
const EXACT_PICTURES: u64 = 8;
/// The share of the time that must be left for estimating the error of a picture with a bounded time.
const CHECK_SHARE: f64 = 0.25;

/// What a picture is rendered from.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    /// The camera, of the picture's size.
    pub(crate) camera: &'a Camera,
    /// All weights, for the exact picture.
    pub(crate) all: &'a SourceWeights,
    /// The weights without the least.
    pub(crate) used: &'a SourceWeights,
    /// Transmittance of early termination, but for the exact picture.
    pub(crate) early_termination: f32,
}

/// Keeps a bound over the pictures of a run.
pub(crate) struct Controller {
    bound: Bound,
    expected: Expected,
    check: Check,
    /// The effort that was chosen by comparing two, for the whole run, and its estimate.
    compared: Option<(usize, Estimate)>,
    /// The effort of the last picture that was checked alone, and its estimate.
    last: Option<(usize, Estimate)>,
    /// The cheapest effort that a checked picture was within the bound with.
    proven: usize,
    pictures: u64,
}

/// A picture that keeps a bound, or does not, the time of encoding in it, and whether it has the weights of all views.
pub(crate) type Bounded = (Rendered, Kept, Duration, bool);

/// The state of one picture's search.
struct Search<'s, 'a> {
    session: &'s mut Session<'a>,
    view: View<'s>,
    start: Instant,
    encode: Duration,
    tried: Vec<Tried>,
    /// Evenly drawn pixels with their exact colours, for trials; empty before the first.
    even: (Vec<u32>, Vec<[f32; 4]>),
}

impl Controller {
    /// For the efforts of a session's field. Without any, the field has a single way to render.
    pub(crate) fn new(bound: Bound, session: &Session<'_>) -> Controller {
        let check = session.prepared.check();
        let safety = match check {
            Check::Pixels => 1.0,
            Check::Steps => embedded::SAFETY,
            Check::Comparison => OTHER_PICTURES * embedded::SAFETY,
        };
        let expected = Expected::new(session.efforts(), safety);
        let proven = expected.efforts.len();
        Controller { bound, expected, check, compared: None, last: None, proven, pictures: 0 }
    }

    /// The effort that the first picture begins with, so that sources that are encoded before are encoded for it.
    pub(crate) fn first(&self) -> usize {
        match self.bound {
            Bound::Error(most) => self.expected.cheapest_within(f64::from(most)),
            Bound::Time(_) => 0,
        }
    }

    /// Renders a picture within the bound. An error that is too large is never delivered: at worst the picture is
    /// exact. A time that is too short gives the cheapest picture.
    pub(crate) fn render(
        &mut self,
        session: &mut Session<'_>,
        view: View<'_>,
        progress: &dyn Progress,
    ) -> Result<Bounded, FieldError> {
        self.pictures += 1;
        let (start, encode) = (Instant::now(), Duration::ZERO);
        let mut search = Search { session, view, start, encode, tried: Vec::new(), even: Default::default() };
        if self.check == Check::Steps {
            // The field's steps do not tell what leaving out views costs.
            search.view.used = view.all;
        }
        let (rendered, effort, error, is_kept) = match self.bound {
            Bound::Error(most) => {
                let most = f64::from(most);
                let (rendered, effort, estimate) = self.within_error(&mut search, most, progress)?;
                let is_kept = estimate.upper <= most;
                // An effort is taken because its draws say so: of such pictures one in twenty has more error than the
                // bound, but one in three more than its own upper end.
                let upper = if is_kept && estimate.pixels > 0 { most } else { estimate.upper };
                (rendered, effort, Some(Estimate { upper, ..estimate }), is_kept)
            }
            Bound::Time(most) => self.within_time(&mut search, most, progress)?,
        };
        let (most_error, most_seconds) = match self.bound {
            Bound::Error(most) => (Some(most), None),
            Bound::Time(most) => (None, Some(most.as_secs_f64())),
        };
        let seconds = search.start.elapsed().as_secs_f64();
        let has_all = self.expected.is_exact(effort) || std::ptr::eq(search.view.used, search.view.all);
        let (effort, tried) = (self.expected.efforts[effort].label.clone(), search.tried);
        let kept = Kept { most_error, most_seconds, effort, error, seconds, is_kept, tried };
        Ok((rendered, kept, search.encode, has_all))
    }

    fn within_error(
        &mut self,
        search: &mut Search<'_, '_>,
        most: f64,
        progress: &dyn Progress,
    ) -> Result<(Rendered, usize, Estimate), FieldError> {
        // A quarter of the bound is left to early termination, at most.
        let termination = search.view.early_termination.min(0.25 * most as f32);
        if self.check == Check::Comparison {
            return self.by_comparison(search, most, termination, progress);
        }
        let (width, height) = (search.view.camera.pinhole.width(), search.view.camera.pinhole.height());
        let single = most * (f64::from(width) * f64::from(height)).sqrt();
        let mut effort = match self.check == Check::Pixels && single < MIN_SINGLE {
            true => self.expected.cheapest_as_f32(most),
            false => self.begin(most),
        };
        let aside = Deadline { progress, end: None };
        loop {
            if let Some(estimate) = self.rejected(search, effort, termination, most, &aside)? {
                effort = self.go_on(search, effort, estimate, most);
                continue;
            }
            let is_cheap = self.check == Check::Pixels && self.expected.efforts[effort].typical_share <= CHEAP;
            let rendered = self.picture(search, effort, termination, if is_cheap { &aside } else { progress })?;
            if self.expected.is_exact(effort) {
                self.last = Some((effort, Estimate::EXACT));
                return Ok((rendered, effort, Estimate::EXACT));
            }
            let estimate = match self.check {
                Check::Steps => by_steps(search.session, termination),
                _ => self.check(search, &rendered, effort, ROUNDS, most, &aside)?,
            };
            if estimate.upper <= most {
                self.expected.learn(effort, estimate);
                self.proven = self.proven.min(effort);
                self.last = Some((effort, estimate));
                return Ok((rendered, effort, estimate));
            }
            effort = self.go_on(search, effort, estimate, most);
        }
    }

    /// The effort to try after one whose error is too large.
    fn go_on(&mut self, search: &mut Search<'_, '_>, effort: usize, estimate: Estimate, most: f64) -> usize {
        self.expected.learn(effort, estimate);
        search.tried.push(self.tried(effort, Some(estimate)));
        self.expected.after(effort, most)
    }

    /// A trial of an effort that omits something and is not cheap, before its first picture: its error in few pixels,
    /// where that is clearly too large. In a network's fog a whole picture would be a third of the exact one's work,
    /// for nothing.
    fn rejected(
        &mut self,
        search: &mut Search<'_, '_>,
        effort: usize,
        early_termination: f32,
        most: f64,
        progress: &dyn Progress,
    ) -> Result<Option<Estimate>, FieldError> {
        let Variant { typical_error, typical_share, omits_nothing, .. } = self.expected.efforts[effort];
        let is_tried = self.check == Check::Pixels && !omits_nothing && typical_share > CHEAP;
        if !is_tried || effort >= self.proven {
            return Ok(None);
        }
        self.encode(search, effort, progress)?;
        let Search { session, view, even: (pixels, exact), .. } = search;
        if pixels.is_empty() {
            let count = view.camera.pinhole.width() as usize * view.camera.pinhole.height() as usize;
            let affordable = TRIAL_WORK * f64::from(typical_share) * count as f64;
            *pixels = draw_evenly(count, (affordable as usize).clamp(TRIAL[0], TRIAL[1]), self.pictures);
            *exact = session.exact_pixels(view.camera, view.all, pixels, progress)?;
        }
        let colours = match session.pixels(view.camera, view.used, early_termination, pixels, progress) {
            // The picture repeats that in another precision, or fails.
            Err(FieldError::NotFinite(_)) => return Ok(None),
            colours => colours?,
        };
        let mut sample = Sample::default();
        sample.expect(f64::from(typical_error), EXPECTED_DRAWS);
        sample.add_even(&colours, exact);
        let estimate = Estimate { pixels: colours.len(), ..sample.estimate() };
        Ok(sample.is_above(most).then_some(estimate))
    }

    /// For fields that tell no errors and whose pixels cannot be computed alone: compares pictures of two efforts.
    /// Another effort encodes the sources of such fields again or optimises further, so the first comparison chooses
    /// for the whole run.
    fn by_comparison(
        &mut self,
        search: &mut Search<'_, '_>,
        most: f64,
        termination: f32,
        progress: &dyn Progress,
    ) -> Result<(Rendered, usize, Estimate), FieldError> {
        // Both pictures leave out the same views, which the comparison would not see.
        search.view.used = search.view.all;
        if let Some((effort, estimate)) = self.compared {
            return Ok((self.picture(search, effort, termination, progress)?, effort, estimate));
        }
        let exact = self.expected.efforts.len() - 1;
        let mut effort = self.expected.cheapest_within(most).clamp(1.min(exact), exact);
        let mut below = self.expected.below(effort);
        let work: f32 = [below, effort].iter().map(|effort| self.expected.efforts[*effort].typical_share).sum();
        if effort == exact || (work > MAX_COMPARED && !self.expected.encode_alike(below, effort)) {
            let rendered = self.picture(search, exact, termination, progress)?;
            self.compared = Some((exact, Estimate::EXACT));
            return Ok((rendered, exact, Estimate::EXACT));
        }
        let mut cheaper = self.picture(search, below, termination, progress)?;
        loop {
            let rendered = self.picture(search, effort, termination, progress)?;
            let typical = |effort: usize| f64::from(self.expected.efforts[effort].typical_error);
            let found = embedded::estimate(&rendered, &cheaper, typical(below) / typical(effort));
            let with_termination = |estimate: Estimate| Estimate {
                upper: OTHER_PICTURES * estimate.upper + f64::from(termination),
                ..estimate
            };
            let of_cheaper = with_termination(found.cheaper);
            if self.expected.is_exact(effort) {
                self.expected.learn(below, of_cheaper);
                self.compared = Some((effort, Estimate::EXACT));
                return Ok((rendered, effort, Estimate::EXACT));
            }
            let estimate = with_termination(found.better);
            self.expected.learn(effort, estimate);
            if estimate.upper <= most {
                // The next pictures take the cheaper effort if that is enough for them.
                self.compared = Some(if of_cheaper.upper <= most { (below, of_cheaper) } else { (effort, estimate) });
                return Ok((rendered, effort, estimate));
            }
            search.tried.push(self.tried(effort, Some(estimate)));
            (cheaper, below) = (rendered, effort);
            effort = self.expected.after(effort, most);
        }
    }

    fn within_time(
        &mut self,
        search: &mut Search<'_, '_>,
        most: Duration,
        progress: &dyn Progress,
    ) -> Result<(Rendered, usize, Option<Estimate>, bool), FieldError> {
        let end = search.start.checked_add(most);
        let left = || end.map_or(f64::INFINITY, |end| end.saturating_duration_since(Instant::now()).as_secs_f64());
        let mut effort = self.expected.best_within(left()).unwrap_or(0);
        let mut best = (self.picture(search, effort, search.view.early_termination, progress)?, effort);
        let deadline = Deadline { progress, end };
        while let Some(better) = self.expected.best_within(left()).filter(|better| *better > effort) {
            effort = better;
            match self.picture(search, effort, search.view.early_termination, &deadline) {
                Ok(rendered) => {
                    search.tried.push(self.tried(best.1, None));
                    best = (rendered, effort);
                }
                Err(error) => {
                    if !matches!(error, FieldError::Interrupted(_)) || progress.is_cancelled() {
                        return Err(error);
                    }
                    search.tried.push(self.tried(effort, None));
                    break;
                }
            }
        }
        let (rendered, effort) = best;
        let is_kept = search.start.elapsed() <= most;
        if self.expected.is_exact(effort) {
            return Ok((rendered, effort, Some(Estimate::EXACT), is_kept));
        }
        let mut estimate = None;
        if self.check == Check::Steps {
            // A picture that was interrupted left no estimate.
            estimate = Some(by_steps(search.session, search.view.early_termination));
        }
        if self.check == Check::Pixels && left() > CHECK_SHARE * most.as_secs_f64() {
            match self.check(search, &rendered, effort, 1, 0.0, &deadline) {
                Ok(found) => estimate = Some(found),
                Err(FieldError::Interrupted(_)) if !progress.is_cancelled() => {}
                Err(error) => return Err(error),
            }
        }
        Ok((rendered, effort, estimate, is_kept))
    }

    /// A picture of an effort; its time is kept.
    fn picture(
        &mut self,
        search: &mut Search<'_, '_>,
        effort: usize,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let weights = self.encode(search, effort, progress)?;
        let early_termination = if self.expected.is_exact(effort) { 0.0 } else { early_termination };
        let start = Instant::now();
        let rendered = search.session.render(search.view.camera, weights, early_termination, progress)?;
        self.expected.seconds[effort] = Some(start.elapsed().as_secs_f64());
        Ok(rendered)
    }

    /// Sets an effort and encodes what it needs: the weights of its picture.
    fn encode<'s>(
        &self,
        search: &mut Search<'s, '_>,
        effort: usize,
        progress: &dyn Progress,
    ) -> Result<&'s SourceWeights, FieldError> {
        let Search { session, view, encode, .. } = search;
        let weights = if self.expected.is_exact(effort) { view.all } else { view.used };
        let start = Instant::now();
        session.set_effort(effort, progress)?;
        session.encode(weights, progress)?;
        *encode += start.elapsed();
        Ok(weights)
    }

    /// Estimates the error of an effort's picture from exact pixels, in rounds until it is clearly on one side of
    /// `most`.
    fn check(
        &self,
        search: &mut Search<'_, '_>,
        rendered: &Rendered,
        effort: usize,
        rounds: usize,
        most: f64,
        progress: &dyn Progress,
    ) -> Result<Estimate, FieldError> {
        let Variant { typical_error, typical_share, .. } = self.expected.efforts[effort];
        let affordable = CHECK_WORK * f64::from(typical_share) * rendered.colours.len() as f64;
        let count = (affordable as usize).clamp(ROUND[0], ROUND[1]);
        let mut sample = Sample::default();
        sample.expect(f64::from(typical_error), EXPECTED_DRAWS);
        let mut estimate = Estimate { value: f64::INFINITY, upper: f64::INFINITY, pixels: 0 };
        for round in 0..rounds {
            let draws = draw(rendered, count, self.pictures * ROUNDS as u64 + round as u64);
            let pixels: Vec<u32> = draws.iter().map(|draw| draw.pixel).collect();
            let Search { session, view, .. } = search;
            let exact = session.exact_pixels(view.camera, view.all, &pixels, progress)?;
            sample.add(rendered, &draws, &exact);
            estimate = sample.estimate();
            if estimate.upper <= most || estimate.value > most {
                break;
            }
        }
        Ok(Estimate { pixels: estimate.pixels.saturating_sub(EXPECTED_DRAWS), ..estimate })
    }

    /// The effort that a picture's search begins with: that of the picture before, or one less if that had far less
    /// error than the bound.
    fn begin(&self, most: f64) -> usize {
        match self.last {
            None => self.expected.cheapest_within(most),
            Some((effort, _)) if self.expected.is_exact(effort) => match self.pictures % EXACT_PICTURES {
                0 => self.expected.cheapest_within(most).min(effort),
                _ => effort,
            },
            Some((effort, estimate)) if FAR_LESS * estimate.upper <= most => effort.saturating_sub(1),
            Some((effort, _)) => effort,
        }
    }

    fn tried(&self, effort: usize, error: Option<Estimate>) -> Tried {
        Tried { effort: self.expected.efforts[effort].label.clone(), error }
    }
}

/// The error of the last picture by the field's own steps. `termination` is what early termination may cost.
fn by_steps(session: &Session<'_>, termination: f32) -> Estimate {
    let value = f64::from(session.prepared.error());
    Estimate { value, upper: embedded::SAFETY * value + f64::from(termination), pixels: 0 }
}
