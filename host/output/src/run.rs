//! The output folder of a run: `NAME.png`, `NAME_depth.png` (16 bit; also `.exr` and `.npy`), `NAME_confidence.png` (8
//! bit) and, of a photograph, `NAME_sheet.png` for each target, and `run.json` when all are there.
//!
//! A run that was interrupted continues: [`RunWriter::resume`] tells which targets are finished.

use crate::depth::{DepthFormat, write_depth};
use crate::earlier::earlier_files;
use crate::journal::{FrameJournal, files_of};
use crate::png::write_png;
use crate::rate::FrameRate;
use crate::record::{
    ChosenRecord, DepthUnits, FrameRecord, RunRecord, background_record, kernel_records, times_record, view_names,
};
pub use crate::record::{RECORD, SUFFIXES};
use crate::sheet::{Sheet, SheetSource, depth_picture};
use crate::unwritten::{File, Frames};
use crate::video::{VideoError, VideoFormat};
use crate::videos::{Background, Videos, picture_of};
use image::{DynamicImage, ImageBuffer, Luma, RgbImage};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use viewfuse_field::Renderer;
use viewfuse_field::auto::Chosen;
use viewfuse_field::render::{Finished, Frame, RenderOptions};
use viewfuse_job::files::{FolderLock, WriteError, remove_if_there, write_whole};
use viewfuse_job::progress::Progress;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{Scene, SceneFrame};
use viewfuse_weighting::Weighting;

/// What is written for each target beside `NAME.png`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outputs {
    /// Write the opacity as the picture's alpha channel, and the colour without the background.
    pub alpha: bool,
    /// Formats of the depth map.
    pub depths: Vec<DepthFormat>,
    /// Write the confidence map, of fields that have one.
    pub confidence: bool,
    /// Write the contact sheets of targets that are photographs: what a picture is compared with there.
    pub sheet: bool,
}

impl Default for Outputs {
    /// No alpha channel, the depth map as PNG, the confidence map, the contact sheet.
    fn default() -> Outputs {
        Outputs { alpha: false, depths: vec![DepthFormat::Png], confidence: true, sheet: true }
    }
}

/// Writes a run's frames on other threads, those of the current pool, and the record after the last.
pub struct RunWriter {
    // Dropped before the lock: what it began to write is written then.
    frames: Frames,
    videos: Videos,
    folder: PathBuf,
    /// What is written for the frames that follow.
    pub outputs: Outputs,
    /// Whether a frame was given to be written.
    has_begun: bool,
    /// From the beginning if the folder is there, otherwise from the first file.
    lock: Option<FolderLock>,
    continued: usize,
    /// The targets' names, in their order.
    target_names: Vec<String>,
    /// The scene's path as it was opened.
    scene: String,
    /// The last part of it.
    scene_name: String,
    /// The scene's frame: what is recorded is in the coordinates of its files.
    space: SceneFrame,
    weighting: String,
    source_names: Vec<String>,
    /// The photographs, once a contact sheet has shown them: those of all frames are the same.
    source_pictures: Vec<Arc<RgbImage>>,
    coverage: Coverage,
    /// Frames of the record of an earlier run of the same settings, which is added to: they and their files stay
    /// ([`crate::folder::check_folder`]).
    pub earlier: Vec<FrameRecord>,
    size: [u32; 2],
    background: [f32; 3],
    /// About the scene and the whole run, before those about the photographs.
    given: Vec<String>,
    conventions: Vec<String>,
    warnings: Vec<String>,
    chosen: Option<Chosen>,
}

/// The values of the record that only the caller knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Circumstances {
    /// Version of the program.
    pub program: &'static str,
    /// The reason for choosing the device.
    pub device_reason: String,
    /// The source of the network's parameters.
    pub model: Option<String>,
    /// Whether all omissions are switched off.
    pub exact: bool,
    /// See [`RunRecord::settings`].
    pub settings: Option<String>,
    /// Seed of every random draw.
    pub seed: u64,
    /// The time of reading the scene.
    pub open_time: Duration,
    /// The time of the whole run.
    pub total_time: Duration,
}

