//! The render loop: takes requests, renders coarse and full pictures, answers.
//!
//! It runs on the thread of its caller and owns what is on the device. A coarse picture comes from smaller sources and
//! reduced options of the field, or, for fields without previews, is a smaller picture from the same sources. A full
//! picture has the size and the values of `viewfuse_field::render` for the same camera and weighting. It makes way for
//! coarse ones, at the points where the field checks for cancellation, and is begun again later; sources that are
//! encoded by then stay encoded. While nothing is requested, the scheme that suits the scene is chosen, if that is left
//! to the scene.

use crate::answer;
use crate::choice::Choice;
use crate::coarse;
use crate::mailbox::{Mailbox, Queued};
use crate::pace::{Pace, TIME_OF_A_PICTURE};
use crate::record::PictureRecord;
use crate::request::{COARSE_SIDE, Layer, Request};
use crate::response::Answer;
use crate::status::Status;
use crate::video::{Film, Studio};
use crate::{Viewed, Viewer};
use std::sync::mpsc::Sender;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_field::render::{Frame, RenderError, Stage, open_album, working_side};
use viewfuse_field::{AnyOptions, FieldError, Mixture, Renderer, auto};
use viewfuse_job::progress::Progress;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::{Album, PhotographsError, SourceImages, scaled_size};
use viewfuse_weighting::Weighting;

/// So long the loop waits for a request before it looks whether it should end.
const PATIENCE: Duration = Duration::from_millis(50);

/// So long it waits for one before it looks whether a video can take its next frame.
const LOOK: Duration = Duration::from_millis(5);

/// What the render loop and the server share.
pub(crate) struct Shared {
    pub(crate) mailbox: Mailbox<Job>,
    pub(crate) status: Status,
    pub(crate) studio: Studio,
    /// Pictures of the sources as JPEG, once they are read.
    pub(crate) thumbnails: OnceLock<Vec<Vec<u8>>>,
}

impl Shared {
    pub(crate) fn new() -> Shared {
        Shared {
            mailbox: Mailbox::new(),
            status: Status::default(),
            studio: Studio::default(),
            thumbnails: OnceLock::new(),
        }
    }
}

/// A request for a picture.
pub(crate) struct Job {
    pub(crate) request: Request,
    /// To the connection that waits. That it is gone is nothing to report: a page may be closed at any time.
    pub(crate) reply: Sender<Answer>,
}

impl Queued for Job {
    fn tab(&self) -> &str {
        &self.request.tab
    }

    fn is_urgent(&self) -> bool {
        self.request.is_moving
    }

    fn drop_as_stale(self) {
        self.reply.send(Answer::stale()).ok();
    }
}

/// Progress of a piece of work: shown on the page, and stopped when the program ends or the work has to make way.
struct Watch<'a> {
    shared: &'a Shared,
    outer: &'a dyn Progress,
    makes_way: MakesWay,
}

/// For what a piece of work stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MakesWay {
    Never,
    /// For a newer request of the same tab, or a coarse picture of another one.
    ToPressing,
    /// For any request.
    ToAll,
}

impl Progress for Watch<'_> {
    fn expect(&self, pieces: usize) {
        self.shared.status.expect(pieces);
    }

    fn step(&self) {
        self.shared.status.step();
    }

    fn warn(&self, warning: &str) {
        self.shared.status.warn(warning);
        self.outer.warn(warning);
    }

    fn is_cancelled(&self) -> bool {
        let has_to = match self.makes_way {
            MakesWay::Never => false,
            MakesWay::ToPressing => self.shared.mailbox.is_pressing(),
            MakesWay::ToAll => self.shared.mailbox.is_waiting(),
        };
        has_to || self.outer.is_cancelled()
    }
}

/// A stage, and what its sources are encoded under; nothing before the first.
struct Weighed<'a> {
    stage: Stage<'a>,
    under: Option<Under>,
}

/// What sources are encoded under.
#[derive(PartialEq)]
struct Under {
    scheme: String,
    options: Option<AnyOptions>,
    mixture: Option<Mixture>,
}

