//! The life cycle of source views, the same for all fields: prepared, encoded when needed, used for rendering.

use super::error::FieldError;
use super::field::{Drawing, Encoding, Prepared, Purpose, Rendered, Request, Rounded};
use super::mixture::{Mixture, between};
use super::record::{Record, VIEWS};
use super::renderer::Renderer;
use super::variant::{AnyOptions, Variant};
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

/// Source views on a renderer's device, with the set of encoded views (for the current weighting, if encodings depend
/// on it).
pub(crate) struct Session<'a> {
    renderer: &'a dyn Renderer,
    pub(crate) prepared: Box<dyn Prepared<'a> + 'a>,
    /// `[view]`.
    encoded: Vec<bool>,
    /// The weights of the weighting that began, if encodings depend on it.
    relevance: Option<Vec<SourceWeights>>,
    /// The field's own options, or those in their place.
    options: AnyOptions,
    effort: Option<usize>,
    /// For what pictures have less resolution, if they have.
    purpose: Option<Purpose>,
    /// What the prepared views are set to.
    current: AnyOptions,
    mixture: Option<Mixture>,
    /// The mean share of each part in the last picture; empty without a mixture.
    pub(crate) shares: Vec<f32>,
    /// What was told of the device's faults.
    faults: Vec<String>,
    /// About the pixels of a picture.
    pixel_count: u64,
}

