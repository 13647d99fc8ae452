//! The frames of a run as one file: an animated picture, or a video.

mod ffmpeg;

use self::ffmpeg::{FFMPEG, Ffmpeg};
use crate::gif::{self, Gif};
use crate::rate::FrameRate;
use crate::webp::{self, Animation, EncodedFrame};
use crate::y4m::Y4m;
use image::{DynamicImage, Rgb, RgbImage};
use std::error::Error;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use viewfuse_device::queue::{Queue, width};
use viewfuse_job::files::{WholeFile, WriteError, write_whole};
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_scene::SceneError;

/// A format of moving pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VideoFormat {
    /// Animated WebP without loss, for pages and messages.
    Webp,
    /// Animated GIF of 256 colours a frame, for those that take no WebP.
    Gif,
    /// YUV4MPEG2, without compression, for video programs.
    Y4m,
    /// MP4, by the person's own `ffmpeg`.
    Mp4,
}

viewfuse_job::named! {
    // The extensions of their files.
    pub VideoFormat: "a format of moving pictures" {
        Webp => "webp",
        Gif => "gif",
        Y4m => "y4m",
        Mp4 => "mp4",
    }
}

impl VideoFormat {
    /// Whether this machine can write it: MP4 needs an `ffmpeg` on the path.
    pub fn is_possible(self) -> bool {
        let starts =
            || Command::new(FFMPEG).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
        self != VideoFormat::Mp4 || starts()
    }
}

/// Why no video was written.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A frame could not be read.
    #[error(transparent)]
    Frame(#[from] SceneError),
    /// The frames differ in size: the video, a frame's width and height, and those of the first frame.
    #[error(
        "{}: a frame has {}x{} pixels, the first one {}x{}; the frames of a video have one size",
        .0.display(), .1[0], .1[1], .2[0], .2[1]
    )]
    Sizes(PathBuf, [u32; 2], [u32; 2]),
    /// No frame was added.
    #[error("{0}: a video of no frames")]
    NoFrames(PathBuf),
    /// There is no `ffmpeg` on this machine.
    #[error("there is no {FFMPEG} on the path, which mp4 needs")]
    NoProgram,
    /// `ffmpeg` failed: the file to write, and what it said.
    #[error("{0}: {FFMPEG} could not write it: {1}")]
    Program(PathBuf, String),
    /// The person stopped the work.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// A moving picture that is written frame by frame, while the next frames are made, and appears when it is finished.
/// Other threads encode, those of the current pool.
pub struct VideoWriter {
    path: PathBuf,
    size: [u32; 2],
    encode: Encode,
    background: [u8; 3],
    /// Frames that were added.
    count: usize,
    /// Frames that are not written yet.
    frames: Queue<Result<Encoded, VideoError>>,
    output: Output,
}

type Cause = Box<dyn Error + Send + Sync>;

/// Encodes a frame, over a background where its format has no transparency.
type Encode = fn(DynamicImage, [u8; 3]) -> Result<Encoded, Cause>;

/// A frame as its format wants it.
enum Encoded {
    Webp(EncodedFrame),
    Gif(gif::Frame<'static>),
    Plain(RgbImage),
}

/// Where frames go.
enum Output {
    Webp(Animation),
    Gif(Box<Gif<Whole>>),
    Y4m(Y4m<Whole>),
    Mp4(Ffmpeg),
}

impl VideoWriter {
    /// Begins a video whose frames have this width and height. Transparency is kept in WebP, and laid over
    /// `background` in the others.
    ///
    /// # Errors
    /// [`VideoError::Write`]; [`VideoError::NoProgram`] if the format is MP4 and there is no `ffmpeg`.
    pub fn begin(
        path: &Path,
        format: VideoFormat,
        size: [u32; 2],
        rate: FrameRate,
        background: [u8; 3],
    ) -> Result<VideoWriter, VideoError> {
        let file = || WholeFile::create(path).map(Whole);
        let (encode, output): (Encode, Output) = match format {
            VideoFormat::Webp => {
                (|frame, _| Ok(Encoded::Webp(webp::encoded(&frame)?)), Output::Webp(Animation::new(size, rate)))
            }
            VideoFormat::Gif => {
                let animation = Gif::begin(file()?, size, rate).map_err(|cause| encode_error(path, cause))?;
                (|frame, behind| Ok(Encoded::Gif(gif::frame(&over(frame, behind))?)), Output::Gif(Box::new(animation)))
            }
            VideoFormat::Y4m => {
                let video = Y4m::begin(file()?, size, rate).map_err(|cause| io_error(path, cause))?;
                (plain, Output::Y4m(video))
            }
            VideoFormat::Mp4 => (plain, Output::Mp4(Ffmpeg::begin(path, size, rate)?)),
        };
        Ok(VideoWriter {
            path: path.to_path_buf(),
            size,
            encode,
            background,
            count: 0,
            frames: Queue::default(),
            output,
        })
    }