impl<'a> Weighed<'a> {
    fn new(stage: Stage<'a>) -> Weighed<'a> {
        Weighed { stage, under: None }
    }

    /// Begins a weighting, unless it has begun. Sources that it does not encode are encoded by the frames that use
    /// them.
    fn weigh(&mut self, weighting: &Weighting, under: Under, progress: &dyn Progress) -> Result<(), RenderError> {
        if self.under.as_ref() != Some(&under) {
            self.under = None;
            self.stage.vary(under.options.as_ref(), under.mixture.as_ref(), progress)?;
            self.under = Some(under);
            self.stage.weigh(weighting, progress)?;
        }
        Ok(())
    }
}

/// Everything that renders.
struct RenderLoop<'a> {
    viewer: &'a Viewer<'a>,
    shared: &'a Shared,
    outer: &'a dyn Progress,
    album: &'a Album<'a>,
    coverage: Coverage,
    images: Arc<SourceImages>,
    renderer: &'a dyn Renderer,
    /// For fields with previews.
    coarse: Option<Weighed<'a>>,
    full: Option<Weighed<'a>>,
    pace: Pace,
    /// Time of the last full picture.
    full_time: Option<Duration>,
    choice: Choice,
    /// The video that is made.
    film: Option<Film>,
}

/// Renders until the progress says that it is cancelled.
pub(crate) fn run(viewer: &Viewer<'_>, shared: &Shared, outer: &dyn Progress) -> Result<(), RenderError> {
    let Viewed { scene, sources, field, device, options, weighting, .. } = viewer.viewed;
    let watch = Watch { shared, outer, makes_way: MakesWay::Never };
    let stopped = |result: Result<(), RenderError>| match result {
        Err(error) if is_interruption(&error) => Ok(()),
        result => result,
    };
    let about = field.about();
    let source_side = about.source_side.of(working_side(scene, options, about.longest_side)?);
    let renderer = field.on(device);
    let coarse_options = coarse::options(options);
    stopped((|| {
        shared.status.begin("reading photographs");
        let album = open_album(scene, sources.iter().copied(), renderer.as_ref(), options, &watch)?;
        let images = Arc::new(album.sources(sources, source_side, options.background, &watch)?);
        // They were printed when the scene was opened.
        scene.warnings.iter().for_each(|warning| shared.status.warn(warning));
        for warning in &images.warnings {
            watch.warn(&format!("{}: {warning}", scene.path.display()));
        }
        let small = coarse::reduced(&images, COARSE_SIDE, scene)?;
        let thumbnails = (0..sources.len()).map(|source| answer::jpeg(&small.picture(source)).unwrap_or_default());
        let _ = shared.thumbnails.set(thumbnails.collect());
        let cameras: Vec<Camera> = sources.iter().map(|&view| scene.views[view].camera).collect();
        let mut pictures = RenderLoop {
            viewer,
            shared,
            outer,
            album: &album,
            coverage: Coverage::of(&cameras),
            images: Arc::clone(&images),
            renderer: renderer.as_ref(),
            coarse: None,
            full: None,
            pace: Pace::of(about.is_live, viewer.size[0].max(viewer.size[1])),
            full_time: None,
            choice: Choice::of(&viewer.viewed),
            film: None,
        };
        if about.has_previews {
            shared.status.begin("preparing coarse pictures");
            let stage = coarse::stage(scene, &album, sources, small, renderer.as_ref(), &coarse_options, &watch)?;
            let mut coarse = Weighed::new(stage);
            let under = Under { scheme: weighting.to_string(), options: options.field.clone(), mixture: None };
            coarse.weigh(weighting, under, &watch)?;
            pictures.coarse = Some(coarse);
        } else {
            pictures.prepare(&watch)?;
        }
        pictures.serve()
    })())
}

/// The answer to a request whose picture failed: 503 if the device did, with which the program ends; else 422, for
/// another view, scheme or size may well have a picture.
fn refusal(error: &RenderError) -> Answer {
    match error.is_of_device() {
        true => Answer::error(503, &format!("the device failed, and the program ends: {error}")),
        false => Answer::error(422, &format!("there is no picture of this view: {error}")),
    }
}

/// Whether work was stopped, by the person or by another request.
fn is_interruption(error: &RenderError) -> bool {
    matches!(
        error,
        RenderError::Field(FieldError::Interrupted(_)) | RenderError::Photographs(PhotographsError::Interrupted(_))
    )
}

