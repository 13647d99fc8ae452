//! Sources on a device, from which targets are rendered.

mod frames;

use super::compared::weighed_count;
use super::{RenderError, RenderOptions, working_side};
use crate::budget::Controller;
use crate::session::Session;
use crate::{
    AnyOptions, DepthMap, FieldError, Geometry, Mixture, Purpose, Record, Rendered, Renderer, Surfaces, Variant,
};
use std::sync::Arc;
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Weights;
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::{Album, SourceImages, longest_side};
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::{MAX_SOURCES, SourcePoses, SourceWeights};

/// Times of the stages. Stages that several frames share are counted once, in their run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageCosts {
    /// Decoding photographs, removing backgrounds, resampling.
    pub photographs: Duration,
    /// Taking the photographs to the device and finding the object.
    pub prepare: Duration,
    /// Encoding the sources before the frames; for encoding at the first use see [`Frame::encode`](super::Frame::encode).
    pub encode: Duration,
}

/// Sources on a device: what is encoded of them, and the pictures that are rendered from them.
pub struct Stage<'a> {
    scene: Option<SceneSources<'a>>,
    options: &'a RenderOptions,
    side: u32,
    /// The unit of weightings.
    unit: RigUnit,
    /// In that unit.
    sources: SourcePoses,
    /// The sources at working size.
    pub images: Arc<SourceImages>,
    pub(crate) session: Session<'a>,
    /// [`Frame::counts_gaps`](super::Frame::counts_gaps) of its frames.
    counts_gaps: bool,
    /// Keeps the options' bound.
    controller: Option<Controller>,
    /// Times of the stages so far.
    pub costs: StageCosts,
}

/// The scene that sources are of.
pub(crate) struct SceneSources<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) album: &'a Album<'a>,
    /// The source views, as indices into the scene's views.
    pub(crate) views: Vec<usize>,
}

