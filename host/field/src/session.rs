//! The life cycle of source views, the same for all fields: prepared, encoded when needed, used for rendering.

use super::error::FieldError;
use super::field::{Check, Effort, Encoding, Encodings, Prepared, Rendered, Request, Setting, Tunable};
use super::mixture::{Mixture, between};
use super::record::{Record, VIEWS};
use super::renderer::Renderer;
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

/// How errors are found, without the means: see [`Check`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Judge {
    /// From exact pixels.
    Pixels,
    /// By the field, from its own steps.
    Steps,
    /// By comparing two pictures.
    Comparison,
}

/// Source views on a renderer's device, with the set of encoded views (for the current weighting, if encodings depend
/// on it).
pub(crate) struct Session<'a> {
    renderer: &'a dyn Renderer,
    pub(crate) prepared: Box<dyn Prepared + 'a>,
    /// `[view]`.
    encoded: Vec<bool>,
    is_weighted: bool,
    /// The weights of the weighting that began, if encodings depend on it.
    relevance: Option<Vec<SourceWeights>>,
    /// The field's efforts; none for a field with one way to render.
    pub(crate) efforts: Vec<Effort>,
    pub(crate) judge: Judge,
    /// Whether an effort goes on from where a cheaper one ended.
    pub(crate) goes_on: bool,
    pub(crate) tunables: &'static [Tunable],
    effort: Option<usize>,
    settings: Vec<Setting>,
    mixture: Option<Mixture>,
    /// The mean share of each part in the last picture; empty without a mixture.
    pub(crate) shares: Vec<f32>,
}

impl<'a> Session<'a> {
    /// Takes source views to the device.
    pub(crate) fn open(
        renderer: &'a dyn Renderer,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Session<'a>, FieldError> {
        let mut prepared = renderer.prepare(sources, progress)?;
        let judge = match prepared.efforts().map(|efforts| efforts.check()) {
            Some(Check::Pixels(_)) => Judge::Pixels,
            Some(Check::Steps(_)) => Judge::Steps,
            Some(Check::Comparison) | None => Judge::Comparison,
        };
        let efforts = prepared.efforts().map_or_else(Vec::new, |efforts| efforts.list());
        let goes_on = prepared.efforts().is_some_and(|efforts| efforts.goes_on());
        let tunables = prepared.tuned().map_or(&[][..], |tuned| tuned.tunables());
        let (is_weighted, encoded) = (prepared.weighted().is_some(), vec![false; sources.images.len()]);
        Ok(Session {
            renderer,
            prepared,
            encoded,
            is_weighted,
            relevance: None,
            efforts,
            judge,
            goes_on,
            tunables,
            effort: None,
            settings: Vec::new(),
            mixture: None,
            shares: Vec::new(),
        })
    }

    /// Sets the field's scalars for what follows, and a mixture of pictures under settings of its own, if there is one.
    pub(crate) fn tune(&mut self, settings: &[Setting], mixture: Option<&Mixture>) {
        self.settings = settings.to_vec();
        self.mixture = mixture.filter(|mixture| !mixture.parts.is_empty()).cloned();
        self.shares = Vec::new();
        self.set(settings);
    }

    /// The settings whose pictures are worth mixing where these were chosen.
    pub(crate) fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        self.prepared.tuned().map_or_else(Vec::new, |tuned| tuned.parts(chosen))
    }

    fn set(&mut self, settings: &[Setting]) {
        if let Some(tuned) = self.prepared.tuned() {
            tuned.tune(settings);
        }
    }

    /// Begins a weighting: encodes all views, if all of them contribute to each picture. `relevance[view]` are the
    /// weights of all sources for source `view` as a target, its own 0.
    pub(crate) fn weigh(&mut self, relevance: &[SourceWeights], progress: &dyn Progress) -> Result<(), FieldError> {
        if let Some(weighted) = self.prepared.weighted() {
            self.encoded.fill(false);
            weighted.weigh(relevance)?;
            self.relevance = Some(relevance.to_vec());
        }
        match self.prepared.encoding() {
            Encoding::All => self.encode_all(progress),
            Encoding::Used | Encoding::Greatest(_) => Ok(()),
        }
    }

    /// Encodes the views that are not encoded yet.
    pub(crate) fn encode_all(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        progress.expect(self.encoded.iter().filter(|encoded| !**encoded).count());
        for view in 0..self.encoded.len() {
            if self.encode_view(view, progress)? {
                progress.step();
            }
        }
        Ok(self.renderer.finish()?)
    }

