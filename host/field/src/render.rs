//! The render loop, from a scene to pictures.

use crate::scores::{psnr_of_seen, ssim_of_seen};
use crate::{DepthMap, FieldError, Record, Rendered, Renderer, Session, Setting, Surfaces, Tunable};
use image::{GrayImage, RgbImage};
use std::sync::Arc;
use std::time::{Duration, Instant};
use viewfuse_core::camera::{Camera, PinholeError};
use viewfuse_core::sources::SourcesError;
use viewfuse_core::weights::{Omission, Weights};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_scene::few_shot::{FewShot, Target};
use viewfuse_scene::photographs::{
    Album, BackgroundChoice, GroundTruth, PhotographsError, SourceImages, longest_side, reduced_size, scaled_size,
    to_rgb8,
};
use viewfuse_scene::{Scene, SceneError, View};
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::{MOST_SOURCES, SourcePoses, SourceWeights};

/// Why a render failed.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene or a photograph could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A photograph could not be prepared.
    #[error(transparent)]
    Photographs(#[from] PhotographsError),
    /// There are too few or too many sources.
    #[error("{0}")]
    Sources(SourcesError),
    /// The size does not fit the scene.
    #[error(
        "a size of {width}x{height} does not keep the shape of the views ({view_width}x{view_height}); for this width it \
         would be {width}x{fitting_height}"
    )]
    Shape {
        /// The requested value.
        width: u32,
        /// The requested value.
        height: u32,
        /// That of the views.
        view_width: u32,
        /// That of the views.
        view_height: u32,
        /// The height that keeps the views' shape.
        fitting_height: u32,
    },
    /// The size is invalid.
    #[error("a size of {width}x{height} is invalid: {error}")]
    Size {
        /// The requested value.
        width: u32,
        /// The requested value.
        height: u32,
        /// The reason.
        error: PinholeError,
    },
    /// The scene does not suit the field.
    #[error("{scene}: {reason}")]
    Unsuitable {
        /// The scene's path.
        scene: String,
        /// The field's own error.
        reason: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The field failed.
    #[error(transparent)]
    Field(#[from] FieldError),
}

impl RenderError {
    /// A field's error, with the scene's path if it is about the scene.
    fn of(error: FieldError, scene: &Scene) -> RenderError {
        match error {
            FieldError::Unsuitable(reason) => {
                RenderError::Unsuitable { scene: scene.path.display().to_string(), reason }
            }
            error => error.into(),
        }
    }

    /// Whether the error is a device failure.
    pub fn is_of_device(&self) -> bool {
        matches!(self, RenderError::Field(FieldError::Device(_)))
    }
}

/// The options of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width and height of the pictures; the default is the views' size, at most the field's
    /// [`About::longest_side`](crate::About::longest_side) on a side.
    pub size: Option<[u32; 2]>,
    /// The background of the object.
    pub background: BackgroundChoice,
    /// Sources of least weight are left out while their weights together stay at or below this.
    pub leave_out: f32,
    /// Transmittance of early termination.
    pub early_termination: f32,
    /// Values of the field's scalars ([`Tunable`]); those that are not named take their defaults.
    pub settings: Vec<Setting>,
}

/// Default of the largest share of the weight that is left out: it bounds the change of a fusion of all
/// views at 1 % of the range of its inputs. Where only some views see a point, the bound is this over their weight: for
/// schemes that give one view nearly everything (cross attention), leaving out 5 % already costs 1 dB where that one view
/// sees nothing.
pub const DEFAULT_LEAVE_OUT: f32 = 0.01;
/// Default transmittance of early termination: 1/256 of the range of a channel.
pub const DEFAULT_EARLY_TERMINATION: f32 = 1.0 / 256.0;

impl Default for RenderOptions {
    fn default() -> RenderOptions {
        RenderOptions {
            size: None,
            background: BackgroundChoice::Auto,
            leave_out: DEFAULT_LEAVE_OUT,
            early_termination: DEFAULT_EARLY_TERMINATION,
            settings: Vec::new(),
        }
    }
}

/// Times of the stages. Stages that several frames share are counted once, in their run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageCosts {
    /// Decoding photographs, removing backgrounds, resampling.
    pub photographs: Duration,
    /// Taking the photographs to the device and finding the object.
    pub prepare: Duration,
    /// Encoding the sources before the frames; for encoding at the first use see [`Frame::encode`].
    pub encode: Duration,
}

