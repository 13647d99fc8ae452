//! The life cycle of source views, the same for all fields: prepared, encoded when needed, used for rendering.

use super::error::FieldError;
use super::field::{DepthMap, Effort, Encoding, Encodings, Prepared, Rendered, Request, Setting, Surfaces, Tunable};
use super::record::{LeftOut, Record};
use super::renderer::Renderer;
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

/// Source views on a renderer's device, with the set of encoded views (for the current weighting, if encodings depend on
/// it).
pub struct Session<'a> {
    renderer: &'a dyn Renderer,
    prepared: Box<dyn Prepared + 'a>,
    /// `[view]`.
    encoded: Vec<bool>,
    /// The weights of the weighting that began, if encodings depend on it.
    relevance: Option<Vec<SourceWeights>>,
    effort: Option<usize>,
}

impl<'a> Session<'a> {
    /// Takes source views to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn open(
        renderer: &'a dyn Renderer,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Session<'a>, FieldError> {
        let prepared = renderer.prepare(sources, progress)?;
        let encoded = vec![false; sources.images.len()];
        Ok(Session { renderer, prepared, encoded, relevance: None, effort: None })
    }

    /// Begins a weighting: encodes all views, if all of them contribute to each picture. `relevance[view]` are the weights of
    /// all sources for source `view` as a target, its own 0.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn weigh(&mut self, relevance: &[SourceWeights], progress: &dyn Progress) -> Result<(), FieldError> {
        if self.prepared.depends_on_weighting() {
            self.encoded.fill(false);
            self.prepared.weigh(relevance)?;
            self.relevance = Some(relevance.to_vec());
        }
        match self.prepared.encoding() {
            Encoding::All => self.encode_all(progress),
            Encoding::Used => Ok(()),
        }
    }

    /// Encodes the views that are not encoded yet.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn encode_all(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
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
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn encode(&mut self, weights: &SourceWeights, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.prepared.depends_on_weighting() && self.relevance.is_none() {
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
    /// are left out.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn render(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        self.encode(weights, progress)?;
        let views = &self.views(weights);
        self.prepared.render(&Request { camera, weights, views, early_termination }, progress)
    }

    /// The ways in which the field can render; see [`Prepared::efforts`].
    pub fn efforts(&self) -> Vec<Effort> {
        self.prepared.efforts()
    }

    /// Renders what follows with one of [`Session::efforts`]. Views that this effort needs otherwise are encoded again.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn set_effort(&mut self, effort: usize, progress: &dyn Progress) -> Result<Encodings, FieldError> {
        if self.effort == Some(effort) || effort >= self.prepared.efforts().len() {
            return Ok(Encodings::Kept);
        }
        self.effort = Some(effort);
        let encodings = self.prepared.set_effort(effort)?;
        if encodings == Encodings::Dropped {
            self.encoded.fill(false);
            if let Some(relevance) = self.relevance.take() {
                self.weigh(&relevance, progress)?;
            }
        }
        Ok(encodings)
    }

    /// See [`Prepared::estimates_errors`].
    pub fn estimates_errors(&self) -> bool {
        self.prepared.estimates_errors()
    }

    /// See [`Prepared::estimated_error`].
    pub fn estimated_error(&self) -> f32 {
        self.prepared.estimated_error()
    }

    /// See [`Prepared::renders_pixels`].
    pub fn renders_pixels(&self) -> bool {
        self.prepared.renders_pixels()
    }

    /// Exact colours of some pixels; see [`Prepared::exact_pixels`].
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn exact_pixels(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        self.encode(weights, progress)?;
        let views = &self.views(weights);
        self.prepared.exact_pixels(&Request { camera, weights, views, early_termination: 0.0 }, pixels, progress)
    }

    /// The field's scalars that can be chosen for a scene.
    pub fn tunables(&self) -> &'static [Tunable] {
        self.prepared.tunables()
    }

    /// Sets the field's scalars for what follows; see [`Prepared::tune`].
    pub fn tune(&mut self, settings: &[Setting]) {
        self.prepared.tune(settings);
    }

    /// See [`Prepared::simplify`].
    pub fn simplify(&mut self) {
        self.prepared.simplify();
    }

    /// See [`Prepared::surfaces`].
    pub fn surfaces(&self) -> Surfaces {
        self.prepared.surfaces()
    }

    /// See [`Prepared::source_depths`].
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        self.prepared.source_depths()
    }

    /// The record of the work so far.
    pub fn record(&self) -> Record {
        let mut record = self.prepared.record();
        let skips_unused = self.prepared.encoding() == Encoding::Used;
        if !skips_unused && self.prepared.depends_on_weighting() {
            return record;
        }
        let count = |views: usize| views as u64;
        let line = LeftOut {
            what: "encoded views",
            switch: skips_unused,
            left_out: count(self.encoded.iter().filter(|encoded| !**encoded).count()),
            of: count(self.encoded.len()),
            cost: "nothing",
        };
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
    let weights = |own: usize| {
        let score = |view: usize| f32::from(view < count && view != own);
        Weights::from_scores(&std::array::from_fn::<f32, MAX_SOURCES, _>(score), count as u32)
    };
    (0..count).map(weights).collect()
}
