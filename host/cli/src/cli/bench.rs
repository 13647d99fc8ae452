//! `viewfuse bench`.

use super::environment::device_options;
use super::printing::say;
use super::table::table;
use super::terminal::Terminal;
use clap::Args;
use serde::Serialize;
use std::process::ExitCode;
use viewfuse_check::CheckError;
use viewfuse_check::rates::{DEFAULT_ROUNDS, DeviceRates, KernelRate, Limit, measure_rates};
use viewfuse_device::choice::{AnyDevice, DeviceChoice, Several, open_several};
use viewfuse_job::progress::Part;
use viewfuse_vulkan::GpuOptions;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse bench\n  viewfuse bench --device vulkan --json > bench.json\n\n\
    A share is the time that the device's own limits allow over the time that a kernel took; it is above 100 % where a \
    convolution takes fewer operations than its definition, where a processor adds the census in whole numbers of 16 \
    bits, and where arrays stay in its caches.\n\nExit code 1 if a device fails.")]
pub(crate) struct Arguments {
    /// Measure this device: cpu, vulkan, vulkan:NUMBER or vulkan:NAME; may be given several times [default: all]
    #[arg(long, value_name = "DEVICE")]
    device: Vec<DeviceChoice>,
    /// Measure everything so many times, in turns; the medians are printed
    #[arg(long, value_name = "N", default_value_t = DEFAULT_ROUNDS,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// All devices.
#[derive(Serialize)]
struct Bench {
    /// Version of the program.
    viewfuse: &'static str,
    devices: Vec<DeviceRates>,
    /// Devices that failed, with the error.
    failures: Vec<String>,
    /// Devices that were left aside, with the reason.
    notes: Vec<String>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let progress = Terminal::new("measuring");
    let Several { devices, notes, failures } = open_several(&arguments.device, &device_options(GpuOptions::default()))?;
    let mut bench = Bench { viewfuse: env!("CARGO_PKG_VERSION"), devices: Vec::new(), failures, notes };
    let count = devices.len();
    for (index, device) in devices.into_iter().enumerate() {
        let progress = Part::begin(&progress, device.name(), index..index + 1, count);
        let measured = match &device {
            AnyDevice::Cpu(cpu) => measure_rates(cpu, arguments.rounds, &progress),
            AnyDevice::Vulkan(vulkan) => measure_rates(vulkan.as_ref(), arguments.rounds, &progress),
        };
        match measured {
            Ok(rates) => bench.devices.push(rates),
            Err(error @ CheckError::Interrupted(_)) => return Err(error.into()),
            // The results of the other devices are kept if one fails.
            Err(error) => bench.failures.push(format!("{}: {:#}", device.name(), anyhow::Error::from(error))),
        }
    }
    drop(progress);
    if arguments.json {
        say(serde_json::to_string_pretty(&bench)?)?;
    } else {
        bench.devices.iter().try_for_each(print_device)?;
        bench.notes.iter().try_for_each(say)?;
        bench.failures.iter().try_for_each(|failure| say(format_args!("FAILED: {failure}")))?;
    }
    Ok(ExitCode::from(u8::from(!bench.failures.is_empty() || bench.devices.is_empty())))
}

fn print_device(rates: &DeviceRates) -> std::io::Result<()> {
    say(format_args!(
        "{}: copies {:.1} GB/s, multiplies and adds {:.1} GFLOP/s in registers, looks up {:.3} G texels/s",
        rates.device, rates.copy_giga_bytes, rates.multiply_add_giga_operations, rates.giga_look_ups
    ))?;
    if let Some(rate) = rates.matrix_unit_giga_operations {
        say(format_args!("its matrix units multiply f16 at {rate:.1} GFLOP/s in registers"))?;
    }
    let header = ["kernel", "size", "ms", "GFLOP/s", "GB/s", "limit", "share of it"];
    let mut rows = table(header.map(str::to_owned));
    for kernel in &rates.kernels {
        rows.add_row(row(kernel));
    }
    say(rows)?;
    rates.faults.iter().try_for_each(say)?;
    match rates.rounded_forms.is_empty() {
        true => say("linear and convolve in other than exact products: by no matrix units, and fusing gains nothing\n"),
        false => say(format_args!("linear and convolve in other products: {}\n", rates.rounded_forms.join(", "))),
    }
}

fn row(kernel: &KernelRate) -> [String; 7] {
    let limit = match kernel.limit {
        Limit::Copy => "copy",
        Limit::MultiplyAdd => "multiply-add",
        Limit::MatrixUnits => "matrix units",
        Limit::LookUp => "look-up",
    };
    [
        kernel.form.map_or_else(|| kernel.kernel.to_owned(), |form| format!("{}, {form}", kernel.kernel)),
        kernel.size.clone(),
        format!("{:.3}", kernel.milliseconds),
        kernel.giga_operations.map_or_else(String::new, |rate| format!("{rate:.1}")),
        format!("{:.2}", kernel.giga_bytes),
        limit.to_owned(),
        format!("{:.1} %", 100.0 * kernel.share),
    ]
}
