//! A video of a path, one at a time: the render loop makes its frames while nothing else is asked for, and the thread
//! of the connection that waits for it encodes them. It ends with that connection.

use crate::request::{MAX_FRAMES, VideoRequest};
use crate::response::Answer;
use crate::status::Status;
use image::{DynamicImage, RgbImage};
use serde::Serialize;
use std::fmt::Display;
use std::sync::mpsc::{RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use viewfuse_core::pose::Pose;
use viewfuse_job::files::Scratch;
use viewfuse_job::progress::Progress;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::video::{VideoError, VideoFormat, VideoWriter};
use viewfuse_weighting::Weighting;

/// Frames a second, as the page plays a path.
const RATE: f64 = 24.0;

/// Time between two looks whether anybody still waits.
const LOOK: Duration = Duration::from_millis(100);

/// What the page has to know of videos.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Videos {
    /// MP4 where this machine can write it, otherwise WebP.
    #[serde(serialize_with = "as_text")]
    pub(crate) format: VideoFormat,
    most_frames: usize,
}

fn as_text<S: serde::Serializer>(format: &VideoFormat, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(format)
}

impl Videos {
    /// Of this machine.
    pub(crate) fn of_machine() -> Videos {
        let format = if VideoFormat::Mp4.is_possible() { VideoFormat::Mp4 } else { VideoFormat::Webp };
        Videos { format, most_frames: MAX_FRAMES }
    }
}

/// A path whose frames are to be rendered.
pub(crate) struct Order {
    poses: Vec<Pose>,
    /// `None` for the one that is chosen for the scene.
    weighting: Option<Weighting>,
    /// To the connection that waits: the frames in their order. Closed once nobody waits.
    frames: SyncSender<RgbImage>,
    /// To the same: why there are no more frames.
    refusal: Sender<Answer>,
}

/// An order at work.
pub(crate) struct Film {
    order: Order,
    /// Frames that were handed over.
    count: usize,
    /// The next frame, until the connection can take it.
    rendered: Option<RgbImage>,
}

impl Film {
    pub(crate) fn new(order: Order) -> Film {
        Film { order, count: 0, rendered: None }
    }

    /// The weighting of all frames; `None` for the one that is chosen for the scene.
    pub(crate) fn weighting(&self) -> Option<&Weighting> {
        self.order.weighting.as_ref()
    }

    /// Whether a rendered frame waits until the connection can take it.
    pub(crate) fn is_waiting(&self) -> bool {
        self.rendered.is_some()
    }

    /// The pose of the next frame that is to be rendered; `None` while a rendered one waits.
    pub(crate) fn next_pose(&self) -> Option<Pose> {
        let pose = self.order.poses.get(self.count).copied();
        pose.filter(|_| !self.is_waiting())
    }

    /// Takes the next frame.
    pub(crate) fn add(&mut self, frame: RgbImage) {
        self.rendered = Some(frame);
    }

    /// Ends it, and tells who waits why.
    pub(crate) fn refuse(self, refusal: Answer) {
        // To nobody, if the client is gone.
        self.order.refusal.send(refusal).ok();
    }

    /// Hands over the frame that waits, if the connection can take one: while it encodes others, everybody else gets
    /// pictures. `None` once it has all frames, or nobody waits for it.
    pub(crate) fn handed_over(mut self) -> Option<Film> {
        if let Some(frame) = self.rendered.take() {
            match self.order.frames.try_send(frame) {
                Ok(()) => self.count += 1,
                Err(TrySendError::Full(frame)) => self.rendered = Some(frame),
                Err(TrySendError::Disconnected(_)) => return None,
            }
        }
        let is_whole = self.count >= self.order.poses.len();
        (!is_whole).then_some(self)
    }
}

/// Where orders wait for the render loop.
#[derive(Default)]
pub(crate) struct Studio(Mutex<State>);

#[derive(Default)]
struct State {
    /// Somebody waits for a video.
    is_taken: bool,
    order: Option<Order>,
    /// Nobody takes orders any more.
    is_closed: bool,
}

/// The right to have a video made, until this is dropped.
pub(crate) struct Turn<'a> {
    studio: &'a Studio,
    status: &'a Status,
}

impl Studio {
    /// No work is done while it is held, so it cannot be poisoned.
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// `None` while another video is made.
    pub(crate) fn begin<'a>(&'a self, status: &'a Status) -> Option<Turn<'a>> {
        let mut state = self.state();
        let is_free = !std::mem::replace(&mut state.is_taken, true);
        is_free.then(|| Turn { studio: self, status })
    }

    /// The order that waits.
    pub(crate) fn take(&self) -> Option<Order> {
        self.state().order.take()
    }

    /// Whether an order waits.
    pub(crate) fn is_waiting(&self) -> bool {
        self.state().order.is_some()
    }

    /// Nobody takes orders any more: one that waits is forgotten.
    pub(crate) fn close(&self) {
        let mut state = self.state();
        (state.is_closed, state.order) = (true, None);
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut state = self.studio.state();
        (state.is_taken, state.order) = (false, None);
        self.status.film(None);
    }
}

/// Stops what nobody waits for.
struct Wanted<'a>(&'a (dyn Fn() -> bool + Sync));

impl Progress for Wanted<'_> {
    fn is_cancelled(&self) -> bool {
        (self.0)()
    }
}

impl Turn<'_> {
    /// Waits for the frames and encodes them. `None` if the client is gone, or the viewer ended.
    pub(crate) fn make(
        &self,
        request: VideoRequest,
        format: VideoFormat,
        is_gone: &(dyn Fn() -> bool + Sync),
    ) -> Option<Answer> {
        let VideoRequest { poses, weighting } = request;
        let of = poses.len();
        let (sender, frames) = sync_channel(1);
        let (refusal, refused) = channel();
        let mut state = self.studio.state();
        if !state.is_closed {
            state.order = Some(Order { poses, weighting, frames: sender, refusal });
        }
        drop(state);
        let failed = |error: &dyn Display| Some(Answer::error(503, &format!("the video cannot be written: {error}")));
        let scratch = match Scratch::new() {
            Ok(scratch) => scratch,
            Err(error) => return failed(&error),
        };
        let file = scratch.path().join(format!("video.{format}"));
        let rate = FrameRate::new(RATE).unwrap_or_default();
        let (mut video, mut count) = (None, 0);
        while count < of {
            self.status.film(Some([count, of]));
            let frame = frames.recv_timeout(LOOK);
            if is_gone() {
                return None;
            }
            match frame {
                Ok(picture) => {
                    let size = picture.dimensions().into();
                    let begin = || VideoWriter::begin(&file, format, size, rate, [0; 3]);
                    let mut writer = match video.take().map_or_else(begin, Ok) {
                        Ok(writer) => writer,
                        Err(error) => return failed(&error),
                    };
                    if let Err(error) = writer.add(move || Ok(DynamicImage::ImageRgb8(picture))) {
                        return failed(&error);
                    }
                    video = Some(writer);
                    count += 1;
                }
                Err(RecvTimeoutError::Timeout) => {}
                // With the reason, if it was refused.
                Err(RecvTimeoutError::Disconnected) => return refused.try_recv().ok(),
            }
        }
        match video?.finish(&Wanted(is_gone)) {
            Err(VideoError::Interrupted(_)) => return None,
            Err(error) => return failed(&error),
            Ok(_) => {}
        }
        let media_type = if format == VideoFormat::Mp4 { "video/mp4" } else { "image/webp" };
        std::fs::read(&file).map_or_else(|error| failed(&error), |bytes| Some(Answer::of(media_type, bytes)))
    }
}
