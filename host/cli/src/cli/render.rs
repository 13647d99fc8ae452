//! `viewfuse render`.

use super::model::{GENVS, ModelOptions, Work, parse_level};
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::parse::parse_count;
use super::terminal::Terminal;
use super::weighting::one_help;
use super::{on_threads, say};
use clap::Args;
use image::{DynamicImage, ImageBuffer, Luma, RgbImage};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use viewfuse_device::Device;
use viewfuse_device::choice::Chosen;
use viewfuse_field::Field;
use viewfuse_field::render::{Frame, RenderOptions, render};
use viewfuse_job::files::{check_writable, remove_if_there, write_whole};
use viewfuse_output::png::write_png;
use viewfuse_output::record::{
    FrameRecord, RunRecord, background_record, depth_step, kernel_records, source_names, times_record,
};
use viewfuse_output::sheet::{Sheet, SheetSource, depth_picture};
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{READERS, Scene, looked_for};
use viewfuse_weighting::{Weighting, WeightingSpec};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse render photos/ --orbit 24 -o out\n      24 views on a circle around what the cameras look at\n  \
    viewfuse render dino/ --targets 1,4,7 --size 160x120 -o out\n      views 1, 4 and 7 from the other thirteen, with the error\n  \
    viewfuse render car/ --targets 5 --sources all/3 --weights mean -o out\n      view 5 from every third view, averaged instead of weighted\n\n\
    Writes NAME.png, NAME_depth.png (16 bit; scale in run.json; none with a GeNVS), NAME_sheet.png for each target, and \
    run.json.")]
pub(crate) struct Arguments {
    #[arg(help = scene_help())]
    scene: PathBuf,
    /// Views to render, as for --sources; left out of the sources [default: the scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    /// Render this many views on a circle around the object
    #[arg(long, value_name = "N", value_parser = parse_count)]
    orbit: Option<usize>,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", default_value_t, help = one_help())]
    weights: WeightingSpec,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    model: ModelOptions,
    /// Start each frame from the one before, with noise of this level, as large as what may be different: for orbits
    #[arg(long, value_name = "LEVEL", value_parser = parse_level, requires = "model", conflicts_with = "exact", help_heading = GENVS)]
    reuse: Option<f32>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random number (the field that needs no network draws none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

fn scene_help() -> String {
    format!("The scene: {}", looked_for(&READERS))
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let weighting = arguments.weights.open()?;
    let scene = Scene::open(&arguments.scene)?;
    let open_time = start.elapsed();
    let field = arguments.model.open(arguments.seed, arguments.reuse)?;
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.orbit);
    let job = selection.resolve(&scene, field.least_sources())?;
    let options = arguments.picture.to_render_options(arguments.model.exact, &field)?;
    check_writable(&arguments.output.join("run.json"))?;
    let Chosen { device, reason } = arguments.device.open()?;
    let (scene, job, weighting, options) = (&scene, &job, &weighting, &options);
    let run = Run { arguments, scene, job, weighting, options, device_reason: reason, start, open_time };
    on_threads(arguments.picture.threads, || field.on(&device, &run))??;
    Ok(ExitCode::SUCCESS)
}

struct Run<'a> {
    arguments: &'a Arguments,
    scene: &'a Scene,
    job: &'a FewShot,
    weighting: &'a Weighting,
    options: &'a RenderOptions,
    device_reason: String,
    start: Instant,
    open_time: Duration,
}

