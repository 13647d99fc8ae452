//! The run record: the inputs, settings and results of a run, as JSON.

use serde::{Deserialize, Serialize};
use std::time::Duration;
use viewfuse_device::{KernelTime, Transfers};
use viewfuse_field::auto::{Beyond, Calibration, Candidate, Chosen, Expected, HeldOutSource, Pair};
use viewfuse_field::budget::Kept;
use viewfuse_field::render::{Frame, RenderOptions, Seen, StageCosts};
use viewfuse_field::{Denoising, LeftOut, Mixture, Setting};
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::{Scene, SceneFrame};

/// Name of the file.
pub const RECORD: &str = "run.json";

/// What stands behind a target's name in the names of its pictures.
pub const SUFFIXES: [&str; 4] = ["", "_depth", "_confidence", "_sheet"];

/// A run as written to `run.json`. Times are in seconds.
#[derive(Clone, Debug, Serialize)]
pub struct RunRecord {
    /// Version of the program.
    pub viewfuse: &'static str,
    /// The scene's path as given.
    pub scene: String,
    /// The device.
    pub device: String,
    /// The reason for choosing it.
    pub device_reason: String,
    /// The field.
    pub field: &'static str,
    /// The source of its network's parameters; null for the training-free field.
    pub model: Option<String>,
    /// Whether all omissions are switched off.
    pub exact: bool,
    /// The field's omissions, of all frames together.
    pub left_out: Vec<LeftOut>,
    /// The field's diffusion sampling; null for fields without a denoiser.
    pub denoising: Option<Denoising>,
    /// The weighting scheme.
    pub weighting: String,
    /// How the scheme and the field's settings were chosen for the scene; null where they were given.
    pub chosen: Option<ChosenRecord>,
    /// Seed of every random draw. The training-free field makes none.
    pub seed: u64,
    /// Width and height of the last picture.
    pub size: [u32; 2],
    /// Names of the videos.
    pub videos: Vec<String>,
    /// Requested and used background, red green blue in 0..=255.
    pub background: BackgroundRecord,
    /// The largest total weight of views that are left out.
    pub leave_out: f32,
    /// Transmittance of early termination: no channel changes by more than this times its range.
    pub early_termination: f32,
    /// Warnings about the scene and its photographs, and notes of the field and the device.
    pub warnings: Vec<String>,
    /// Conventions of the scene's files that were applied.
    pub conventions: Vec<String>,
    /// Names of the source views.
    pub sources: Vec<String>,
    /// Estimated memory beside photographs and pictures, in bytes; null for fields without an estimate.
    pub memory_estimate: Option<u64>,
    /// Near and far bounds of rays, in units of the scene's files; null for fields without such bounds.
    pub near_far: Option<[f32; 2]>,
    /// Times of the stages that all frames share.
    pub times: TimesRecord,
    /// Times of the kernels, for devices with timestamps.
    pub kernels: Vec<KernelRecord>,
    /// Transfers between host and device; zeros for devices whose memory is the host's.
    pub transfers: TransfersRecord,
    /// What the numbers of depth maps mean.
    pub depth_units: DepthUnits,
    /// Frames that were there already when an interrupted run was continued.
    pub continued: usize,
    /// A digest of all that the frames depend on but their targets: the program, the options, the device, the scene's
    /// files, the sources, other files. A run of the same digest may add frames. Null where frames follow from one
    /// another.
    pub settings: Option<String>,
    /// Frames of earlier runs of the same settings, which come first; times, omissions, kernels and transfers are the
    /// last run's.
    pub earlier: usize,
    /// One entry a target.
    pub frames: Vec<FrameRecord>,
}

/// See [`RunRecord::depth_units`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthUnits {
    /// What a depth is.
    pub depth: &'static str,
    /// What PNG files hold.
    pub png: &'static str,
    /// What EXR and npy files hold.
    pub exr_npy: &'static str,
}

impl DepthUnits {
    /// Of all depth maps.
    pub const ALL: DepthUnits = DepthUnits {
        depth: "distance along the camera's principal axis, in units of the scene's files; 0: no surface",
        png: "16 bit; times the frame's depth_step",
        exr_npy: "32-bit floating point",
    };
}

