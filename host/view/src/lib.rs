//! An interactive viewer: a page on this machine, in which a person drags the camera and sees the picture, the weights
//! of the source views and the cameras change.
//!
//! ```text
//! page         the page's files, which are part of the program
//! request      requests of the page, checked
//! record       what belongs to a picture that is saved
//! answer       a frame as the page gets it
//! choice       the scheme that suits the scene, chosen beside the pictures
//! status       what is being done
//! response     answers of the server, with their headers
//! mailbox      of each tab only the newest request waits
//! pace         how coarse a picture has to be to come in time
//! video        a video of a path, one at a time
//! subject      what the page has to know of the scene
//! coarse       a cheaper form of the field, and smaller sources
//! render_loop  takes requests, renders, answers
//! message      requests as HTTP writes them, within limits
//! protocol     what the server reads of a connection's bytes, without the server
//! connection   one connection: requests in, answers out, within limits of time
//! connections  how many there may be, and which one makes way
//! server       who may ask, and for what
//! ```
#![forbid(unsafe_code)]

mod answer;
mod choice;
mod coarse;
mod connection;
mod connections;
mod mailbox;
mod message;
mod pace;
mod page;
pub mod protocol;
mod record;
mod render_loop;
mod request;
mod response;
mod server;
mod status;
mod subject;
mod video;

pub use request::COARSE_SIDE;
pub use server::ListenError;
pub use subject::Commands;

use render_loop::Shared;
use server::Server;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use subject::Subject;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::sources::SourcesError;
use viewfuse_device::choice::AnyDevice;
use viewfuse_field::AnyField;
use viewfuse_field::render::{RenderError, RenderOptions, picture_size};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

/// Pause between two looks whether the server has ended.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a viewer ended, or did not start.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The server cannot listen.
    #[error(transparent)]
    Listen(#[from] ListenError),
    /// The sources cannot be prepared, or the device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What is viewed.
#[derive(Clone, Copy)]
pub struct Viewed<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The source views, as indices into the scene's views: at least as many as the field needs, with photographs.
    pub sources: &'a [usize],
    /// The field.
    pub field: &'a AnyField,
    /// Where it renders.
    pub device: &'a AnyDevice,
    /// Size, background and omissions of full pictures.
    pub options: &'a RenderOptions,
    /// The weighting that the page begins with; the page can take any other that needs no file.
    pub weighting: &'a Weighting,
    /// Whether the weighting and the field's scalars are chosen for the scene ([`viewfuse_field::auto`]) after the
    /// first full picture, and shown from then on.
    pub chooses: bool,
}

/// A listening server with everything that it shows.
pub struct Viewer<'a> {
    viewed: Viewed<'a>,
    /// Intrinsics of the pictures, of the first source's own size.
    pinhole: Pinhole,
    /// Width and height of full pictures.
    size: [u32; 2],
    /// The device that renders.
    pub device_name: String,
    /// The unit of weightings.
    unit: RigUnit,
    /// In that unit.
    sources: SourcePoses,
    subject: Subject,
    server: Server,
}

impl<'a> Viewer<'a> {
    /// Listens on a port of the loopback interface, 0 for any. Nothing is rendered yet. The pictures have the
    /// intrinsics of the first source.
    ///
    /// # Errors
    /// [`ViewError`].
    pub fn listen(viewed: Viewed<'a>, commands: Commands, port: u16) -> Result<Viewer<'a>, ViewError> {
        let Viewed { scene, sources, field, device, options, .. } = viewed;
        let first = sources.first().ok_or(RenderError::Sources(SourcesError::Empty))?;
        let camera = scene.views[*first].camera;
        let unit = RigUnit::of_scene(scene);
        let poses: Vec<_> = sources.iter().map(|&view| unit.pose(&scene.views[view].camera.pose)).collect();
        let source_poses = SourcePoses::new(&poses).map_err(RenderError::Sources)?;
        let about = field.about();
        let size = picture_size(scene, options, about.longest_side, &camera)?;
        let [width, height] = size;
        let pinhole = camera.pinhole.resized(width, height);
        let pinhole = pinhole.map_err(|error| RenderError::Size { width, height, error })?;
        let device_name = field.on(device).device_name();
        let full = Camera { pinhole, ..camera };
        let subject = Subject::of(&viewed, &full, &about, device_name.clone(), commands);
        let server = Server::listen(port)?;
        Ok(Viewer { viewed, pinhole: camera.pinhole, size, device_name, unit, sources: source_poses, subject, server })
    }

    /// The address of the page, with its token. Who knows it can look at the scene.
    pub fn address(&self) -> String {
        self.server.address()
    }

    /// Renders on this thread and answers on others, one of each connection, until the progress says that it is
    /// cancelled. Pages may come and go.
    ///
    /// # Errors
    /// [`ViewError::Render`] if the sources cannot be prepared, or if the device fails.
    pub fn serve(&self, progress: &dyn Progress) -> Result<(), ViewError> {
        let shared = Shared::new();
        let is_over = AtomicBool::new(false);
        thread::scope(|scope| {
            let serving = scope.spawn(|| self.server.serve(self, &shared, &is_over));
            let rendered = render_loop::run(self, &shared, progress);
            // Connections that wait for a picture get none.
            shared.mailbox.close();
            shared.studio.close();
            is_over.store(true, Ordering::Relaxed);
            while !serving.is_finished() {
                self.server.wake();
                thread::sleep(PAUSE);
            }
            rendered
        })?;
        Ok(())
    }
}

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