    /// Encodes the views that a target with these weights needs and no earlier target needed, so that the time of
    /// encoding is separate from that of rendering, which would do it otherwise. If encodings depend on the weighting
    /// and none has begun, all weights are equal.
    pub(crate) fn encode(&mut self, weights: &SourceWeights, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.is_weighted && self.relevance.is_none() {
            self.weigh(&even(self.encoded.len()), progress)?;
        }
        let mut is_new = false;
        for view in self.views(weights) {
            is_new |= self.encode_view(view, progress)?;
        }
        if is_new {
            self.renderer.finish()?;
        }
        Ok(())
    }

    /// Renders a target with the sources' weights for it. `early_termination` is the transmittance below which samples
    /// are omitted.
    pub(crate) fn render(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        self.encode(weights, progress)?;
        let views = &self.views(weights);
        let request = Request { camera, weights, views, early_termination };
        self.shares.clear();
        let Some(mixture) = self.mixture.clone() else { return self.prepared.render(&request, progress) };
        let mut parts = Vec::with_capacity(mixture.parts.len());
        for settings in &mixture.parts {
            self.set(settings);
            parts.push(self.prepared.render(&request, progress)?);
        }
        self.set(&self.settings.clone());
        let (mixed, part_shares) = mixture.mixed(&parts);
        let share = mixture.share_at(&camera.pose);
        self.shares = part_shares.into_iter().map(|part| share * part).collect();
        if share == 1.0 {
            return Ok(mixed);
        }
        Ok(between(self.prepared.render(&request, progress)?, mixed, share))
    }

    /// Renders what follows with one of the efforts. Views that this effort needs otherwise are encoded again.
    pub(crate) fn set_effort(&mut self, effort: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.effort == Some(effort) || effort >= self.efforts.len() {
            return Ok(());
        }
        let Some(efforts) = self.prepared.efforts() else { return Ok(()) };
        self.effort = Some(effort);
        if efforts.set(effort)? == Encodings::Dropped {
            self.encoded.fill(false);
            if let Some(relevance) = self.relevance.take() {
                self.weigh(&relevance, progress)?;
            }
        }
        Ok(())
    }

    /// How the error of the last picture is found.
    pub(crate) fn check(&mut self) -> Check<'_> {
        self.prepared.efforts().map_or(Check::Comparison, |efforts| efforts.check())
    }

    /// Exact colours of some pixels; `None` if the field's pixels are not independent.
    pub(crate) fn exact_pixels(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Option<Vec<[f32; 4]>>, FieldError> {
        self.encode(weights, progress)?;
        let request = Request { camera, weights, views: &self.views(weights), early_termination: 0.0 };
        match self.check() {
            Check::Pixels(exact) => exact.exact_pixels(&request, pixels, progress).map(Some),
            Check::Steps(_) | Check::Comparison => Ok(None),
        }
    }

    /// The record of the work so far.
    pub(crate) fn record(&self) -> Record {
        let mut record = self.prepared.record();
        let skips_unused = self.prepared.encoding() != Encoding::All;
        if !skips_unused && self.is_weighted {
            return record;
        }
        let count = self.encoded.iter().filter(|encoded| !**encoded).count();
        let line = VIEWS.left_out(skips_unused, count as u64, self.encoded.len() as u64);
        record.left_out.insert(0, line);
        record
    }

    /// The views that contribute to a picture.
    fn views(&self, weights: &SourceWeights) -> Vec<usize> {
        let all = self.prepared.encoding() == Encoding::All;
        (0..self.encoded.len()).filter(|view| all || weights.get(*view as u32) > 0.0).collect()
    }

    /// Encodes a view if it is not encoded yet; returns whether it did.
    fn encode_view(&mut self, view: usize, progress: &dyn Progress) -> Result<bool, FieldError> {
        progress.check()?;
        if self.encoded[view] {
            return Ok(false);
        }
        self.prepared.encode(view, progress)?;
        self.encoded[view] = true;
        Ok(true)
    }
}

/// Equal weights of all sources for each source as a target.
fn even(count: usize) -> Vec<SourceWeights> {
    let weights = |target: usize| {
        let score = |view: usize| f32::from(view < count && view != target);
        Weights::from_scores(&std::array::from_fn::<f32, MAX_SOURCES, _>(score), count as u32)
    };
    (0..count).map(weights).collect()
}