impl<'a> RenderLoop<'a> {
    fn serve(&mut self) -> Result<(), RenderError> {
        while !self.outer.is_cancelled() {
            self.shared.status.begin("");
            let patience = match &self.film {
                Some(film) if film.is_waiting() => LOOK,
                None if !self.shared.studio.is_waiting() => PATIENCE,
                _ => Duration::ZERO,
            };
            let Some(job) = self.shared.mailbox.take(patience) else {
                self.choose()?;
                self.film()?;
                continue;
            };
            let request = &job.request;
            let picture = if request.is_moving { self.soon(request) } else { self.at_rest(request) };
            let answer = match picture {
                Err(error) if is_interruption(&error) => {
                    self.shared.mailbox.put_back(job);
                    continue;
                }
                Err(error) if error.is_of_device() => {
                    job.reply.send(refusal(&error)).ok();
                    return Err(error);
                }
                Err(error) => refusal(&error),
                Ok((frame, is_full)) => {
                    let start = Instant::now();
                    let answer = self.answer(&frame, request, is_full);
                    if request.is_moving && !is_full {
                        self.pace.took(frame.time + start.elapsed());
                    }
                    answer
                }
            };
            self.shared.mailbox.finish();
            job.reply.send(answer).ok();
        }
        Ok(())
    }

    fn answer(&self, frame: &Frame, request: &Request, is_full: bool) -> Answer {
        let record = is_full.then(|| {
            let Viewer { viewed, device_name, .. } = self.viewer;
            let scheme = request.weighting.to_string();
            let chosen = self.choice.made(&scheme);
            PictureRecord::of(frame, viewed, &self.coverage, device_name, scheme, chosen, frame.background)
        });
        let unit = self.viewer.viewed.scene.frame.scale;
        match answer::bytes(frame, &self.coverage, request.layer, unit, record) {
            Ok(bytes) => Answer::of("application/octet-stream", bytes),
            Err(error) => Answer::error(503, &format!("the picture cannot be encoded: {error}")),
        }
    }