/// See [`RunRecord::chosen`].
#[derive(Clone, Debug, Serialize)]
pub struct ChosenRecord {
    /// The field's scalars that are not at their defaults.
    pub settings: Vec<Setting>,
    /// Pictures under other settings that are mixed in place of one under these, with the constants of their shares
    /// (the module `mixture` of `viewfuse-field`); null where one picture is not worse.
    pub mixture: Option<Mixture>,
    /// All schemes and settings that were tried, with the mean score of the sources that were left out.
    pub candidates: Vec<Candidate>,
    /// The sources that were left out, each rendered coarsely from the others with what was chosen.
    pub left_out: Vec<HeldOutSource>,
    /// What confidences mean: the root mean square error, as a share of a colour's range, that pixels of a confidence
    /// have in those pictures; null for fields without confidences. In a frame it is this times
    /// `expected.pixels.scale`.
    pub calibration: Option<Calibration>,
    /// What two sources are good for, of which none could be left out; null otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pair: Option<Pair>,
}

impl From<Chosen> for ChosenRecord {
    fn from(chosen: Chosen) -> ChosenRecord {
        let Chosen { options, mixture, candidates, held_out, calibration, pair, .. } = chosen;
        let settings = options.settings().to_vec();
        ChosenRecord { settings, mixture, candidates, left_out: held_out, calibration, pair }
    }
}

/// See [`RunRecord::background`].
#[derive(Clone, Debug, Serialize)]
pub struct BackgroundRecord {
    /// As requested.
    pub asked: String,
    /// As used.
    pub used: [u8; 3],
}

/// See [`RunRecord::times`].
#[derive(Clone, Debug, Serialize)]
pub struct TimesRecord {
    /// Reading the scene.
    pub open: f64,
    /// Removing backgrounds and resampling.
    pub photographs: f64,
    /// Taking the photographs to the device and finding the object.
    pub prepare: f64,
    /// Encoding the sources.
    pub encode: f64,
    /// All frames together, comparison with the ground truth included.
    pub frames: f64,
    /// The whole run, writing the pictures included.
    pub total: f64,
}

/// See [`RunRecord::kernels`].
#[derive(Clone, Debug, Serialize)]
pub struct KernelRecord {
    /// Its name.
    pub kernel: &'static str,
    /// How many times it was dispatched.
    pub dispatches: u64,
    /// How many elements it computed.
    pub elements: u64,
    /// Its time on the device.
    pub seconds: f64,
    /// Its share of the time of all kernels.
    pub share: f64,
}

/// See [`RunRecord::transfers`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct TransfersRecord {
    /// Arrays that were uploaded.
    pub uploads: u64,
    /// Their bytes.
    pub uploaded_bytes: u64,
    /// Arrays that were downloaded.
    pub downloads: u64,
    /// Their bytes.
    pub downloaded_bytes: u64,
}

impl From<Transfers> for TransfersRecord {
    fn from(transfers: Transfers) -> TransfersRecord {
        let Transfers { uploads, uploaded_bytes, downloads, downloaded_bytes } = transfers;
        TransfersRecord { uploads, uploaded_bytes, downloads, downloaded_bytes }
    }
}

/// Times of the kernels.
pub fn kernel_records(times: &[KernelTime]) -> Vec<KernelRecord> {
    let all: f64 = times.iter().map(|time| time.time.as_secs_f64()).sum();
    let record = |time: &KernelTime| {
        let seconds = time.time.as_secs_f64();
        let share = if all > 0.0 { seconds / all } else { 0.0 };
        KernelRecord { kernel: time.kernel, dispatches: time.dispatches, elements: time.elements, seconds, share }
    };
    times.iter().map(record).collect()
}

/// One target.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrameRecord {
    /// The target's name.
    pub target: String,
    /// Its camera-to-world matrix in the coordinates of the scene's files, OpenCV axes, row-major.
    pub world_from_camera: [[f64; 4]; 4],
    /// Width and height of its picture.
    #[serde(default)]
    pub size: [u32; 2],
    /// Names of its files; none of a picture that a page shows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// Weight of each source as used, in the order of `sources`; 0 where it was left out.
    pub weights: Vec<f32>,
    /// Weights before views were left out.
    pub weights_before: Vec<f32>,
    /// Names of the sources that were left out.
    pub left_out: Vec<String>,
    /// Share of its surfaces that a photograph of a source shows from within 30 degrees, whatever stands before them;
    /// of a field without depths, of points as far away as what the sources look at.
    #[serde(default)]
    pub seen: f32,
    /// What share of its surfaces few photographs show, by the depths that the field found; null for fields without
    /// depths.
    #[serde(default)]
    pub seen_by: Option<Seen>,
    /// Mean share of each part of the mixture in the picture, the rest that of the picture under the chosen settings;
    /// empty without a mixture.
    #[serde(default)]
    pub shares: Vec<f32>,
    /// Sum of their weights: a bound on the change of a fusion of all views by leaving them out, as a share of the
    /// range of its inputs.
    pub left_out_weight: f32,
    /// Peak signal to noise ratio against the ground truth, decibels; null for equal pictures or without a ground
    /// truth.
    pub psnr: Option<f64>,
    /// The same after a gain and an offset of each channel were fitted to the truth: without the price of the camera's
    /// exposure. Null as `psnr`, and in records of older versions.
    #[serde(default)]
    pub corrected_psnr: Option<f64>,
    /// The score to expect without a ground truth; null where the scheme was given, with too few sources, and `beyond`
    /// what is known.
    pub expected: Option<Expected>,
    /// Why no score is expected although photographs were left out: how many times as far from the sources as the
    /// farthest of those the camera is, or the share of the picture that no photograph shows; null where a score is
    /// expected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beyond: Option<Beyond>,
    /// Structural similarity with the ground truth.
    pub ssim: Option<f64>,
    /// Depth in one step of the 16-bit depth map, in units of the scene's files; 0 in the map means no surface. Null
    /// for fields without depths.
    pub depth_step: Option<f32>,
    /// Time for this frame alone.
    pub seconds: f64,
    /// The part of it for encoding sources that no earlier frame used.
    pub encode_seconds: f64,
    /// How it keeps the bound on its error or its time; null without a bound.
    #[serde(default)]
    pub kept: Option<Kept>,
}