impl RunWriter {
    /// Nothing is written yet. `scene_label` is the scene's path in the record.
    pub fn new(folder: &Path, scene: &Scene, scene_label: String, job: &FewShot, weighting: &Weighting) -> RunWriter {
        RunWriter {
            frames: Frames::default(),
            videos: Videos::default(),
            folder: folder.to_path_buf(),
            outputs: Outputs::default(),
            has_begun: false,
            lock: None,
            continued: 0,
            target_names: job.targets.iter().map(|target| target.name.clone()).collect(),
            scene: scene_label,
            scene_name: scene.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            space: scene.frame,
            weighting: weighting.to_string(),
            source_names: view_names(scene, &job.sources),
            source_pictures: Vec::new(),
            coverage: Coverage::of(&job.source_cameras(scene)),
            earlier: Vec::new(),
            size: [0, 0],
            background: [0.0; 3],
            given: scene.warnings.clone(),
            conventions: scene.conventions.clone(),
            warnings: Vec::new(),
            chosen: None,
        }
    }

    /// The pictures of all targets are written as `video.FORMAT`, too, while they are rendered.
    pub fn make_videos(&mut self, formats: &[VideoFormat], rate: FrameRate) {
        let files = self.target_names.iter().map(|name| self.folder.join(format!("{name}.png"))).collect();
        self.videos = Videos::new(formats, rate, files);
    }

    /// Adds a warning to the record, which has each once.
    pub fn warn(&mut self, warning: String) {
        self.given.push(warning);
    }

    /// Lets no other process write to the folder, as soon as it is there.
    ///
    /// # Errors
    /// [`WriteError::Busy`] while another process writes to it.
    pub fn lock(&mut self) -> Result<(), WriteError> {
        if self.lock.is_none() && self.folder.is_dir() {
            self.lock = Some(FolderLock::take(&self.folder)?);
        }
        Ok(())
    }

    /// Keeps a journal of finished frames, and continues an earlier start of the same run in this folder: returns the
    /// names of the targets that need not be rendered again. One target always remains. `run` is any text that differs
    /// for runs that would write different frames. Nothing is written yet.
    ///
    /// # Errors
    /// [`WriteError::Io`] if there is a journal that cannot be read.
    pub fn resume(&mut self, run: &str) -> Result<BTreeSet<String>, WriteError> {
        self.lock()?;
        let (journal, mut finished) = FrameJournal::open(&self.folder, run, &self.target_names)?;
        finished.retain(|earlier| self.target_names.contains(&earlier.frame.target));
        if finished.len() == self.target_names.len() {
            // The run's background and size are known from a frame.
            finished.pop();
        }
        self.continued = finished.len();
        let frames: Vec<FrameRecord> = finished.into_iter().map(|earlier| earlier.frame).collect();
        let names = frames.iter().map(|frame| frame.target.clone()).collect();
        self.frames = Frames::resumed(frames, journal);
        Ok(names)
    }

    /// The frames that follow are of a scheme and settings that were chosen for the scene: they replace the weighting,
    /// and each frame gets the score to expect.
    pub fn set_chosen(&mut self, chosen: &Chosen) {
        if self.chosen.is_none() {
            self.weighting = chosen.weighting.to_string();
            self.chosen = Some(chosen.clone());
        }
    }

    /// Begins to write a frame's pictures; they are there when the run is finished, or the writer dropped. With the
    /// first one, the record of an earlier run is removed: it would be wrong for the new pictures.
    ///
    /// # Errors
    /// [`WriteError`], also that of an earlier frame.
    pub fn write(&mut self, sources: &SourceImages, frame: Frame) -> Result<(), WriteError> {
        if !self.has_begun {
            self.begin()?;
            self.has_begun = true;
        }
        self.size = frame.picture.dimensions().into();
        self.background = frame.background;
        self.warnings.clone_from(&sources.warnings);
        if self.has_sheet(&frame) && self.source_pictures.is_empty() {
            self.source_pictures = (0..sources.images.len()).map(|source| Arc::new(sources.picture(source))).collect();
        }
        let mut record = FrameRecord::of(&frame, &self.source_names, &self.coverage, &self.space)
            .expecting(self.chosen.as_ref(), &frame);
        let bytes = bytes_of(&frame);
        let frame = Arc::new(frame);
        let files = self.files(&frame)?;
        record.files = files.iter().map(|file| file.name.clone()).collect();
        self.frames.add(record, files, bytes)?;
        self.videos.add(&self.folder, &frame, self.background());
        Ok(())
    }

