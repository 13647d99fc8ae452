//! The result of a check, for persons and programs.

use super::agreement::Versus;
use serde::Serialize;
use viewfuse_job::progress::Interrupted;

/// Why a check was not completed.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// A device failed in a kernel.
    #[error("kernel {kernel} failed")]
    Device {
        /// The kernel.
        kernel: &'static str,
        /// The device's error.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A picture could not be rendered.
    #[error("the picture of {scene} could not be rendered")]
    Picture {
        /// The scene.
        scene: String,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The work was cancelled.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// Differences of a kernel's numbers from the CPU's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VersusCpu {
    /// Largest difference of the decided numbers.
    pub absolute: f64,
    /// The same in units of the last place.
    pub ulps: f64,
    /// Share of all numbers that are the same bit for bit.
    pub equal: f64,
}

impl From<Versus> for VersusCpu {
    fn from(versus: Versus) -> VersusCpu {
        VersusCpu { absolute: versus.worst.absolute, ulps: versus.worst.ulps, equal: versus.equal }
    }
}

/// A kernel on a device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelReport {
    /// Its name.
    pub kernel: &'static str,
    /// Numbers that were compared with `f64`.
    pub compared: usize,
    /// Share of the undecided numbers, which were not compared.
    pub undecided: f64,
    /// Largest difference from `f64`.
    pub absolute: f64,
    /// Largest relative difference of numbers of at least `least`.
    pub relative: f64,
    /// The same in units of the last place.
    pub ulps: f64,
    /// The smallest size for relative differences.
    pub least: f64,
    /// Largest quotient of a difference and the bound of its number.
    pub of_bound: f64,
    /// Largest bound of the numbers compared.
    pub tolerance: f64,
    /// The derivation of the bounds.
    pub reason: &'static str,
    /// Differences from the CPU's numbers; null for the CPU itself.
    pub versus_cpu: Option<VersusCpu>,
    /// Time for an element, in nanoseconds.
    pub nanoseconds_per_element: f64,
    /// The exceeded tolerance, if any.
    pub breach: Option<String>,
}

/// A whole picture on a device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureReport {
    /// The scene.
    pub scene: String,
    /// The rendered view.
    pub target: String,
    /// The number of sources.
    pub source_count: usize,
    /// Width and height.
    pub size: [u32; 2],
    /// Time from the photographs to the picture.
    pub seconds: f64,
    /// Differences from the CPU's picture; null for the CPU itself.
    pub versus_cpu: Option<PictureVersusCpu>,
    /// The exceeded tolerance, if any.
    pub breach: Option<String>,
}

/// See [`PictureReport::versus_cpu`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PictureVersusCpu {
    /// Largest difference of a channel, in steps of 1/255.
    pub worst: u8,
    /// The number of differing pixels.
    pub differing: usize,
    /// Peak signal to noise ratio in decibels; null for equal pictures.
    pub psnr: Option<f64>,
}

/// A device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceReport {
    /// Its name.
    pub device: String,
    /// Its kernels, in the order of the data.
    pub kernels: Vec<KernelReport>,
    /// A whole picture.
    pub picture: Option<PictureReport>,
}

impl DeviceReport {
    /// Names of the exceeded tolerances: kernels, or `picture`.
    pub fn breaches(&self) -> Vec<&'static str> {
        let kernels = self.kernels.iter().filter(|kernel| kernel.breach.is_some()).map(|kernel| kernel.kernel);
        let picture = self.picture.iter().filter(|picture| picture.breach.is_some()).map(|_| "picture");
        kernels.chain(picture).collect()
    }
}

/// All devices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the program.
    pub viewfuse: &'static str,
    /// Seeds of each kernel.
    pub seed_count: u32,
    /// Sizes of each kernel, in elements.
    pub sizes: Vec<u32>,
    /// The checked devices, in order.
    pub devices: Vec<DeviceReport>,
    /// Devices that failed, with the error.
    pub failures: Vec<String>,
    /// Devices that were not checked, with the reason.
    pub notes: Vec<String>,
}

impl Report {
    /// Whether a device was checked, none failed, and no tolerance is exceeded.
    pub fn passes(&self) -> bool {
        self.failures.is_empty()
            && !self.devices.is_empty()
            && self.devices.iter().all(|device| device.breaches().is_empty())
    }

    /// The exit code of a command with this report.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.passes())
    }
}