impl FrameRecord {
    /// The same with what is expected of the frame by what was chosen.
    #[must_use]
    pub fn expecting(self, chosen: Option<&Chosen>, frame: &Frame) -> FrameRecord {
        let expected = chosen.and_then(|chosen| chosen.expected(frame));
        FrameRecord { expected, beyond: chosen.and_then(|chosen| chosen.beyond(frame)), ..self }
    }

    /// The record of a frame whose sources have these names and this coverage; `space` is the scene's frame.
    pub fn of(frame: &Frame, source_names: &[String], coverage: &Coverage, space: &SceneFrame) -> FrameRecord {
        let count = source_names.len();
        let used = &frame.omission.weights.values()[..count];
        let before = &frame.weights.values()[..count];
        FrameRecord {
            target: frame.target.name.clone(),
            world_from_camera: space.file_from_camera(&frame.target.camera.pose),
            size: frame.picture.dimensions().into(),
            files: Vec::new(),
            weights: used.to_vec(),
            weights_before: before.to_vec(),
            left_out: source_names
                .iter()
                .zip(used.iter().zip(before))
                .filter(|(_, (used, before))| **used == 0.0 && **before > 0.0)
                .map(|(name, _)| name.clone())
                .collect(),
            seen: coverage.seen_in(
                &frame.target.camera,
                frame.picture.dimensions().into(),
                &frame.depths,
                frame.counts_gaps,
            ),
            seen_by: frame.seen,
            shares: frame.shares.clone(),
            left_out_weight: frame.omission.omitted_weight,
            psnr: frame.truth.as_ref().map(|truth| truth.psnr).filter(|psnr| psnr.is_finite()),
            corrected_psnr: frame.truth.as_ref().map(|truth| truth.corrected_psnr).filter(|psnr| psnr.is_finite()),
            expected: None,
            beyond: None,
            ssim: frame.truth.as_ref().and_then(|truth| truth.ssim),
            depth_step: (!frame.depths.is_empty()).then(|| space.file_length(depth_step(&frame.depths))),
            seconds: frame.time.as_secs_f64(),
            encode_seconds: frame.encode.as_secs_f64(),
            kept: frame.kept.clone(),
        }
    }
}

/// Names of views of a scene.
pub fn view_names(scene: &Scene, views: &[usize]) -> Vec<String> {
    views.iter().map(|&view| scene.views[view].name.clone()).collect()
}

/// The times of the stages that frames share, with those that the caller measured.
pub fn times_record(open: Duration, stages: StageCosts, frames: Duration, total: Duration) -> TimesRecord {
    TimesRecord {
        open: open.as_secs_f64(),
        photographs: stages.photographs.as_secs_f64(),
        prepare: stages.prepare.as_secs_f64(),
        encode: stages.encode.as_secs_f64(),
        frames: frames.as_secs_f64(),
        total: total.as_secs_f64(),
    }
}

/// The background of a run.
pub fn background_record(options: &RenderOptions, used: [f32; 3]) -> BackgroundRecord {
    BackgroundRecord { asked: options.background.to_string(), used: used.map(|value| (value * 255.0).round() as u8) }
}

/// World units of one step of a 16-bit map of these depths.
pub fn depth_step(depths: &[f32]) -> f32 {
    let farthest = depths.iter().copied().fold(0.0, f32::max);
    if farthest > 0.0 { farthest / f32::from(u16::MAX) } else { 1.0 }
}