    fn has_sheet(&self, frame: &Frame) -> bool {
        self.outputs.sheet && frame.truth.is_some()
    }

    fn background(&self) -> Background {
        if self.outputs.alpha { Background::Transparent(self.background) } else { Background::Shown(self.background) }
    }

    /// The files of a frame. Those of an earlier run that it does not have would belong to another picture, and are
    /// removed.
    fn files(&self, frame: &Arc<Frame>) -> Result<Vec<File>, WriteError> {
        let (target, size) = (&frame.target.name, self.size);
        let mut files = Vec::new();
        let mut add = |name: String, write: Option<Writing>| {
            let path = self.folder.join(&name);
            match write {
                Some(write) => files.push(File { name, write: Box::new(move || write(&path)) }),
                None => return remove_if_there(&path),
            }
            Ok(())
        };
        let (shown, background) = (Arc::clone(frame), self.background());
        let picture: Writing = Box::new(move |path| write_png(path, &picture_of(&shown, background)));
        add(format!("{target}.png"), Some(picture))?;
        for format in DepthFormat::ALL {
            let (shown, space) = (Arc::clone(frame), self.space);
            let depth: Writing = Box::new(move |path| {
                let depths: Vec<f32> = shown.depths.iter().map(|depth| space.file_length(*depth)).collect();
                write_depth(path, format, &depths, size)
            });
            let is_written = !frame.depths.is_empty() && self.outputs.depths.contains(&format);
            add(format!("{target}_depth.{format}"), is_written.then_some(depth))?;
        }
        let shown = Arc::clone(frame);
        let confidence: Writing = Box::new(move |path| match confidence_map(&shown) {
            Some(map) => write_png(path, &DynamicImage::ImageLuma8(map)),
            None => Ok(()),
        });
        let is_written = !frame.confidences.is_empty() && self.outputs.confidence;
        add(format!("{target}_confidence.png"), is_written.then_some(confidence))?;
        let sheet = self.has_sheet(frame).then(|| {
            let (shown, title, sources) = (Arc::clone(frame), self.title(frame), self.sheet_sources(frame));
            let write: Writing =
                Box::new(move |path| write_png(path, &DynamicImage::ImageRgb8(sheet(&shown, title, sources))));
            write
        });
        add(format!("{target}_sheet.png"), sheet)?;
        Ok(files)
    }

    /// Before the first file: what an earlier run left, which would be wrong beside the new pictures, goes.
    fn begin(&mut self) -> Result<(), WriteError> {
        let failed = |cause| WriteError::Io { path: self.folder.clone(), cause };
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        self.lock()?;
        // A journal of this run lists files that stay.
        let stay = self.earlier.iter().map(|earlier| &earlier.target);
        let written: BTreeSet<String> =
            self.target_names.iter().chain(stay).flat_map(|target| files_of(target)).collect();
        let earlier = earlier_files(&self.folder);
        match self.frames.journal() {
            Some(journal) => journal.begin()?,
            None => FrameJournal::remove_any(&self.folder)?,
        }
        earlier.difference(&written).try_for_each(|file| remove_if_there(&self.folder.join(file)))?;
        // What stays is in it: a run that is killed loses nothing of that.
        if self.earlier.is_empty() { remove_if_there(&self.folder.join(RECORD)) } else { Ok(()) }
    }

    /// Ends the videos, once all frames were given, and returns their paths. For before the record.
    ///
    /// # Errors
    /// [`VideoError`].
    pub fn finish_videos(&mut self, progress: &dyn Progress) -> Result<Vec<PathBuf>, VideoError> {
        self.frames.settle()?;
        self.videos.finish(progress)
    }

