//! Work that needs a process of its own, done by this program started again: the validation layers may want another C
//! library, and a device that is left alone must let its process end.

use crate::time::Additions;
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use std::error::Error;
use std::process::{Command, ExitCode};
use std::time::Duration;
use std::{env, fs};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_tests::command::Outcome;
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Adapter, Gpu, GpuOptions, Instance, VulkanError};

/// Kernels that depend on one another.
pub(crate) const WITH_BARRIERS: &str = "with_barriers";
/// The same without anything that keeps them apart.
pub(crate) const WITHOUT_BARRIERS: &str = "without_barriers";
/// A kernel that still runs when its device is given up.
pub(crate) const LEFT_ALONE: &str = "left_alone";

const WORK: &str = "VIEWFUSE_TEST_WORK";
const DEVICE: &str = "VIEWFUSE_TEST_DEVICE";

/// Does the work that the environment asks for, if it asks for any. Prints what the validation layers said.
pub(crate) fn run() -> Option<ExitCode> {
    let (work, device) = (env::var(WORK).ok()?, env::var(DEVICE).ok()?);
    let done = vulkan_devices().map_err(Box::from).and_then(|(instance, adapters)| {
        let adapter = Adapter::choose(&adapters, &device)?;
        let outcome = do_work(&work, &instance, adapter);
        let messages = instance.messages().all();
        println!("{}", messages.join("\n"));
        match outcome {
            // That is what the messages are.
            Err(error) if error.downcast_ref().is_some_and(|error| matches!(error, VulkanError::Validation { .. })) => {
                Ok(())
            }
            outcome => outcome,
        }
    });
    Some(match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    })
}

fn do_work(work: &str, instance: &std::sync::Arc<Instance>, adapter: &Adapter) -> Result<(), Box<dyn Error>> {
    let usual = GpuOptions::default();
    match work {
        WITH_BARRIERS => dependent_kernels(&Gpu::open(instance, adapter, &usual)?)?,
        WITHOUT_BARRIERS => {
            dependent_kernels(&Gpu::open(instance, adapter, &GpuOptions { barriers: false, ..usual })?)?
        }
        LEFT_ALONE => {
            let additions = Additions::that_take(&Gpu::open(instance, adapter, &usual)?, Duration::from_millis(500))?;
            let limit = Duration::from_millis(1);
            let gpu = Gpu::open(instance, adapter, &GpuOptions { time_limit: Some(limit), closing: limit, ..usual })?;
            match additions.send(&gpu).and_then(|_| gpu.wait()) {
                Err(VulkanError::TimeLimit { .. }) => {}
                outcome => return Err(format!("it was in time: {outcome:?}").into()),
            }
            drop(gpu);
            // What the driver does at the end of a process is not tested: with its threads at work llvmpipe freed a
            // wrong pointer there once.
            std::thread::sleep(Duration::from_secs(2));
        }
        _ => return Err(format!("{work} is no work").into()),
    }
    Ok(())
}

/// Two kernels, the second of which reads what the first writes.
fn dependent_kernels(gpu: &Gpu) -> Result<(), VulkanError> {
    let weight = gpu.upload(&[1.0_f32])?;
    let [first, second, third] = [gpu.zeros::<f32>(4096)?, gpu.zeros(4096)?, gpu.zeros(4096)?];
    gpu.wait()?;
    for [from, to] in [[&first, &second], [&second, &third]] {
        let block = FuseBlock { view_count: 1, stride: 4096, ..FuseBlock::default() };
        gpu.dispatch(Kernel::FuseViews, bytes_of(&block), 0..4096, &[weight.bind(), from.bind(), to.bind()])?;
    }
    gpu.wait()
}

/// This program, to be started again.
pub(crate) fn this_program() -> Result<Command, Failed> {
    Ok(Command::new(fs::canonicalize(env::current_exe()?)?))
}

/// Runs this program, as that command starts it, for its work on a device.
pub(crate) fn outcome(mut program: Command, work: &str, device: &str) -> Result<Outcome, Failed> {
    program.env(WORK, work).env(DEVICE, device);
    Ok(Outcome::of(program))
}
