//! The render loop, with the defaults of the command.

use crate::error::Failure;
use crate::frame::Finished;
use crate::given_weights::{GivenWeights, Raised, UntilRaised};
use crate::request::{Pictures, Request, device};
use viewfuse::field::auto::{self, Chosen};
use viewfuse::field::render::{Frame, RenderRun};
use viewfuse::job::progress::Progress;
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
    pub(crate) pictures: Pictures,
}

impl Order {
    /// All frames, and the views of the scene that were their sources.
    pub(crate) fn carry_out(
        &self,
        scene: &Scene,
        progress: &dyn Progress,
    ) -> Result<(Vec<usize>, Vec<Finished>), Failure> {
        let progress = &UntilRaised { progress, raised: &self.raised };
        let field = self.pictures.field()?;
        let about = field.about();
        let job = self.request.resolve(scene, about.least_sources)?;
        let weighting = self.weighting(scene, &job)?;
        progress.check().map_err(Failure::from)?;
        let options = self.pictures.options(&about)?;
        let device = device(&self.pictures.device)?;
        let renderer = field.on(&device);
        let renderer = renderer.as_ref();
        let mut finished = Vec::with_capacity(job.targets.len());
        let keep = |_: &SourceImages, frame: Frame, chosen: Option<&Chosen>| {
            let scheme = chosen.map(|chosen| &chosen.weighting).or(weighting.as_ref()).map(ToString::to_string);
            let expected = chosen.and_then(|chosen| chosen.expected(&frame));
            let beyond = chosen.and_then(|chosen| chosen.beyond(&frame));
            finished.push(Finished { frame, scheme: scheme.unwrap_or_default(), expected, beyond });
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
            Some(given) => given.weighting(scene, job, &self.request, &self.raised),
            None => Ok(self.pictures.model.is_some().then(Weighting::default_scheme)),
        }
    }
}
