//! The videos of a run, which grow with its frames.

use crate::png::without_background;
use crate::rate::FrameRate;
use crate::video::{VideoError, VideoFormat, VideoWriter};
use image::DynamicImage;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viewfuse_field::render::Frame;
use viewfuse_job::progress::Progress;
use viewfuse_scene::{SceneError, read_picture};

/// What pictures show where a scene ends.
#[derive(Clone, Copy)]
pub(crate) enum Background {
    /// This colour, mixed into the frames' colours.
    Shown([f32; 3]),
    /// Nothing: this colour is taken out of the frames' colours.
    Transparent([f32; 3]),
}

/// A picture of a run.
#[derive(Clone)]
enum Picture {
    /// That of a frame of this process.
    Made(Arc<Frame>, Background),
    /// A file that an earlier start of the run has written.
    File(PathBuf),
}

/// Videos of all targets in their order.
#[derive(Default)]
pub(crate) struct Videos {
    formats: Vec<VideoFormat>,
    rate: FrameRate,
    /// The pictures' files, in the order of the targets.
    files: Vec<PathBuf>,
    /// The next of them.
    next: usize,
    /// One a format from the first frame on. A video that failed does not end the run: that is told at its end.
    writers: Vec<Result<VideoWriter, VideoError>>,
}

impl Videos {
    /// Names of their files.
    pub(crate) fn names(&self) -> Vec<String> {
        self.formats.iter().map(|format| format!("video.{format}")).collect()
    }

    /// In these formats, of pictures that are written to these files.
    pub(crate) fn new(formats: &[VideoFormat], rate: FrameRate, files: Vec<PathBuf>) -> Videos {
        Videos { formats: formats.to_vec(), rate, files, next: 0, writers: Vec::new() }
    }

    /// The next frame that is rendered, in a run whose files are in `folder`. Pictures of earlier targets that were not
    /// given are there as files.
    pub(crate) fn add(&mut self, folder: &Path, frame: &Arc<Frame>, background: Background) {
        if self.formats.is_empty() {
            return;
        }
        if self.writers.is_empty() {
            let size = frame.picture.dimensions().into();
            let (Background::Shown(colour) | Background::Transparent(colour)) = background;
            let behind = colour.map(|value| (value * 255.0).round() as u8);
            let path = |format: &VideoFormat| folder.join(format!("video.{format}"));
            let begin = |format| VideoWriter::begin(&path(format), *format, size, self.rate, behind);
            self.writers = self.formats.iter().map(begin).collect();
        }
        let file = folder.join(format!("{}.png", frame.target.name));
        while let Some(next) = self.files.get(self.next).filter(|next| **next != file) {
            self.give(Picture::File(next.clone()));
        }
        self.give(Picture::Made(Arc::clone(frame), background));
    }

    fn give(&mut self, picture: Picture) {
        self.next += 1;
        for writer in &mut self.writers {
            let picture = picture.clone();
            let added = writer.as_mut().map(|video| video.add(move || picture.open()));
            if let Ok(Err(error)) = added {
                *writer = Err(error);
            }
        }
    }

    /// Gives the pictures behind the last frame, and finishes the videos; returns their paths.
    pub(crate) fn finish(&mut self, progress: &dyn Progress) -> Result<Vec<PathBuf>, VideoError> {
        while let Some(next) = self.files.get(self.next) {
            progress.check()?;
            self.give(Picture::File(next.clone()));
        }
        let writers = std::mem::take(&mut self.writers);
        let count = writers.len();
        let finish = |(index, writer): (usize, Result<VideoWriter, VideoError>)| {
            progress.stage(&format!("writing video.{}", self.formats[index]), index..index + 1, count);
            writer?.finish(progress)
        };
        writers.into_iter().enumerate().map(finish).collect()
    }
}

impl Picture {
    fn open(self) -> Result<DynamicImage, SceneError> {
        match self {
            Picture::File(path) => read_picture(&path),
            Picture::Made(frame, background) => Ok(picture_of(&frame, background)),
        }
    }
}

/// The picture of a frame.
pub(crate) fn picture_of(frame: &Frame, background: Background) -> DynamicImage {
    match background {
        Background::Shown(_) => DynamicImage::ImageRgb8(frame.picture.clone()),
        Background::Transparent(colour) => {
            let size = frame.picture.dimensions().into();
            DynamicImage::ImageRgba8(without_background(&frame.colours, size, colour))
        }
    }
}