    /// Begins to encode the next frame, which another thread makes or reads. While as many wait as there are threads,
    /// it waits for the oldest.
    ///
    /// # Errors
    /// Those of this frame's predecessors: nothing may follow.
    pub fn add(
        &mut self,
        picture: impl FnOnce() -> Result<DynamicImage, SceneError> + Send + 'static,
    ) -> Result<(), VideoError> {
        while self.frames.len() >= width() {
            self.write_oldest()?;
        }
        self.count += 1;
        let (encode, background, first, path) = (self.encode, self.background, self.size, self.path.clone());
        self.frames.add(move || {
            let picture = picture()?;
            let size = [picture.width(), picture.height()];
            match size == first {
                true => encode(picture, background).map_err(|cause| encode_error(&path, cause)),
                false => Err(VideoError::Sizes(path, size, first)),
            }
        });
        Ok(())
    }

    /// Writes the oldest frame that is not written.
    fn write_oldest(&mut self) -> Result<(), VideoError> {
        let Some(frame) = self.frames.next_result() else { return Ok(()) };
        match (&mut self.output, frame?) {
            (Output::Webp(animation), Encoded::Webp(frame)) => {
                animation.add(&frame).map_err(|cause| encode_error(&self.path, cause))?;
            }
            (Output::Gif(animation), Encoded::Gif(frame)) => {
                animation.add(frame).map_err(|cause| encode_error(&self.path, cause))?;
            }
            (Output::Y4m(video), Encoded::Plain(frame)) => {
                video.frame(&frame).map_err(|cause| io_error(&self.path, cause))?;
            }
            (Output::Mp4(program), Encoded::Plain(frame)) => program.frame(&frame)?,
            // Frames are encoded for the output.
            _ => {}
        }
        Ok(())
    }

    /// Writes the frames that wait, and puts the file in its place.
    ///
    /// # Errors
    /// [`VideoError`]; then there is no file.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<PathBuf, VideoError> {
        if self.count == 0 {
            return Err(VideoError::NoFrames(self.path));
        }
        progress.expect(self.frames.len());
        while !self.frames.is_empty() {
            progress.check()?;
            self.write_oldest()?;
            progress.step();
        }
        let VideoWriter { path, output, .. } = self;
        match output {
            Output::Webp(animation) => {
                let file = animation.finish().map_err(|cause| encode_error(&path, cause))?;
                write_whole(&path, &file)?;
            }
            Output::Gif(animation) => {
                animation.finish().map_err(|cause| encode_error(&path, cause))?.0.finish()?;
            }
            Output::Y4m(video) => video.finish().map_err(|cause| io_error(&path, cause))?.0.finish()?,
            Output::Mp4(program) => program.finish()?,
        }
        Ok(path)
    }
}

fn plain(frame: DynamicImage, background: [u8; 3]) -> Result<Encoded, Cause> {
    Ok(Encoded::Plain(over(frame, background)))
}

/// A picture over a background of one colour.
fn over(picture: DynamicImage, background: [u8; 3]) -> RgbImage {
    if !picture.color().has_alpha() {
        return picture.into_rgb8();
    }
    let picture = picture.into_rgba8();
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let [r, g, b, a] = picture.get_pixel(x, y).0.map(u32::from);
        let mix = |colour: u32, behind: u8| ((colour * a + u32::from(behind) * (255 - a) + 127) / 255) as u8;
        Rgb([mix(r, background[0]), mix(g, background[1]), mix(b, background[2])])
    })
}

/// A file that appears when it is whole, as a writer.
struct Whole(WholeFile);

impl Write for Whole {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map_err(|error| match error {
            WriteError::Io { cause, .. } => cause,
            error => io::Error::other(error),
        })?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn io_error(path: &Path, cause: io::Error) -> VideoError {
    WriteError::Io { path: path.to_path_buf(), cause }.into()
}

fn encode_error(path: &Path, cause: impl Into<Cause>) -> VideoError {
    WriteError::Encode { path: path.to_path_buf(), cause: cause.into() }.into()
}
