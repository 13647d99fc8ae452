//! A device under test.

use crate::picture::Rendering;
use libtest_mimic::Failed;
use std::error::Error;
use std::sync::{Arc, OnceLock};
use viewfuse::device::vulkan::Vulkan;
use viewfuse_vulkan::{Adapter, Gpu, GpuOptions, Instance, Missing, VulkanError};

/// A test that runs on every device.
#[derive(Clone)]
pub(crate) struct Test {
    pub(crate) name: &'static str,
    pub(crate) work: fn(&Candidate) -> Result<(), Failed>,
    /// What this machine lacks for it, besides the device.
    pub(crate) missing: Option<String>,
}

impl Test {
    pub(crate) const fn new(name: &'static str, work: fn(&Candidate) -> Result<(), Failed>) -> Test {
        Test { name, work, missing: None }
    }
}

/// The tests of a module, by their names.
macro_rules! tests {
    ($($test:ident),+ $(,)?) => {
        pub(crate) const TESTS: &[$crate::candidate::Test] =
            &[$($crate::candidate::Test::new(stringify!($test), $test)),+];
    };
}
pub(crate) use tests;

/// A device, not yet opened: every trial opens it for itself.
pub(crate) struct Candidate {
    pub(crate) instance: Arc<Instance>,
    pub(crate) adapter: Adapter,
    /// The sample picture with the device's own limits, and what led to it: rendered by whichever trial needs it first.
    rendering: OnceLock<Result<Rendering, String>>,
}

impl Candidate {
    pub(crate) fn new(instance: &Arc<Instance>, adapter: Adapter) -> Candidate {
        Candidate { instance: instance.clone(), adapter, rendering: OnceLock::new() }
    }

    /// What it lacks, if anything.
    pub(crate) fn problem(&self) -> Option<String> {
        let lacks: Vec<String> = self.adapter.missing.iter().map(Missing::to_string).collect();
        (!lacks.is_empty()).then(|| format!("lacks {}", lacks.join(", ")))
    }

    pub(crate) fn gpu(&self, options: &GpuOptions) -> Result<Gpu, VulkanError> {
        Gpu::open(&self.instance, &self.adapter, options)
    }

    pub(crate) fn vulkan(&self, options: &GpuOptions) -> Result<Vulkan, VulkanError> {
        Vulkan::open(&self.instance, &self.adapter, options)
    }

    pub(crate) fn rendering(&self) -> Result<&Rendering, Failed> {
        let render = || {
            let device = self.vulkan(&GpuOptions::default()).map_err(|error| error.to_string())?;
            Rendering::on_vulkan(&device).map_err(|error| format!("{error:?}"))
        };
        self.rendering.get_or_init(render).as_ref().map_err(|error| error.as_str().into())
    }
}

/// The device does what it should.
pub(crate) fn assert_works(gpu: &Gpu) -> Result<(), VulkanError> {
    let values: Vec<u32> = (0..1000).map(|index| index * 7919).collect();
    assert_eq!(gpu.download(&gpu.upload(&values)?)?, values);
    Ok(())
}

/// An error with its cause.
pub(crate) fn said(error: impl Error) -> Failed {
    match error.source() {
        Some(cause) => format!("{error}: {cause}").into(),
        None => error.to_string().into(),
    }
}
