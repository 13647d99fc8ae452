//! The render loop, with the defaults of the command.

use crate::error::Failure;
use crate::frame::Finished;
use crate::given_weights::{GivenWeights, Raised};
use crate::request::{Request, background, leave_out, size};
use std::path::PathBuf;
use std::sync::PoisonError;
use viewfuse::device::choice::{self, DeviceChoice, DeviceOptions};
use viewfuse::field::auto::{self, Chosen};
use viewfuse::field::options::Given;
use viewfuse::field::render::{DEFAULT_EARLY_TERMINATION, Frame, RenderOptions, RenderRun};
use viewfuse::field::{AnyField, rows};
use viewfuse::job::progress::Progress;
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::FewShot;
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::Weighting;

/// The arguments of a render.
pub(crate) struct Order {
    pub(crate) request: Request,
    pub(crate) weights: Option<GivenWeights>,
    /// What a function that gives weights raised.
    pub(crate) raised: Raised,
    pub(crate) size: Option<(u32, u32)>,
    pub(crate) model: Option<PathBuf>,
    pub(crate) device: String,
    pub(crate) background: String,
    pub(crate) leave_out: f32,
    pub(crate) seed: u64,
}

impl Order {
    /// All frames, and the views of the scene that were their sources.
    ///
    /// # Errors
    /// Those of the command.
    pub(crate) fn carry_out(
        &self,
        scene: &Scene,
        progress: &dyn Progress,
    ) -> Result<(Vec<usize>, Vec<Finished>), Failure> {
        let field = match &self.model {
            None => AnyField::default(),
            Some(path) => rows::open(Checkpoint::open(path)?, &Given { seed: self.seed, ..Given::default() })?,
        };
        let about = field.about();
        let job = self.request.resolve(scene, about.least_sources)?;
        let weighting = self.weighting(scene, &job)?;
        if self.has_raised() {
            return Ok((job.sources, Vec::new()));
        }
        let options = RenderOptions {
            size: size(self.size)?,
            background: background(&self.background)?,
            leave_out: leave_out(self.leave_out)?,
            early_termination: if about.ends_rays { DEFAULT_EARLY_TERMINATION } else { 0.0 },
            ..RenderOptions::default()
        };
        let options = match rows::named(about.name) {
            Some(row) => row.bounded(options),
            None => options,
        };
        let device = choice::open(&self.device.parse::<DeviceChoice>()?, &DeviceOptions::default())?.device;
        let renderer = field.on(&device);
        let renderer = renderer.as_ref();
        let mut finished = Vec::with_capacity(job.targets.len());
        let keep = |_: &SourceImages, frame: Frame, chosen: Option<&Chosen>| {
            let scheme = chosen.map(|chosen| &chosen.weighting).or(weighting.as_ref()).map(ToString::to_string);
            let expected = chosen.and_then(|chosen| chosen.expected(&frame));
            finished.push(Finished { frame, scheme: scheme.unwrap_or_default(), expected });
            Ok::<(), Failure>(())
        };
        let run = RenderRun { scene, job: &job, renderer, options: &options, progress };
        auto::render(&run, weighting.as_ref(), keep)?;
        Ok((job.sources, finished))
    }

    /// `None` for the best of the scene, which is the default without a network: trying schemes takes a network too
    /// long.
    fn weighting(&self, scene: &Scene, job: &FewShot) -> Result<Option<Weighting>, Failure> {
        match &self.weights {
            Some(given) => given.weighting(scene, job, &self.raised),
            None => Ok(self.model.is_some().then(Weighting::default_scheme)),
        }
    }

    /// Whether a function that gives weights cannot be used.
    fn has_raised(&self) -> bool {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }
}