    /// Writes the record.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn finish(
        self,
        renderer: &dyn Renderer,
        options: &RenderOptions,
        finished: Finished,
        circumstances: Circumstances,
    ) -> Result<RunRecord, WriteError> {
        let Finished { costs, record } = finished;
        let Circumstances { program, device_reason, model, exact, settings, seed, open_time, total_time } =
            circumstances;
        let path = self.folder.join(RECORD);
        let place = |frame: &FrameRecord| self.target_names.iter().position(|name| *name == frame.target);
        let (mut frames, journal) = self.frames.finished()?;
        frames.sort_by_key(place);
        let frame_time = Duration::from_secs_f64(frames.iter().map(|frame| frame.seconds).sum());
        let record = RunRecord {
            viewfuse: program,
            scene: self.scene,
            device: renderer.device_name(),
            device_reason,
            field: renderer.about().name,
            model,
            exact,
            left_out: record.left_out,
            denoising: record.denoising,
            weighting: self.weighting,
            chosen: self.chosen.map(ChosenRecord::from),
            seed,
            size: self.size,
            videos: self.videos.names(),
            background: background_record(options, self.background),
            leave_out: options.leave_out,
            early_termination: options.early_termination,
            warnings: once_each(self.given.into_iter().chain(self.warnings).chain(record.notes)),
            conventions: self.conventions,
            sources: self.source_names,
            memory_estimate: record.memory_estimate,
            near_far: record.near_far.map(|bounds| bounds.map(|depth| self.space.file_length(depth))),
            times: times_record(open_time, costs, frame_time, total_time),
            kernels: kernel_records(&renderer.kernel_times()),
            transfers: renderer.transfers().into(),
            depth_units: DepthUnits::ALL,
            continued: self.continued,
            settings,
            earlier: self.earlier.len(),
            frames: self.earlier.into_iter().chain(frames).collect(),
        };
        let json = serde_json::to_vec_pretty(&record)
            .map_err(|cause| WriteError::Encode { path: path.clone(), cause: cause.into() })?;
        write_whole(&path, &json)?;
        journal.map_or(Ok(()), FrameJournal::remove)?;
        Ok(record)
    }

    /// The first line of a frame's contact sheet.
    fn title(&self, frame: &Frame) -> String {
        format!("{}  target {}  weights {}", self.scene_name, frame.target.name, self.weighting)
    }

    /// The sources on a frame's contact sheet.
    fn sheet_sources(&self, frame: &Frame) -> Vec<SheetSource> {
        let named = self.source_names.iter().zip(&self.source_pictures).enumerate();
        let source = |(index, (name, picture)): (usize, (&String, &Arc<RgbImage>))| SheetSource {
            name: name.clone(),
            weight: frame.omission.weights.get(index as u32),
            picture: Arc::clone(picture),
        };
        named.map(source).collect()
    }
}

/// Writes a file of a frame.
type Writing = Box<dyn FnOnce(&Path) -> Result<(), WriteError> + Send>;

/// The bytes of a frame in memory.
fn bytes_of(frame: &Frame) -> usize {
    let truth = frame.truth.as_ref().map_or(0, |truth| truth.picture.as_raw().len());
    let numbers = size_of_val(&frame.depths[..]) + size_of_val(&frame.confidences[..]);
    size_of_val(&frame.colours[..]) + numbers + frame.picture.as_raw().len() + truth
}

/// The contact sheet of a frame.
fn sheet(frame: &Frame, title: String, sources: Vec<SheetSource>) -> RgbImage {
    let (width, height) = frame.picture.dimensions();
    let empty_as_nan: Vec<f32> = frame.depths.iter().map(|z| if *z > 0.0 { *z } else { f32::NAN }).collect();
    Sheet {
        title,
        sources,
        prediction: frame.picture.clone(),
        depth: (!frame.depths.is_empty()).then(|| depth_picture(&empty_as_nan, width, height)),
        truth: frame.truth.as_ref().map(|truth| (truth.picture.clone(), truth.psnr, truth.ssim)),
    }
    .draw()
}

/// A frame's confidences in steps of 1/255; `None` for fields that do not tell.
pub fn confidence_map(frame: &Frame) -> Option<ImageBuffer<Luma<u8>, Vec<u8>>> {
    if frame.confidences.is_empty() {
        return None;
    }
    let (width, height) = frame.picture.dimensions();
    let confidence = |x: u32, y: u32| Luma([(frame.confidences[(y * width + x) as usize] * 255.0).round() as u8]);
    Some(ImageBuffer::from_fn(width, height, confidence))
}

/// Each warning once: what is told of a scene has its path in front, and is the same without it.
fn once_each(warnings: impl Iterator<Item = String>) -> Vec<String> {
    warnings.fold(Vec::new(), |mut listed: Vec<String>, warning| {
        if !listed.iter().any(|known| known.ends_with(&warning) || warning.ends_with(known)) {
            listed.push(warning);
        }
        listed
    })
}