impl<'a> Stage<'a> {
    /// Prepares these source views on the device.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn prepare(
        scene: &'a Scene,
        album: &'a Album<'a>,
        sources: &[usize],
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Stage<'a>, RenderError> {
        let about = renderer.about();
        let source_side = about.source_side.of(working_side(scene, options, about.longest_side)?);
        let mut photographs = Duration::ZERO;
        let images = timed(&mut photographs, || album.sources(sources, source_side, options.background, progress))?;
        for warning in &images.warnings {
            progress.warn(&format!("{}: {warning}", scene.path.display()));
        }
        let images = Arc::new(images);
        let mut stage = Stage::of_images(scene, album, sources, images, renderer, options, progress)?;
        stage.costs.photographs = photographs;
        Ok(stage)
    }

    /// The same with prepared photographs: those of these sources, at the field's size and over the options'
    /// background.
    ///
    /// # Errors
    /// [`RenderError`].
    #[allow(clippy::too_many_arguments)]
    pub fn of_images(
        scene: &'a Scene,
        album: &'a Album<'a>,
        sources: &[usize],
        images: Arc<SourceImages>,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Stage<'a>, RenderError> {
        let unit = RigUnit::of_scene(scene);
        let poses: Vec<_> = sources.iter().map(|&view| unit.pose(&scene.views[view].camera.pose)).collect();
        let source_poses = SourcePoses::new(&poses).map_err(RenderError::Sources)?;
        let side = working_side(scene, options, renderer.about().longest_side)?;
        let stage = Stage::new(images, (unit, source_poses), side, renderer, options, progress);
        let sources = Some(SceneSources { scene, album, views: sources.to_vec() });
        Ok(Stage { scene: sources, ..stage.map_err(|error| RenderError::of(error, scene))? })
    }

    /// The same for images of no scene: frames have no truth.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn of_sources(
        images: Arc<SourceImages>,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Stage<'a>, FieldError> {
        let unit = RigUnit::of(&images.images.iter().map(|image| image.camera).collect::<Vec<_>>());
        let poses: Vec<_> = images.images.iter().map(|image| unit.pose(&image.camera.pose)).collect();
        let sources = SourcePoses::new(&poses).map_err(FieldError::unsuitable)?;
        let largest = images.images.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        let side = options.size.map_or(largest, |[width, height]| width.max(height));
        Stage::new(images, (unit, sources), side, renderer, options, progress)
    }

    fn new(
        images: Arc<SourceImages>,
        (unit, sources): (RigUnit, SourcePoses),
        side: u32,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Stage<'a>, FieldError> {
        let mut costs = StageCosts::default();
        let (session, controller) = timed(&mut costs.prepare, || {
            let session = Session::open(renderer, &images, u64::from(side).pow(2), progress)?;
            // The question which efforts there are may try what the device can do.
            let controller = options.bound.map(|bound| Controller::new(bound, &session));
            Ok::<_, FieldError>((session, controller))
        })?;
        let counts_gaps = renderer.about().draws_all && !images.has_silhouettes;
        let mut stage =
            Stage { counts_gaps, scene: None, options, side, unit, sources, images, session, controller, costs };
        stage.session.vary(options.field.as_ref(), options.mixture.as_ref(), progress)?;
        Ok(stage)
    }

    /// Begins a weighting for the following frames: encodes the sources if the field does so before the frames, each
    /// source as a target of the others.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn weigh(&mut self, weighting: &Weighting, progress: &dyn Progress) -> Result<(), RenderError> {
        let relevance = self.relevance(weighting);
        self.weigh_by(&relevance, progress).map_err(|error| self.error(error))
    }

    /// The same with the weights of all sources for each source as a target, its own 0; none will do for a network, whose
    /// sources are encoded without.
    ///
    /// # Errors
    /// [`FieldError`], also for weights for another number of sources.
    pub fn weigh_by(&mut self, relevance: &[SourceWeights], progress: &dyn Progress) -> Result<(), FieldError> {
        let (session, first) = (&mut self.session, self.controller.as_ref().map(Controller::first));
        timed(&mut self.costs.encode, || {
            if let Some(first) = first {
                session.set_effort(first, progress)?;
            }
            session.weigh(relevance, progress)
        })
    }

    /// Encodes all sources that are not encoded yet, so that what follows does not change how they are.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn encode_all(&mut self, progress: &dyn Progress) -> Result<(), RenderError> {
        let session = &mut self.session;
        timed(&mut self.costs.encode, || session.encode_all(progress)).map_err(|error| self.error(error))
    }

    /// Renders a target with these weights of the sources, all of which are used, whatever the options say. Sources
    /// with a weight that are not encoded yet are encoded; if their encoding depends on a weighting and none has begun,
    /// all weights are equal.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn picture(
        &mut self,
        camera: &Camera,
        weights: &SourceWeights,
        early_termination: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        self.session.render(camera, weights, early_termination, progress)
    }

    /// The efforts of the field, the cheapest first, the exact one last; none for a field with one way to render.
    pub fn efforts(&self) -> Vec<Variant<AnyOptions>> {
        self.session.efforts()
    }

    /// Renders what follows with one of [`Stage::efforts`]; without effect where the options have a bound, which
    /// chooses.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn set_effort(&mut self, effort: usize, progress: &dyn Progress) -> Result<(), RenderError> {
        self.session.set_effort(effort, progress).map_err(|error| self.error(error))
    }

    /// Renders what follows under other options of the field than its own, if there are some, and mixes pictures under
    /// several ones. Views are encoded again where these options need it.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn vary(
        &mut self,
        options: Option<&AnyOptions>,
        mixture: Option<&Mixture>,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        self.session.vary(options, mixture, progress).map_err(|error| self.error(error))
    }

    /// Renders what follows with less resolution, for a purpose; before views are encoded.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn reduce(&mut self, purpose: Purpose) -> Result<(), RenderError> {
        self.session.reduce(purpose).map_err(|error| self.error(error))
    }

    /// What the field knows of where the surfaces are.
    pub fn surfaces(&self) -> Surfaces {
        self.session.prepared.geometry().map_or_else(Surfaces::default, Geometry::surfaces)
    }

    /// The depth maps of the sources, under the weighting that began; none for fields without them.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn source_depths(&self) -> Result<Vec<DepthMap>, RenderError> {
        let depths = self.session.prepared.geometry().map_or(Ok(Vec::new()), Geometry::source_depths);
        depths.map_err(|error| self.error(error))
    }

    /// The weights of all sources for each source as a target; a source's weight for itself is 0.
    pub fn relevance(&self, weighting: &Weighting) -> Vec<SourceWeights> {
        relevance_among(&self.sources, weighting, self.options.leave_out)
    }

    /// Longest side of the pictures.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// The scene that the sources are of.
    pub(crate) fn scene(&self) -> Option<&SceneSources<'a>> {
        self.scene.as_ref()
    }

    /// What a photograph of the scene must have behind its object to be compared with a frame; `None` if it is shown
    /// whole.
    pub fn background(&self) -> Option<[f32; 3]> {
        self.images.has_silhouettes.then_some(self.images.background)
    }

    /// The record of the field's work so far.
    pub fn record(&self) -> Record {
        self.session.record()
    }

    fn error(&self, error: FieldError) -> RenderError {
        match &self.scene {
            Some(SceneSources { scene, .. }) => RenderError::of(error, scene),
            None => error.into(),
        }
    }
}

/// Nothing is omitted where fewer others than this would have a weight: a source's depths are found by comparing it
/// with others.
const MIN_COMPARED: usize = 3;

/// The weights of all sources for each source as a target; a source's weight for itself is 0.
fn relevance_among(sources: &SourcePoses, weighting: &Weighting, leave_out: f32) -> Vec<SourceWeights> {
    let count = sources.count();
    (0..count)
        .map(|view| {
            // The scheme sees only the others: its own pose would take nearly all the weight.
            let others: Vec<_> = (0..count).filter(|other| *other != view).map(|other| *sources.pose(other)).collect();
            let Ok(others) = SourcePoses::new(&others) else {
                return Weights::mean(count);
            };
            let all = weighting.weigh(&others, sources.pose(view));
            let most = all.without_least(leave_out).weights;
            let weights = if weighed_count(&most) < MIN_COMPARED { all } else { most };
            let mut scores = [0.0; MAX_SOURCES];
            for other in 0..count {
                if other != view {
                    scores[other as usize] = weights.get(if other < view { other } else { other - 1 });
                }
            }
            Weights::from_scores(&scores, count)
        })
        .collect()
}

/// Runs `work` and adds its time.
fn timed<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *total += start.elapsed();
    result
}
