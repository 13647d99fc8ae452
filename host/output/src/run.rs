//! The output folder of a run: `NAME.png`, `NAME_depth.png` (16 bit), `NAME_confidence.png` (8 bit) and `NAME_sheet.png` for
//! each target, and `run.json`.

use crate::png::write_png;
use crate::record::{
    ChosenRecord, FrameRecord, RunRecord, background_record, depth_step, kernel_records, source_names, times_record,
};
use crate::sheet::{Sheet, SheetSource, depth_picture};
use image::{DynamicImage, ImageBuffer, Luma, RgbImage};
use std::path::{Path, PathBuf};
use std::time::Duration;
use viewfuse_field::Renderer;
use viewfuse_field::auto::Chosen;
use viewfuse_field::render::{Finished, Frame, RenderOptions};
use viewfuse_job::files::{WriteError, remove_if_there, write_whole};
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{Scene, SceneFrame};
use viewfuse_weighting::Weighting;

/// Name of the run record.
pub const RECORD: &str = "run.json";

/// What stands behind a target's name in the names of its pictures.
pub const SUFFIXES: [&str; 4] = ["", "_depth", "_confidence", "_sheet"];

/// Writes a run's frames one by one, and the record after the last.
pub struct RunWriter {
    folder: PathBuf,
    /// The scene's path as it was opened.
    scene: String,
    /// The last part of it.
    scene_name: String,
    /// The scene's frame: what is recorded is in the coordinates of its files.
    space: SceneFrame,
    weighting: String,
    source_names: Vec<String>,
    frames: Vec<FrameRecord>,
    frame_time: Duration,
    size: [u32; 2],
    background: [f32; 3],
    warning: Option<String>,
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
            folder: folder.to_path_buf(),
            scene: scene_label,
            scene_name: scene.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            space: scene.frame,
            weighting: weighting.to_string(),
            source_names: source_names(scene, job),
            frames: Vec::new(),
            frame_time: Duration::ZERO,
            size: [0, 0],
            background: [0.0; 3],
            warning: None,
            chosen: None,
        }
    }

    /// The frames that follow are of a scheme and settings that were chosen for the scene: they replace the weighting, and each
    /// frame gets the score to expect.
    pub fn set_chosen(&mut self, chosen: &Chosen) {
        if self.chosen.is_none() {
            self.weighting = chosen.weighting.to_string();
            self.chosen = Some(chosen.clone());
        }
    }

    /// Writes a frame's pictures. With the first one, the record of an earlier run is removed: it would be wrong for
    /// the new pictures.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&mut self, sources: &SourceImages, frame: &Frame) -> Result<(), WriteError> {
        if self.frames.is_empty() {
            remove_if_there(&self.folder.join(RECORD))?;
        }
        let name = &frame.target.name;
        write_png(&self.file(name, ""), &DynamicImage::ImageRgb8(frame.picture.clone()))?;
        match depth_map(frame) {
            Some(map) => write_png(&self.file(name, "_depth"), &DynamicImage::ImageLuma16(map))?,
            // One of an earlier run would belong to another picture.
            None => remove_if_there(&self.file(name, "_depth"))?,
        }
        match confidence_map(frame) {
            Some(map) => write_png(&self.file(name, "_confidence"), &DynamicImage::ImageLuma8(map))?,
            None => remove_if_there(&self.file(name, "_confidence"))?,
        }
        write_png(&self.file(name, "_sheet"), &DynamicImage::ImageRgb8(self.sheet(sources, frame)))?;
        self.frame_time += frame.time;
        self.size = [frame.picture.width(), frame.picture.height()];
        self.background = sources.background;
        self.warning.clone_from(&sources.warning);
        let expected = self.chosen.as_ref().and_then(|chosen| chosen.expected(frame));
        self.frames.push(FrameRecord { expected, ..FrameRecord::of(frame, &self.source_names, &self.space) });
        Ok(())
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
        let Circumstances { program, device_reason, model, exact, seed, open_time, total_time } = circumstances;
        let path = self.folder.join(RECORD);
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
            background: background_record(options, self.background),
            leave_out: options.leave_out,
            early_termination: options.early_termination,
            warnings: self.warning.into_iter().collect(),
            sources: self.source_names,
            memory_estimate: record.memory_estimate,
            near_far: record.near_far.map(|bounds| bounds.map(|depth| self.space.file_length(depth))),
            times: times_record(open_time, costs, self.frame_time, total_time),
            kernels: kernel_records(&renderer.kernel_times()),
            transfers: renderer.transfers().into(),
            frames: self.frames,
        };
        let json = serde_json::to_vec_pretty(&record)
            .map_err(|cause| WriteError::Encode { path: path.clone(), cause: cause.into() })?;
        write_whole(&path, &json)?;
        Ok(record)
    }

    fn file(&self, target: &str, what: &str) -> PathBuf {
        self.folder.join(format!("{target}{what}.png"))
    }

    /// The contact sheet of a frame.
    fn sheet(&self, sources: &SourceImages, frame: &Frame) -> RgbImage {
        let (width, height) = frame.picture.dimensions();
        let source = |(index, name): (usize, &String)| SheetSource {
            name: name.clone(),
            weight: frame.omission.weights.get(index as u32),
            picture: sources.picture(index),
        };
        let empty_as_nan: Vec<f32> = frame.depths.iter().map(|z| if *z > 0.0 { *z } else { f32::NAN }).collect();
        Sheet {
            title: format!("{}  target {}  weights {}", self.scene_name, frame.target.name, self.weighting),
            sources: self.source_names.iter().enumerate().map(source).collect(),
            prediction: frame.picture.clone(),
            depth: (!frame.depths.is_empty()).then(|| depth_picture(&empty_as_nan, width, height)),
            truth: frame.truth.as_ref().map(|truth| (truth.picture.clone(), truth.psnr, truth.ssim)),
        }
        .draw()
    }
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

/// A frame's depths in steps of [`depth_step`]; `None` for fields without depths.
pub fn depth_map(frame: &Frame) -> Option<ImageBuffer<Luma<u16>, Vec<u16>>> {
    if frame.depths.is_empty() {
        return None;
    }
    let (width, height) = frame.picture.dimensions();
    let step = depth_step(&frame.depths);
    let depth = |x: u32, y: u32| Luma([(frame.depths[(y * width + x) as usize] / step).round() as u16]);
    Some(ImageBuffer::from_fn(width, height, depth))
}
