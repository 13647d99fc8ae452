//! `viewfuse verify`.

use super::options::DeviceOptions;
use super::printing::{complain, say};
use super::table::table;
use super::terminal::Terminal;
use super::wrong::wrong;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_check::verify::{Measure, Report, verify};
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_job::progress::{Part, Progress};

#[derive(Args)]
#[command(after_help = "Example:\n  \
    viewfuse verify tests/data/weighting.json tests/data/metrics/reference.safetensors\n\n\
    Exit code 1 if a tolerance is exceeded.")]
pub(crate) struct Arguments {
    /// Files of reference values: of weighting schemes and attention, metrics, PixelNeRF or GeNVS; the repository has
    /// some in tests/data
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    if let Some(folder) = arguments.files.iter().find(|path| path.is_dir()) {
        return Err(wrong(format_args!("{}: is a folder; give files of reference values", folder.display())));
    }
    let Chosen { device, .. } = arguments.device.open()?;
    let mut all_pass = true;
    let mut unread = Vec::new();
    let (terminal, count) = (Terminal::new("verifying"), arguments.files.len());
    for (index, path) in arguments.files.iter().enumerate() {
        let progress = Part::begin(&terminal, path.display().to_string(), index..index + 1, count);
        let report = match &device {
            AnyDevice::Cpu(cpu) => verify(path, cpu, &progress),
            AnyDevice::Vulkan(vulkan) => verify(path, vulkan.as_ref(), &progress),
        };
        // The error of a cancelled comparison is the cancellation.
        progress.check()?;
        match report {
            Ok(report) => {
                terminal.aside(|| print_report(&report))?;
                all_pass &= report.passes();
            }
            Err(error) => unread.push(error),
        }
    }
    drop(terminal);
    // The others were compared all the same.
    if let Some(last) = unread.pop() {
        unread.into_iter().for_each(complain);
        return Err(last.into());
    }
    Ok(if all_pass { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn print_report(report: &Report) -> std::io::Result<()> {
    let header = ["quantity", "numbers", "worst error", "", "tolerance", "", "at"];
    let mut rows = table(header.map(str::to_owned));
    for quantity in &report.quantities {
        rows.add_row([
            quantity.name.clone(),
            quantity.count.to_string(),
            format!("{:.2e}", quantity.worst),
            match quantity.measure {
                Measure::Absolute => "absolute".to_owned(),
                Measure::Relative => "relative".to_owned(),
            },
            format!("{:.1e}", quantity.tolerance),
            if quantity.passes() { "ok".to_owned() } else { "EXCEEDED".to_owned() },
            quantity.place.clone(),
        ]);
    }
    say(format_args!("{}", report.path.display()))?;
    say(format_args!("{rows}"))?;
    if !report.not_covered.is_empty() {
        say(format_args!("not computed by this version: {}", report.not_covered.join(", ")))?;
    }
    let failed = report.quantities.iter().filter(|quantity| !quantity.passes()).count();
    say(format_args!(
        "{} of {} quantities within tolerance\n",
        report.quantities.len() - failed,
        report.quantities.len()
    ))
}
