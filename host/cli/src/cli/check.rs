//! `viewfuse check`.

use super::environment::device_options;
use super::printing::say;
use super::table::table;
use super::terminal::Terminal;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_check::case::SIZES;
use viewfuse_check::measure::{DEFAULT_SEED_COUNT, Role};
use viewfuse_check::picture::Picture;
use viewfuse_check::report::{PictureVersusCpu, VersusCpu};
use viewfuse_check::{CheckError, DeviceReport, KernelReport, PictureReport, Report, check_device};
use viewfuse_device::choice::{AnyDevice, DeviceChoice, Several, open_several};
use viewfuse_field::AnyField;
use viewfuse_job::progress::Part;
use viewfuse_vulkan::GpuOptions;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse check\n  viewfuse check --device cpu --seeds 16 --json\n\n\
    Exit code 1 if a tolerance is exceeded or a device fails.")]
pub(crate) struct Arguments {
    /// Check this device: cpu, vulkan, vulkan:NUMBER or vulkan:NAME; may be given several times [default: all]
    #[arg(long, value_name = "DEVICE")]
    device: Vec<DeviceChoice>,
    /// Check each kernel with this many seeds
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SEED_COUNT,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// Scene whose last view is rendered on each device [default: a synthetic one]
    #[arg(long, value_name = "PATH")]
    scene: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let Several { devices, notes, failures } = open_several(&arguments.device, &device_options(GpuOptions::default()))?;
    let mut report = Report {
        viewfuse: env!("CARGO_PKG_VERSION"),
        seed_count: arguments.seeds,
        sizes: SIZES.to_vec(),
        devices: Vec::new(),
        failures,
        notes,
    };
    // The kernels of a device take most of the time.
    let (progress, parts) = (Terminal::new("checking"), 1 + 10 * devices.len());
    let picture = Picture::new(arguments.scene.as_deref(), &Part::begin(&progress, "picture", 0..1, parts))?;
    for (index, device) in devices.into_iter().enumerate() {
        let (name, first) = (device.name(), 1 + 10 * index);
        let part = Part::begin(&progress, name.clone(), first..first + 9, parts);
        let checked = match &device {
            AnyDevice::Cpu(cpu) => check_device(cpu, Role::Reference, arguments.seeds, &part),
            AnyDevice::Vulkan(vulkan) => check_device(vulkan.as_ref(), Role::Other, arguments.seeds, &part),
        };
        let role = if matches!(device, AnyDevice::Cpu(_)) { Role::Reference } else { Role::Other };
        let checked = checked.and_then(|kernels| {
            let part = Part::begin(&progress, format!("{name}: picture"), first + 9..first + 10, parts);
            let picture = picture.check(AnyField::default().on(&device).as_ref(), role, &part)?;
            Ok(DeviceReport { picture: Some(picture), ..kernels })
        });
        match checked {
            Ok(checked) => report.devices.push(checked),
            Err(error @ CheckError::Interrupted(_)) => return Err(error.into()),
            // The results of the other devices are kept if one fails.
            Err(error) => report.failures.push(format!("{}: {:#}", device.name(), anyhow::Error::from(error))),
        }
    }
    drop(progress);
    if arguments.json {
        say(serde_json::to_string_pretty(&report)?)?;
    } else {
        report.devices.iter().try_for_each(print_device)?;
        print_reasons(&report)?;
        report.notes.iter().try_for_each(say)?;
        report.failures.iter().try_for_each(|failure| say(format_args!("FAILED: {failure}")))?;
    }
    Ok(ExitCode::from(report.exit_code()))
}

fn print_device(report: &DeviceReport) -> std::io::Result<()> {
    say(&report.device)?;
    // Only the CPU has no column for the CPU.
    let has_cpu = report.kernels.iter().any(|kernel| kernel.versus_cpu.is_some());
    let mut header = vec!["kernel", "numbers", "undecided", "absolute", "relative", "ULP", "of bound", "bound"];
    header.extend(if has_cpu { &["from CPU", "ULP", "same bits"][..] } else { &[] });
    header.extend(["ns/element", ""]);
    let mut rows = table(header.into_iter().map(str::to_owned));
    for kernel in &report.kernels {
        rows.add_row(row(kernel, has_cpu));
    }
    say(rows)?;
    for kernel in &report.kernels {
        if let Some(breach) = &kernel.breach {
            say(format_args!("{}: {breach}", kernel.kernel))?;
        }
    }
    report.picture.iter().try_for_each(print_picture)?;
    let breaches = report.breaches();
    if breaches.is_empty() {
        say("everything within tolerance\n")
    } else {
        say(format_args!("tolerance exceeded: {}\n", breaches.join(", ")))
    }
}

fn row(kernel: &KernelReport, has_cpu: bool) -> Vec<String> {
    let mut row = vec![
        kernel.kernel.to_owned(),
        kernel.compared.to_string(),
        format!("{:.2} %", 100.0 * kernel.undecided),
        format!("{:.1e}", kernel.absolute),
        format!("{:.1e}", kernel.relative),
        format!("{:.1}", kernel.ulps),
        format!("{:.0} %", 100.0 * kernel.of_bound),
        format!("{:.1e}", kernel.tolerance),
    ];
    match kernel.versus_cpu {
        Some(VersusCpu { absolute, ulps, equal }) => {
            row.extend([format!("{absolute:.1e}"), format!("{ulps:.1}"), format!("{:.1} %", 100.0 * equal)]);
        }
        None if has_cpu => row.extend(["", "", ""].map(str::to_owned)),
        None => {}
    }
    row.push(format!("{:.1}", kernel.nanoseconds_per_element));
    row.push(if kernel.breach.is_none() { "ok" } else { "EXCEEDED" }.to_owned());
    row
}

fn print_picture(picture: &PictureReport) -> std::io::Result<()> {
    let PictureReport { scene, target, source_count, size: [width, height], seconds, .. } = picture;
    say(format_args!(
        "picture: {scene}, view {target} from {source_count} others at {width}x{height}: {seconds:.2} s"
    ))?;
    if let Some(PictureVersusCpu { worst, differing, psnr }) = picture.versus_cpu {
        let psnr = psnr.map_or_else(|| "equal".to_owned(), |psnr| format!("PSNR {psnr:.1} dB"));
        say(format_args!("against the CPU's: worst pixel {worst}/255, {differing} pixels differ, {psnr}"))?;
    }
    picture.breach.iter().try_for_each(|breach| say(format_args!("picture: {breach}")))
}

/// The derivation of the bounds is the same for all devices.
fn print_reasons(report: &Report) -> std::io::Result<()> {
    let Some(device) = report.devices.first() else { return Ok(()) };
    say("Differences are against f64; relative ones and ULP only for numbers above a least size. Bounds:")?;
    device.kernels.iter().try_for_each(|kernel| say(format_args!("  {}: {}", kernel.kernel, kernel.reason)))
}