    /// Chooses the scheme for the scene, if that is due and full pictures are prepared. Makes way for every request;
    /// then it is begun again later.
    fn choose(&mut self) -> Result<(), RenderError> {
        let (Choice::Due, Some(full)) = (&self.choice, &self.full) else { return Ok(()) };
        self.shared.status.begin("choosing the scheme for the scene");
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: MakesWay::ToAll };
        match auto::choose(&full.stage, self.renderer, self.viewer.viewed.options, &watch) {
            Err(error) if is_interruption(&error) => {}
            Err(error) if error.is_of_device() => return Err(error),
            Err(error) => {
                watch.warn(&format!("no scheme could be chosen for the scene: {error}"));
                self.shared.status.choose(self.viewer.viewed.weighting.to_string());
                self.choice = Choice::None;
            }
            Ok(chosen) => {
                self.shared.status.choose(chosen.weighting.to_string());
                self.choice = Choice::Made(Box::new(chosen));
            }
        }
        Ok(())
    }

    /// The next frame of a video, if one is wanted. Makes way for every request; then it is begun again later. A scheme
    /// that is to be chosen for the scene is chosen first, so that all frames have the same.
    fn film(&mut self) -> Result<(), RenderError> {
        let Some(mut film) = self.film.take().or_else(|| self.shared.studio.take().map(Film::new)) else {
            return Ok(());
        };
        if let Some(pose) = film.next_pose() {
            match self.film_frame(pose, film.weighting()) {
                Ok(Some(frame)) => film.add(frame.picture),
                Ok(None) => {}
                Err(error) if is_interruption(&error) => {}
                Err(error) => {
                    film.refuse(refusal(&error));
                    return if error.is_of_device() { Err(error) } else { Ok(()) };
                }
            }
        }
        self.film = film.handed_over();
        Ok(())
    }

    /// A frame of a video, under the scheme that is chosen for the scene if it has no other; `None` before that is
    /// chosen, or full pictures are prepared.
    fn film_frame(&mut self, pose: Pose, weighting: Option<&Weighting>) -> Result<Option<Frame>, RenderError> {
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: MakesWay::ToAll };
        let chosen = self.choice.weighting().unwrap_or(self.viewer.viewed.weighting);
        let request = Request {
            tab: String::new(),
            pose,
            weighting: weighting.unwrap_or(chosen).clone(),
            layer: Layer::None,
            is_moving: false,
            most_side: COARSE_SIDE,
        };
        match (&self.full, &self.choice) {
            (None, _) => self.prepare(&watch).map(|()| None),
            (_, Choice::Due) => Ok(None),
            _ => self.full_frame(&request, &watch).map(Some),
        }
    }

    /// A picture at once: as fine as time allows. And whether it is a full one.
    fn soon(&mut self, request: &Request) -> Result<(Frame, bool), RenderError> {
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: MakesWay::Never };
        let is_fast = !self.pace.is_live() && self.full_time.is_some_and(|time| time < TIME_OF_A_PICTURE);
        let under = Some(self.under(&request.weighting));
        let is_ready = self.full.as_ref().is_some_and(|full| full.under == under);
        if is_fast && is_ready {
            return Ok((self.full_frame(request, &watch)?, true));
        }
        let camera = self.camera(request);
        let most = request.most_side.min(self.viewer.size[0].max(self.viewer.size[1]));
        let size = scaled_size(&camera, self.pace.side(most)).into();
        let Some(renderer) = self.coarse.as_mut().or(self.full.as_mut()) else {
            self.prepare(&watch)?;
            return self.soon(request);
        };
        Ok((renderer.stage.frame_of_size(&request.weighting, &camera, size, &watch)?, false))
    }

    /// The full picture. Makes way for requests that press.
    fn at_rest(&mut self, request: &Request) -> Result<(Frame, bool), RenderError> {
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: MakesWay::ToPressing };
        let under = self.under(&request.weighting);
        if let Some(coarse) = &mut self.coarse {
            self.shared.status.begin("encoding sources for coarse pictures");
            coarse.weigh(&request.weighting, Under { mixture: None, ..under }, &watch)?;
            // A frame that has to encode sources first would come late.
            coarse.stage.encode_all(&watch)?;
        }
        if self.full.is_none() {
            self.prepare(&watch)?;
        }
        Ok((self.full_frame(request, &watch)?, true))
    }

    /// Takes the sources to the device for full pictures.
    fn prepare(&mut self, watch: &Watch<'_>) -> Result<(), RenderError> {
        self.shared.status.begin("preparing full pictures");
        let Viewed { scene, sources, options, .. } = self.viewer.viewed;
        let images = Arc::clone(&self.images);
        let stage = Stage::of_images(scene, self.album, sources, images, self.renderer, options, watch)?;
        self.full = Some(Weighed::new(stage));
        Ok(())
    }

    fn full_frame(&mut self, request: &Request, watch: &Watch<'_>) -> Result<Frame, RenderError> {
        let target = Target { name: String::new(), camera: self.camera(request), truth: None };
        let under = self.under(&request.weighting);
        let Some(full) = &mut self.full else {
            self.prepare(watch)?;
            return self.full_frame(request, watch);
        };
        self.shared.status.begin("encoding sources");
        full.weigh(&request.weighting, under, watch)?;
        self.shared.status.begin("rendering");
        let start = Instant::now();
        let frame = full.stage.frame(&request.weighting, &target, watch)?;
        self.full_time = Some(start.elapsed());
        Ok(frame)
    }

    /// What full pictures under a weighting have: what was chosen along with it, or the render's options.
    fn under(&self, weighting: &Weighting) -> Under {
        let scheme = weighting.to_string();
        let given = || (self.viewer.viewed.options.field.clone(), None);
        let chosen = self.choice.made(&scheme).map(|chosen| (Some(chosen.options.clone()), chosen.mixture.clone()));
        let (options, mixture) = chosen.unwrap_or_else(given);
        Under { scheme, options, mixture }
    }

    /// The requested camera, with the intrinsics of the viewer.
    fn camera(&self, request: &Request) -> Camera {
        Camera { pose: request.pose, pinhole: self.viewer.pinhole }
    }
}

#[cfg(test)]
mod tests {
    use super::refusal;
    use viewfuse_core::camera::PinholeError;
    use viewfuse_core::sources::SourcesError;
    use viewfuse_device::DeviceError;
    use viewfuse_field::FieldError;
    use viewfuse_field::render::RenderError;

    #[test]
    fn nothing_that_a_person_does_is_an_error_of_the_server() {
        let unsuitable =
            RenderError::Unsuitable { scene: "photos".to_owned(), reason: "the views do not overlap".into() };
        let size = RenderError::Size { width: 0, height: 0, error: PinholeError::Size };
        for error in [unsuitable, size, RenderError::Sources(SourcesError::Empty)] {
            let answer = refusal(&error);
            assert_eq!(answer.status, 422, "{error}");
        }
        let device = RenderError::Field(FieldError::Device(DeviceError::Other("lost".into())));
        assert_eq!(refusal(&device).status, 503);
    }
}