/// One target view's picture with its weights, scores and times.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The target.
    pub target: Target,
    /// The sources' weights before views were left out.
    pub weights: SourceWeights,
    /// The views that were left out, and the weights that were used.
    pub omission: Omission<MOST_SOURCES>,
    /// Red, green, blue in `[0, 1]` and opacity, not rounded. Row-major.
    pub colours: Vec<[f32; 4]>,
    /// The picture.
    pub picture: RgbImage,
    /// Depth along the principal axis in world units, 0 where there is no surface, row-major; empty for fields without
    /// depths.
    pub depths: Vec<f32>,
    /// How far each pixel can be relied on, in `[0, 1]`; empty for fields that do not tell.
    pub confidences: Vec<f32>,
    /// The ground truth at the same size and the scores, if there is a photograph.
    pub truth: Option<Truth>,
    /// Time for this frame alone.
    pub time: Duration,
    /// The part of it for encoding sources that no earlier frame used.
    pub encode: Duration,
}

/// A photograph at the target, and the scores of the prediction.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The photograph at the frame's size over the run's background.
    pub picture: RgbImage,
    /// Where the photograph shows the whole pixel ([`GroundTruth::seen`]); only these pixels are scored.
    pub seen: Option<GrayImage>,
    /// Peak signal to noise ratio in decibels, of 8-bit values.
    pub psnr: f64,
    /// Structural similarity (uniform 7x7 window), if the picture is large enough.
    pub ssim: Option<f64>,
}

impl Truth {
    /// Compares a prediction with the truth.
    pub fn compare(prediction: &RgbImage, truth: GroundTruth) -> Truth {
        let GroundTruth { picture, seen } = truth;
        let psnr = psnr_of_seen(prediction, &picture, seen.as_ref());
        let ssim = ssim_of_seen(prediction, &picture, seen.as_ref());
        Truth { picture, seen, psnr, ssim }
    }
}

/// The longest side of the pictures of a run: of the requested size, or of the largest photograph, at most `longest`
/// (a field's [`About::longest_side`](crate::About::longest_side)).
///
/// # Errors
/// [`RenderError::Shape`] if the requested size would stretch the pictures by more than a pixel.
pub fn working_side(scene: &Scene, options: &RenderOptions, longest: u32) -> Result<u32, RenderError> {
    let Some([width, height]) = options.size else {
        let largest = scene.views.iter().map(|view| longest_side(&view.camera)).max();
        return Ok(largest.unwrap_or(longest).min(longest));
    };
    if let Some(View { camera, .. }) = scene.views.first() {
        let (view_width, view_height) = (camera.pinhole.width(), camera.pinhole.height());
        camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        let fitting_height = (f64::from(view_height) * f64::from(width) / f64::from(view_width)).round() as u32;
        if fitting_height.abs_diff(height) > 1 {
            return Err(RenderError::Shape { width, height, view_width, view_height, fitting_height });
        }
    }
    Ok(width.max(height))
}

/// The photographs of these views, decoded no larger than a render with these options needs them.
///
/// # Errors
/// [`RenderError`].
pub fn open_album<'a>(
    scene: &'a Scene,
    views: impl IntoIterator<Item = usize>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Album<'a>, RenderError> {
    let about = renderer.about();
    let side = working_side(scene, options, about.longest_side)?;
    Ok(Album::open_at(scene, views, side.max(about.source_side.of(side)), progress)?)
}

