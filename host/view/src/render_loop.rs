//! The render loop: takes requests, renders coarse and full pictures, answers.
//!
//! It runs on the thread of its caller and owns what is on the device. A coarse picture comes from smaller sources and a
//! cheaper form of the field, or, for fields without such a form, is a smaller picture from the same sources. A full
//! picture has the size and the values of `viewfuse_field::render` for the same camera and weighting. It makes way for
//! coarse ones, at the points where the field checks for cancellation, and is begun again later; sources that are
//! encoded by then stay encoded.

use crate::answer;
use crate::coarse;
use crate::mailbox::{Mailbox, Queued};
use crate::pace::{Pace, TIME_OF_A_PICTURE};
use crate::request::{COARSE_SIDE, Request};
use crate::response::Answer;
use crate::status::Status;
use crate::{Viewed, Viewer};
use std::sync::mpsc::Sender;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_field::render::{Frame, RenderError, RenderOptions, Stage, open_album, working_side};
use viewfuse_field::{FieldError, Renderer};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::{Album, PhotographsError, SourceImages, reduced_size, scaled_size};
use viewfuse_weighting::Weighting;

/// So long the loop waits for a request before it looks whether it should end.
const PATIENCE: Duration = Duration::from_millis(50);

/// What the render loop and the server share.
pub(crate) struct Shared {
    pub(crate) mailbox: Mailbox<Job>,
    pub(crate) status: Status,
    /// Pictures of the sources as JPEG, once they are read.
    pub(crate) thumbnails: OnceLock<Vec<Vec<u8>>>,
}

impl Shared {
    pub(crate) fn new() -> Shared {
        Shared { mailbox: Mailbox::new(), status: Status::default(), thumbnails: OnceLock::new() }
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

/// Progress of a piece of work: shown on the page, and stopped when the program ends or, if it `makes_way`, when a
/// request presses.
struct Watch<'a> {
    shared: &'a Shared,
    outer: &'a dyn Progress,
    makes_way: bool,
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
        self.outer.is_cancelled() || (self.makes_way && self.shared.mailbox.is_pressing())
    }
}

/// A stage and the scheme that its sources are encoded under.
struct Weighed<'a> {
    stage: Stage<'a>,
    scheme: String,
}