impl<'a> Session<'a> {
    /// Takes source views to the device, for pictures of about so many pixels.
    pub(crate) fn open(
        renderer: &'a dyn Renderer,
        sources: &SourceImages,
        pixel_count: u64,
        progress: &dyn Progress,
    ) -> Result<Session<'a>, FieldError> {
        let prepared = renderer.prepare(sources, progress)?;
        let options = renderer.options();
        let encoded = vec![false; sources.images.len()];
        Ok(Session {
            renderer,
            encoded,
            relevance: None,
            prepared,
            current: options.clone(),
            options,
            effort: None,
            purpose: None,
            mixture: None,
            shares: Vec::new(),
            faults: Vec::new(),
            pixel_count,
        })
    }

    /// The efforts of the options; none for a field with one way to render. The first question of all may try what the
    /// device can do.
    pub(crate) fn efforts(&self) -> Vec<Variant<AnyOptions>> {
        self.prepared.efforts(&self.options, self.pixel_count)
    }

    /// Renders what follows under other options than the field's own, if there are some, and mixes pictures, if there
    /// is a mixture. Trials keep what is encoded: they compare all candidates from one encoding.
    pub(crate) fn vary(
        &mut self,
        options: Option<&AnyOptions>,
        mixture: Option<&Mixture>,
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        self.options = options.cloned().unwrap_or_else(|| self.renderer.options());
        self.mixture = mixture.filter(|mixture| !mixture.parts.is_empty()).cloned();
        self.shares = Vec::new();
        let is_stale = self.apply(&self.options.clone())?;
        self.encode_again(is_stale && self.purpose != Some(Purpose::Trial), progress)
    }

    /// Renders what follows with less resolution. Before views are encoded.
    pub(crate) fn reduce(&mut self, purpose: Purpose) -> Result<(), FieldError> {
        self.purpose = Some(purpose);
        self.apply(&self.options.clone()).map(drop)
    }

    /// Sets the prepared views to what these options are under the current effort. Returns whether views are encoded
    /// otherwise then.
    fn apply(&mut self, options: &AnyOptions) -> Result<bool, FieldError> {
        let reduced = self.purpose.map(|purpose| self.prepared.reduced(options, purpose));
        let options = reduced.unwrap_or_else(|| options.clone());
        let effort =
            self.effort.and_then(|effort| self.prepared.efforts(&options, self.pixel_count).into_iter().nth(effort));
        let options = effort.map_or(options, |effort| effort.options);
        if options == self.current {
            return Ok(false);
        }
        self.prepared.set(&options)?;
        let is_alike = self.current.encodes_alike(&options);
        self.current = options;
        Ok(!is_alike)
    }

    /// Forgets what is encoded, if it is stale, and goes on with the weighting.
    fn encode_again(&mut self, is_stale: bool, progress: &dyn Progress) -> Result<(), FieldError> {
        if is_stale {
            self.encoded.fill(false);
            if let Some(relevance) = self.relevance.take() {
                self.weigh(&relevance, progress)?;
            }
        }
        Ok(())
    }

    /// Begins a weighting: encodes all views, if all of them contribute to each picture. `relevance[view]` are the
    /// weights of all sources for source `view` as a target, its own 0.
    pub(crate) fn weigh(&mut self, relevance: &[SourceWeights], progress: &dyn Progress) -> Result<(), FieldError> {
        if self.prepared.is_weighted() {
            let (given, count) = (relevance.len(), self.encoded.len());
            if given != count {
                return Err(FieldError::unsuitable(format!("there are weights for {given} sources of {count}")));
            }
            self.encoded.fill(false);
            self.prepared.weigh(relevance)?;
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
        self.encoded_all()
    }

    /// Encodes the views that a target with these weights needs and no earlier target needed, so that the time of
    /// encoding is separate from that of rendering, which would do it otherwise. If encodings depend on the weighting
    /// and none has begun, all weights are equal.
    pub(crate) fn encode(&mut self, weights: &SourceWeights, progress: &dyn Progress) -> Result<(), FieldError> {
        if self.prepared.is_weighted() && self.relevance.is_none() {
            self.weigh(&even(self.encoded.len()), progress)?;
        }
        let mut is_new = false;
        for view in self.views(weights) {
            is_new |= self.encode_view(view, progress)?;
        }
        if is_new { self.encoded_all() } else { Ok(()) }
    }

    /// Waits until views are encoded, so that this time is measured; of trials nobody measures it.
    fn encoded_all(&self) -> Result<(), FieldError> {
        match self.purpose {
            Some(Purpose::Trial) => Ok(()),
            _ => Ok(self.renderer.finish()?),
        }
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
        let rendered = self.render_encoded(camera, weights, early_termination, progress)?;
        self.tell_faults(progress);
        Ok(rendered)
    }

    /// Goes on towards a picture without a mixture ([`Prepared::advance`]); returns whether it can be drawn.
    pub(crate) fn advance(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<bool, FieldError> {
        self.encode(weights, progress)?;
        let views = &self.views(weights);
        self.prepared.advance(&Request { camera, weights, views, early_termination }, progress)
    }

    /// As [`Session::render`] without a mixture, begun.
    pub(crate) fn draw(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Drawing<'a>, FieldError> {
        self.encode(weights, progress)?;
        self.tell_faults(progress);
        let views = &self.views(weights);
        self.prepared.draw(&Request { camera, weights, views, early_termination }, progress)
    }

    /// As [`Session::render`], rounded by the field; `None` if it does not round, and for mixtures.
    pub(crate) fn render_rounded(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Option<Rounded>, FieldError> {
        if self.mixture.is_some() {
            return Ok(None);
        }
        self.encode(weights, progress)?;
        let request = Request { camera, weights, views: &self.views(weights), early_termination };
        let rounded = self.prepared.render_rounded(&request, progress)?;
        if rounded.is_some() {
            self.shares.clear();
            self.tell_faults(progress);
        }
        Ok(rounded)
    }

    fn render_encoded(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let views = &self.views(weights);
        let request = Request { camera, weights, views, early_termination };
        self.shares.clear();
        let Some(mixture) = self.mixture.clone() else { return self.prepared.render(&request, progress) };
        // All of them go as far as they can, and are begun, before the first one is waited for. The last one may need
        // views that the others do not use, and find what these need otherwise: it goes on when they are begun.
        if mixture.parts.iter().all(|part| part.encodes_alike(&self.current)) {
            for options in mixture.parts.split_last().map_or(&[][..], |(_, others)| others) {
                self.go_on_with(options, weights, progress)?;
                self.prepared.advance(&request, progress)?;
            }
        }
        let mut begun = Vec::with_capacity(mixture.parts.len());
        for options in &mixture.parts {
            self.go_on_with(options, weights, progress)?;
            begun.push(self.prepared.draw(&request, progress)?);
        }
        self.go_on_with(&self.options.clone(), weights, progress)?;
        let parts = begun.into_iter().map(|part| part()).collect::<Result<Vec<_>, _>>()?;
        let (mixed, part_shares) = mixture.mixed(&parts);
        let share = mixture.share_at(&camera.pose);
        self.shares = part_shares.into_iter().map(|part| share * part).collect();
        if share == 1.0 {
            return Ok(mixed);
        }
        Ok(between(self.prepared.render(&request, progress)?, mixed, share))
    }

    /// Says once what of the device is not used.
    fn tell_faults(&mut self, progress: &dyn Progress) {
        let faults = self.renderer.device_faults();
        faults.iter().filter(|fault| !self.faults.contains(fault)).for_each(|fault| progress.warn(fault));
        self.faults = faults;
    }

    /// Renders the same target under other options.
    fn go_on_with(
        &mut self,
        options: &AnyOptions,
        weights: &SourceWeights,
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        let is_stale = self.apply(options)?;
        self.encode_again(is_stale, progress)?;
        self.encode(weights, progress)
    }

    /// Renders what follows with one of the efforts. Views that this effort needs otherwise are encoded again.
    pub(crate) fn set_effort(&mut self, effort: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        if effort < self.efforts().len() {
            self.effort = Some(effort);
            let is_stale = self.apply(&self.options.clone())?;
            self.encode_again(is_stale, progress)?;
        }
        Ok(())
    }

    /// Exact colours of some pixels, for fields whose pixels are independent.
    pub(crate) fn exact_pixels(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        self.encode(weights, progress)?;
        let request = Request { camera, weights, views: &self.views(weights), early_termination: 0.0 };
        self.prepared.exact_pixels(&request, pixels, progress)
    }

    /// Colours of some pixels under the options that are set ([`Prepared::pixels`]).
    pub(crate) fn pixels(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        self.encode(weights, progress)?;
        let request = Request { camera, weights, views: &self.views(weights), early_termination };
        self.prepared.pixels(&request, pixels, progress)
    }

    /// The record of the work so far.
    pub(crate) fn record(&self) -> Record {
        let mut record = self.prepared.record();
        record.notes.extend(self.faults.iter().cloned());
        let skips_unused = self.prepared.encoding() != Encoding::All;
        if !skips_unused && self.prepared.is_weighted() {
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