/// A set of sources on a device: the state that depends on no weighting and no target.
pub struct Stage<'a> {
    scene: &'a Scene,
    album: &'a Album<'a>,
    options: &'a RenderOptions,
    side: u32,
    /// The source views, as indices into the scene's views.
    pub views: Vec<usize>,
    sources: SourcePoses,
    /// The sources at working size.
    pub images: Arc<SourceImages>,
    session: Session<'a>,
    /// Times of the stages so far.
    pub costs: StageCosts,
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
        if let Some(warning) = &images.warning {
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
        let poses: Vec<_> = sources.iter().map(|&view| scene.views[view].camera.pose).collect();
        let source_poses = SourcePoses::new(&poses).map_err(RenderError::Sources)?;
        let side = working_side(scene, options, renderer.about().longest_side)?;
        let mut costs = StageCosts::default();
        let mut session = timed(&mut costs.prepare, || Session::open(renderer, &images, progress))
            .map_err(|error| RenderError::of(error, scene))?;
        session.tune(&options.settings);
        let views = sources.to_vec();
        Ok(Stage { scene, album, options, side, views, sources: source_poses, images, session, costs })
    }

    /// Begins a weighting for the following frames: encodes the sources if the field does so before the frames, each
    /// source as a target of the others.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn weigh(&mut self, weighting: &Weighting, progress: &dyn Progress) -> Result<(), RenderError> {
        let relevance = self.relevance(weighting);
        let session = &mut self.session;
        timed(&mut self.costs.encode, || session.weigh(&relevance, progress))
            .map_err(|error| RenderError::of(error, self.scene))
    }

    /// Encodes all sources that are not encoded yet, so that what follows does not change how they are.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn encode_all(&mut self, progress: &dyn Progress) -> Result<(), RenderError> {
        let session = &mut self.session;
        timed(&mut self.costs.encode, || session.encode_all(progress))
            .map_err(|error| RenderError::of(error, self.scene))
    }

    /// The field's scalars that can be chosen for a scene.
    pub fn tunables(&self) -> &'static [Tunable] {
        self.session.tunables()
    }

    /// Sets the field's scalars for what follows; views that are encoded stay as they are.
    pub fn tune(&mut self, settings: &[Setting]) {
        self.session.tune(settings);
    }

    /// What follows is only compared with one another; see [`Prepared::simplify`](crate::Prepared::simplify).
    pub fn simplify(&mut self) {
        self.session.simplify();
    }

    /// What the field knows of where the surfaces are.
    pub fn surfaces(&self) -> Surfaces {
        self.session.surfaces()
    }

    /// The depth maps of the sources, under the weighting that began; see [`Prepared::source_depths`](crate::Prepared::source_depths).
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn source_depths(&self) -> Result<Vec<DepthMap>, RenderError> {
        self.session.source_depths().map_err(|error| RenderError::of(error, self.scene))
    }

    /// The weights of all sources for each source as a target; a source's weight for itself is 0.
    pub fn relevance(&self, weighting: &Weighting) -> Vec<SourceWeights> {
        relevance_among(&self.sources, weighting, self.options.leave_out)
    }

    /// Longest side of the pictures.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Its photographs.
    pub fn album(&self) -> &'a Album<'a> {
        self.album
    }

    /// The record of the field's work so far.
    pub fn record(&self) -> Record {
        self.session.record()
    }

    /// Weighs the sources for a target, leaves out those of least weight, renders, and compares with the ground truth.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn frame(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let camera = self.at_working_size(&target.camera)?;
        self.frame_at(weighting, target, &camera, progress)
    }

    /// As [`Stage::frame`] without a truth, with a picture of another size than the options': for coarse pictures.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn frame_of_size(
        &mut self,
        weighting: &Weighting,
        camera: &Camera,
        [width, height]: [u32; 2],
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let pinhole =
            camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        let target = Target { name: String::new(), camera: *camera, truth: None };
        self.frame_at(weighting, &target, &Camera { pinhole, ..*camera }, progress)
    }

    /// `camera` is the target's, of the picture's size.
    fn frame_at(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        camera: &Camera,
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let start = Instant::now();
        let weights = weighting.weigh(&self.sources, &target.camera.pose);
        let omission = weights.without_least(self.options.leave_out);
        let failed = |error| RenderError::of(error, self.scene);
        let mut encode = Duration::ZERO;
        timed(&mut encode, || self.session.encode(&omission.weights, progress)).map_err(failed)?;
        let early_termination = self.options.early_termination;
        let rendered = self.session.render(camera, &omission.weights, early_termination, progress).map_err(failed)?;
        let time = start.elapsed();
        let Rendered { colours, depths, confidences, width, height } = rendered;
        let picture = to_rgb8(&colours, [width, height]);
        let truth = match target.truth {
            Some(view) => Some(Truth::compare(&picture, self.truth_at(view, [width, height])?)),
            None => None,
        };
        let target = target.clone();
        Ok(Frame { target, weights, omission, colours, picture, depths, confidences, truth, time, encode })
    }

    /// A view's photograph at a size, over the run's background.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if it cannot be read.
    pub fn truth_at(&self, view: usize, size: [u32; 2]) -> Result<GroundTruth, RenderError> {
        let background = self.images.has_silhouettes.then_some(self.images.background);
        Ok(self.album.truth(view, size, background)?)
    }

    /// Width and height of the picture that is rendered at a view's camera.
    ///
    /// # Errors
    /// [`RenderError::Size`].
    pub fn picture_size(&self, view: usize) -> Result<[u32; 2], RenderError> {
        self.size_at(&self.scene.views[view].camera)
    }

    /// Width and height of the picture that is rendered at a camera.
    ///
    /// # Errors
    /// [`RenderError::Size`].
    pub fn size_at(&self, camera: &Camera) -> Result<[u32; 2], RenderError> {
        let camera = self.at_working_size(camera)?;
        Ok([camera.pinhole.width(), camera.pinhole.height()])
    }

    fn at_working_size(&self, camera: &Camera) -> Result<Camera, RenderError> {
        let (width, height) = match (self.options.size, self.scene.views.first()) {
            (Some([width, height]), Some(view)) if same_size(&view.camera, camera) => (width, height),
            (Some(_), _) => scaled_size(camera, self.side),
            (None, _) => reduced_size(camera, self.side),
        };
        let pinhole =
            camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        Ok(Camera { pinhole, ..*camera })
    }
}