impl Weighed<'_> {
    /// Begins a weighting, unless it has begun. Sources that it does not encode are encoded by the frames that use them.
    fn weigh(
        &mut self,
        weighting: &Weighting,
        viewed: &Viewed<'_>,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        let scheme = weighting.to_string();
        if self.scheme != scheme {
            self.stage.tune(viewed.settings_of(&scheme));
            self.scheme = scheme;
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
    /// For fields with a cheaper form.
    coarse: Option<Weighed<'a>>,
    full: Option<Weighed<'a>>,
    pace: Pace,
    /// Time of the last full picture.
    full_time: Option<Duration>,
}

/// Width and height of full pictures at a camera of a view.
///
/// # Errors
/// [`RenderError`] if the requested size does not fit the scene.
pub(crate) fn full_size(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    longest: u32,
) -> Result<[u32; 2], RenderError> {
    let side = working_side(scene, options, longest)?;
    Ok(options.size.unwrap_or_else(|| reduced_size(camera, side).into()))
}

/// Renders until the progress says that it is cancelled.
///
/// # Errors
/// [`RenderError`] if the sources cannot be prepared, or if the device fails.
pub(crate) fn run(viewer: &Viewer<'_>, shared: &Shared, outer: &dyn Progress) -> Result<(), RenderError> {
    let Viewed { scene, sources, field, device, options, weighting, .. } = viewer.viewed;
    let watch = Watch { shared, outer, makes_way: false };
    let stopped = |result: Result<(), RenderError>| match result {
        Err(error) if is_interruption(&error) => Ok(()),
        result => result,
    };
    let about = field.about();
    let source_side = about.source_side.of(working_side(scene, options, about.longest_side)?);
    let renderer = field.on(device);
    let cheaper = field.preview();
    let coarse_options = coarse::options(options);
    let cheap_renderer = cheaper.as_ref().map(|field| field.on(device));
    stopped((|| {
        shared.status.begin("reading photographs");
        let album = open_album(scene, sources.iter().copied(), renderer.as_ref(), options, &watch)?;
        let images = Arc::new(album.sources(sources, source_side, options.background, &watch)?);
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
            pace: Pace::default(),
            full_time: None,
        };
        match &cheap_renderer {
            Some(renderer) => {
                shared.status.begin("preparing coarse pictures");
                let stage = coarse::stage(scene, &album, sources, small, renderer.as_ref(), &coarse_options, &watch)?;
                let mut coarse = Weighed { stage, scheme: String::new() };
                coarse.weigh(weighting, &viewer.viewed, &watch)?;
                pictures.coarse = Some(coarse);
            }
            None => pictures.prepare(&watch)?,
        }
        pictures.serve()
    })())
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
            let Some(job) = self.shared.mailbox.take(PATIENCE) else { continue };
            let request = &job.request;
            let picture = if request.is_moving { self.soon(request) } else { self.at_rest(request) };
            let bytes = match picture {
                Err(error) if is_interruption(&error) => {
                    self.shared.mailbox.put_back(job);
                    continue;
                }
                Err(error) if error.is_of_device() => {
                    job.reply.send(Answer::error(500, &error.to_string())).ok();
                    return Err(error);
                }
                picture => picture.map_err(|error| error.to_string()).and_then(|(frame, is_full)| {
                    answer::bytes(&frame, &self.coverage, request.layer, is_full).map_err(|error| error.to_string())
                }),
            };
            self.shared.mailbox.finish();
            let answer = match bytes {
                Ok(bytes) => Answer::of("application/octet-stream", bytes),
                Err(message) => Answer::error(500, &message),
            };
            job.reply.send(answer).ok();
        }
        Ok(())
    }

    /// A picture at once: as fine as time allows. And whether it is a full one.
    fn soon(&mut self, request: &Request) -> Result<(Frame, bool), RenderError> {
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: false };
        let is_fast = self.full_time.is_some_and(|time| time < TIME_OF_A_PICTURE);
        let is_ready = self.full.as_ref().is_some_and(|full| full.scheme == request.weighting.to_string());
        if is_fast && is_ready {
            return Ok((self.full_frame(request, &watch)?, true));
        }
        let camera = self.camera(request);
        let most = request.most_side.min(self.viewer.size[0].max(self.viewer.size[1]));
        let size = scaled_size(&camera, self.pace.side(most)).into();
        let start = Instant::now();
        let Some(own) = self.coarse.as_mut().or(self.full.as_mut()) else {
            self.prepare(&watch)?;
            return self.soon(request);
        };
        let frame = own.stage.frame_of_size(&request.weighting, &camera, size, &watch)?;
        self.pace.took(start.elapsed());
        Ok((frame, false))
    }

    /// The full picture. Makes way for requests that press.
    fn at_rest(&mut self, request: &Request) -> Result<(Frame, bool), RenderError> {
        let watch = Watch { shared: self.shared, outer: self.outer, makes_way: true };
        if let Some(coarse) = &mut self.coarse {
            self.shared.status.begin("encoding sources for coarse pictures");
            coarse.weigh(&request.weighting, &self.viewer.viewed, &watch)?;
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
        self.full = Some(Weighed { stage, scheme: String::new() });
        Ok(())
    }

    fn full_frame(&mut self, request: &Request, watch: &Watch<'_>) -> Result<Frame, RenderError> {
        let target = Target { name: String::new(), camera: self.camera(request), truth: None };
        let Some(full) = &mut self.full else {
            self.prepare(watch)?;
            return self.full_frame(request, watch);
        };
        self.shared.status.begin("encoding sources");
        full.weigh(&request.weighting, &self.viewer.viewed, watch)?;
        self.shared.status.begin("rendering");
        let start = Instant::now();
        let frame = full.stage.frame(&request.weighting, &target, watch)?;
        self.full_time = Some(start.elapsed());
        Ok(frame)
    }

    /// The requested camera, with the intrinsics of the viewer.
    fn camera(&self, request: &Request) -> Camera {
        Camera { pose: request.pose, pinhole: self.viewer.pinhole }
    }
}
