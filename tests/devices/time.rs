//! A kernel that takes too long.

use crate::candidate::{Candidate, assert_works, tests};
use crate::child;
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use std::time::{Duration, Instant};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_tests::patience::PATIENCE;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{AdapterKind, Gpu, GpuOptions, VulkanError};

tests!(a_time_limit_expires, a_busy_machine_is_no_failure, a_device_that_works_on_is_left_alone);

const LIMIT: Duration = Duration::from_millis(5);
/// Additions of a kernel that takes as long as one likes: how often each element adds the same number, and elements.
#[derive(Clone, Copy)]
pub(crate) struct Additions {
    times: u32,
    elements: u32,
}

impl Additions {
    const ONE: Additions = Additions { times: 1, elements: 1 << 12 };

    /// Sends them on their way. Returns when that was.
    pub(crate) fn send(self, gpu: &Gpu) -> Result<Instant, VulkanError> {
        let Additions { times, elements } = self;
        let [weights, latents, fused] =
            [gpu.zeros::<f32>(times as usize)?, gpu.zeros(elements as usize)?, gpu.zeros(elements as usize)?];
        // What was asked for before has the time limit as well.
        gpu.wait()?;
        let arrays = [weights.bind(), latents.bind(), fused.bind()];
        let sent = Instant::now();
        gpu.dispatch(
            Kernel::FuseViews,
            bytes_of(&FuseBlock { view_count: times, ..FuseBlock::default() }),
            0..elements,
            &arrays,
        )?;
        Ok(sent)
    }

    /// So many as take at least this long. Mesa's llvmpipe ends loops after 65,535 rounds: from there on there are more
    /// elements, and behind so many that fill a GPU more rounds again.
    pub(crate) fn that_take(gpu: &Gpu, time: Duration) -> Result<Additions, VulkanError> {
        // The first dispatch compiles the kernel, which may take longer than it runs.
        Additions::ONE.send(gpu)?;
        gpu.wait()?;
        let mut all = Additions { times: 1 << 10, ..Additions::ONE };
        loop {
            let sent = all.send(gpu)?;
            gpu.wait()?;
            if sent.elapsed() >= time || all.times >= 1 << 24 {
                return Ok(all);
            }
            match all.times >= 1 << 15 && all.elements < 1 << 20 {
                true => all.elements *= 2,
                false => all.times *= 2,
            }
        }
    }
}

/// On a busy machine anything may take longer than a limit; then it is not the kernel that is told, and a longer limit
/// is tried, with a kernel that takes longer.
fn a_time_limit_expires(candidate: &Candidate) -> Result<(), Failed> {
    let mut limit = LIMIT;
    while limit < PATIENCE {
        let additions = Additions::that_take(&candidate.gpu(&GpuOptions::default())?, 50 * limit)?;
        if expires_in_the_kernel(candidate, additions, limit)? {
            return Ok(());
        }
        limit *= 2;
    }
    Err("it was never the kernel that took too long".into())
}

fn expires_in_the_kernel(candidate: &Candidate, additions: Additions, own_limit: Duration) -> Result<bool, Failed> {
    // Closing waits for the kernel, however long it takes.
    let options = GpuOptions { time_limit: Some(own_limit), closing: PATIENCE, ..GpuOptions::default() };
    let gpu = candidate.gpu(&options)?;
    let kept = gpu.zeros::<f32>(4)?;
    let outcome = additions.send(&gpu).and_then(|_| gpu.wait());
    let Err(error) = outcome else { return Err("it was in time".into()) };
    let VulkanError::TimeLimit { device, work, limit } = &error else { return Err(format!("{error}").into()) };
    assert_eq!((device.as_str(), *limit), (gpu.name(), own_limit));
    let words = format!("{work} did not finish within {} s", own_limit.as_secs_f64());
    assert!(error.to_string().ends_with(&words), "{error}");
    // From now on nothing that it holds can be trusted.
    assert_eq!(gpu.wait().err().as_ref(), Some(&error));
    assert_eq!(gpu.upload(&[1.0_f32]).err().as_ref(), Some(&error));
    assert_eq!(gpu.zeros::<f32>(1).err().as_ref(), Some(&error));
    assert_eq!(gpu.download(&kept).err().as_ref(), Some(&error));
    assert_eq!(Additions::ONE.send(&gpu).err().as_ref(), Some(&error));
    let is_of_the_kernel = work == "kernel fuse_views";
    drop(gpu);
    drop(kept);
    // Then the device can be opened anew.
    assert_works(&candidate.gpu(&GpuOptions::default())?)?;
    Ok(is_of_the_kernel)
}

/// A software driver shares the processor with everything else that runs: only a limit that was asked for counts there.
fn a_busy_machine_is_no_failure(candidate: &Candidate) -> Result<(), Failed> {
    let (usual, asked) = (GpuOptions::default(), GpuOptions { time_limit: Some(LIMIT), ..GpuOptions::default() });
    let of_kinds = [AdapterKind::Discrete, AdapterKind::Software].map(|kind| usual.time_limit_on(kind));
    assert_eq!(of_kinds, [Some(Duration::from_secs(120)), None]);
    let kind = candidate.adapter.kind;
    assert_eq!(usual.time_limit_on(kind).is_none(), kind == AdapterKind::Software);
    assert_eq!(asked.time_limit_on(kind), Some(LIMIT));
    Ok(())
}

/// In a process of its own, which must end well.
fn a_device_that_works_on_is_left_alone(candidate: &Candidate) -> Result<(), Failed> {
    let outcome = child::outcome(child::this_program()?, child::LEFT_ALONE, &candidate.adapter.name)?;
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""), "{}", outcome.stdout);
    Ok(())
}