impl Work for Run<'_> {
    type Output = anyhow::Result<()>;

    fn run<D: Device, F: Field<D>>(&self, device: &D, field: &F) -> anyhow::Result<()> {
        let names = source_names(self.scene, self.job);
        // An old record beside new pictures would lie: it goes before the first of them appears.
        let record_path = self.arguments.output.join("run.json");
        let progress = Terminal::new("rendering");
        let mut frames = Vec::new();
        let mut frame_time = Duration::ZERO;
        let (mut size, mut background, mut warning) = ([0, 0], [0.0; 3], None);
        let stages = render(
            self.scene,
            self.job,
            self.weighting,
            device,
            field,
            self.options,
            &progress,
            |sources, frame| -> anyhow::Result<()> {
                frame_time += frame.time;
                size = [frame.picture.width(), frame.picture.height()];
                background = sources.background;
                warning.clone_from(&sources.warning);
                if frames.is_empty() {
                    remove_if_there(&record_path)?;
                }
                self.write(sources, &names, &frame)?;
                frames.push(FrameRecord::of(&frame, &names));
                Ok(())
            },
        )?;
        drop(progress);
        let record = RunRecord {
            viewfuse: env!("CARGO_PKG_VERSION"),
            scene: self.arguments.scene.display().to_string(),
            device: device.name(),
            device_reason: self.device_reason.clone(),
            field: field.name(),
            model: self.arguments.model.label(),
            exact: self.arguments.model.exact,
            left_out: field.left_out(),
            denoising: field.denoising(),
            weighting: self.weighting.to_string(),
            seed: self.arguments.seed,
            size,
            background: background_record(self.options, background),
            leave_out: self.options.leave_out,
            settled: self.options.settled,
            warnings: warning.into_iter().collect(),
            sources: names,
            memory_estimate: stages.memory_estimate,
            times: times_record(self.open_time, stages, frame_time, self.start.elapsed()),
            kernels: kernel_records(&device.kernel_times()),
            frames,
        };
        write_whole(&record_path, &serde_json::to_vec_pretty(&record)?)?;
        for frame in &record.frames {
            say(format_args!("{}", summary(frame, &self.arguments.output)))?;
        }
        say(format_args!(
            "{} from {} sources, {}, {} on {}: {:.2} s",
            if record.frames.len() == 1 { "1 view".to_owned() } else { format!("{} views", record.frames.len()) },
            record.sources.len(),
            record.weighting,
            record.field,
            record.device,
            record.times.total
        ))?;
        if let Some(largest) = record.kernels.iter().max_by(|a, b| a.share.total_cmp(&b.share)) {
            let seconds: f64 = record.kernels.iter().map(|kernel| kernel.seconds).sum();
            let (name, share) = (largest.kernel, 100.0 * largest.share);
            say(format_args!("kernels took {seconds:.2} s, {share:.0} % of it {name}; all in run.json"))?;
        }
        say(format_args!("device: {}, {}", record.device, self.device_reason))?;
        Ok(())
    }
}

impl Run<'_> {
    /// Writes a frame's pictures.
    fn write(&self, sources: &SourceImages, names: &[String], frame: &Frame) -> anyhow::Result<()> {
        let folder = &self.arguments.output;
        let name = &frame.target.name;
        let (width, height) = frame.picture.dimensions();
        write_png(&folder.join(format!("{name}.png")), &DynamicImage::ImageRgb8(frame.picture.clone()))?;
        let depth_path = folder.join(format!("{name}_depth.png"));
        if frame.depths.is_empty() {
            // One of an earlier run would belong to another picture.
            remove_if_there(&depth_path)?;
        } else {
            let depth_step = depth_step(&frame.depths);
            let depth_map: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(width, height, |x, y| {
                Luma([(frame.depths[(y * width + x) as usize] / depth_step).round() as u16])
            });
            write_png(&depth_path, &DynamicImage::ImageLuma16(depth_map))?;
        }
        let sheet = self.sheet(sources, names, frame);
        write_png(&folder.join(format!("{name}_sheet.png")), &DynamicImage::ImageRgb8(sheet))?;
        Ok(())
    }

    fn sheet(&self, sources: &SourceImages, names: &[String], frame: &Frame) -> RgbImage {
        let (width, height) = frame.picture.dimensions();
        let source = |(index, name): (usize, &String)| SheetSource {
            name: name.clone(),
            weight: frame.omission.weights.get(index as u32),
            picture: sources.picture(index),
        };
        let empty_as_nan: Vec<f32> = frame.depths.iter().map(|z| if *z > 0.0 { *z } else { f32::NAN }).collect();
        let scene = self.scene.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Sheet {
            title: format!("{scene}  target {}  weights {}", frame.target.name, self.weighting),
            sources: names.iter().enumerate().map(source).collect(),
            prediction: frame.picture.clone(),
            depth: (!frame.depths.is_empty()).then(|| depth_picture(&empty_as_nan, width, height)),
            truth: frame.truth.as_ref().map(|truth| (truth.picture.clone(), truth.psnr, truth.ssim)),
        }
        .draw()
    }
}

fn summary(frame: &FrameRecord, folder: &Path) -> String {
    let score = match (frame.psnr, frame.ssim) {
        (Some(psnr), Some(ssim)) => format!("  PSNR {psnr:.2} dB  SSIM {ssim:.3}"),
        (Some(psnr), None) => format!("  PSNR {psnr:.2} dB"),
        _ => String::new(),
    };
    let left_out = match frame.left_out.len() {
        0 => String::new(),
        1 => format!("  1 source left out (weight {:.4})", frame.left_out_weight),
        count => format!("  {count} sources left out (weight {:.4})", frame.left_out_weight),
    };
    format!("{}{score}{left_out}", folder.join(format!("{}.png", frame.target)).display())
}
