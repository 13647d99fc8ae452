//! `viewfuse devices`.

use super::environment::instance_options;
use super::printing::say;
use super::table::table;
use clap::Args;
use serde_json::json;
use std::process::ExitCode;
use viewfuse_device::Memory;
use viewfuse_device::choice::vulkan_devices;
use viewfuse_device::cpu::Cpu;
use viewfuse_vulkan::{Adapter, Missing, version};

#[derive(Args)]
#[command(after_help = "Example:\n  viewfuse devices\n\n\
    The column `device` is what --device takes. Exit code 0, also where there is no Vulkan.")]
pub(crate) struct Arguments {
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    // A machine without Vulkan is not a failure.
    let (adapters, problem) = match vulkan_devices(&instance_options()) {
        Ok((_, adapters)) => (adapters, None),
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    if arguments.json {
        let listed: Vec<_> = adapters.iter().map(to_json).collect();
        let all = json!({ "cpu": Cpu.name(), "vulkan": listed, "vulkan_problem": problem });
        say(format_args!("{}", serde_json::to_string_pretty(&all)?))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut rows = table(["device", "name", "kind", "memory", "Vulkan", "driver", "missing"].map(str::to_owned));
    rows.align_left([1, 2, 5, 6]);
    let cpu_name = Cpu.name();
    rows.add_row(["cpu", cpu_name.as_str(), "", "", "", "", "nothing"]);
    for adapter in &adapters {
        let missing: Vec<String> = adapter.missing.iter().map(Missing::to_string).collect();
        rows.add_row([
            format!("vulkan:{}", adapter.index),
            adapter.name.clone(),
            adapter.kind.to_string(),
            format!("{:.1} GiB", adapter.memory as f64 / f64::from(1 << 30)),
            version(adapter.api_version),
            adapter.driver.clone(),
            if missing.is_empty() { "nothing".to_owned() } else { missing.join(", ") },
        ]);
    }
    say(rows)?;
    problem.map_or(Ok(()), |problem| say(format_args!("{problem}")))?;
    Ok(ExitCode::SUCCESS)
}

fn to_json(adapter: &Adapter) -> serde_json::Value {
    json!({
        "device": format!("vulkan:{}", adapter.index),
        "name": adapter.name,
        "kind": adapter.kind.to_string(),
        "memory_bytes": adapter.memory,
        "vulkan": version(adapter.api_version),
        "driver": adapter.driver,
        "buffer_range_bytes": adapter.limits.buffer_range,
        "allocation_bytes": adapter.limits.allocation,
        "workgroup_count": adapter.limits.workgroup_count,
        "missing": adapter.missing.iter().map(Missing::to_string).collect::<Vec<_>>(),
    })
}