fn same_size(a: &Camera, b: &Camera) -> bool {
    a.pinhole.width() == b.pinhole.width() && a.pinhole.height() == b.pinhole.height()
}

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
            let weights = weighting.weigh(&others, sources.pose(view)).without_least(leave_out).weights;
            let mut scores = [0.0; MOST_SOURCES];
            for other in 0..count {
                if other != view {
                    scores[other as usize] = weights.get(if other < view { other } else { other - 1 });
                }
            }
            Weights::from_scores(&scores, count)
        })
        .collect()
}

/// The summary of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// The times of the stages that the frames share.
    pub costs: StageCosts,
    /// The record of the field's work.
    pub record: Record,
}

/// Renders every target view of a job and passes each frame to `deliver` as soon as it is done.
///
/// # Errors
/// [`RenderError`]; those of `deliver` pass through.
#[allow(clippy::too_many_arguments)]
pub fn render<X: From<RenderError>>(
    scene: &Scene,
    job: &FewShot,
    weighting: &Weighting,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
    mut deliver: impl FnMut(&SourceImages, Frame) -> Result<(), X>,
) -> Result<Finished, X> {
    let truths = job.targets.iter().filter_map(|target| target.truth);
    let shown = job.sources.iter().copied().chain(truths);
    let (count, stage_count) = (job.targets.len(), 2 + job.targets.len());
    progress.stage("reading the sources", 0, stage_count);
    let album = open_album(scene, shown, renderer, options, progress)?;
    let mut stage = Stage::prepare(scene, &album, &job.sources, renderer, options, progress)?;
    progress.stage("encoding the sources", 1, stage_count);
    stage.weigh(weighting, progress)?;
    for (index, target) in job.targets.iter().enumerate() {
        progress.stage(&format!("view {} of {count}", index + 1), 2 + index, stage_count);
        let frame = stage.frame(weighting, target, progress)?;
        deliver(&stage.images, frame)?;
    }
    Ok(Finished { costs: stage.costs, record: stage.record() })
}

/// As [`render`] without progress reports: returns the frames of all target views, which stay in memory.
///
/// # Errors
/// [`RenderError`].
pub fn render_all(
    scene: &Scene,
    job: &FewShot,
    weighting: &Weighting,
    renderer: &dyn Renderer,
    options: &RenderOptions,
) -> Result<Vec<Frame>, RenderError> {
    let mut frames = Vec::with_capacity(job.targets.len());
    render(scene, job, weighting, renderer, options, &Silent, |_sources, frame| {
        frames.push(frame);
        Ok::<(), RenderError>(())
    })?;
    Ok(frames)
}

/// Runs `work` and adds its time.
fn timed<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *total += start.elapsed();
    result
}
