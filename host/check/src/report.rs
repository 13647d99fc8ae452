//! What a check found, as a person and as a program reads it.

use super::agreement::Versus;
use serde::Serialize;
use viewfuse_job::progress::Interrupted;

/// Why a check did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// A device failed in a kernel.
    #[error("kernel {kernel} failed")]
    Device {
        /// The kernel.
        kernel: &'static str,
        /// What the device said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A picture could not be rendered.
    #[error("the picture of {scene} could not be rendered")]
    Picture {
        /// The scene.
        scene: String,
        /// Why not.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The person stopped the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// How a kernel's numbers differ from the CPU's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VersusCpu {
    /// Largest difference of the numbers that do not hang on rounding.
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
    /// How many numbers were compared with `f64`.
    pub compared: usize,
    /// Share of the numbers that hang on rounding and were not.
    pub undecided: f64,
    /// Largest difference from `f64`.
    pub absolute: f64,
    /// Largest relative difference of numbers of at least `least`.
    pub relative: f64,
    /// The same in units of the last place.
    pub ulps: f64,
    /// From which size on relative differences are looked at.
    pub least: f64,
    /// Largest quotient of a difference and the bound of its number.
    pub of_bound: f64,
    /// Largest bound of the numbers compared.
    pub tolerance: f64,
    /// Where the bounds come from.
    pub reason: &'static str,
    /// How the numbers differ from the CPU's; nothing for the CPU itself.
    pub versus_cpu: Option<VersusCpu>,
    /// Time for an element, in nanoseconds.
    pub nanoseconds_per_element: f64,
    /// What is wrong, if anything.
    pub breach: Option<String>,
}

/// A whole picture on a device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureReport {
    /// The scene.
    pub scene: String,
    /// The view that was rendered, and from how many others.
    pub target: String,
    /// How many sources there were.
    pub source_count: usize,
    /// Width and height.
    pub size: [u32; 2],
    /// From the photographs to the picture.
    pub seconds: f64,
    /// How the picture differs from the CPU's; nothing for the CPU itself.
    pub versus_cpu: Option<PictureVersusCpu>,
    /// What is wrong, if anything.
    pub breach: Option<String>,
}

/// See [`PictureReport::versus_cpu`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PictureVersusCpu {
    /// Largest difference of a channel, in steps of 1/255.
    pub worst: u8,
    /// How many pixels differ at all.
    pub differing: usize,
    /// Peak signal to noise ratio in decibels; nothing for equal pictures.
    pub psnr: Option<f64>,
}

/// A device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceReport {
    /// What it calls itself.
    pub device: String,
    /// Its kernels, in the order of the data.
    pub kernels: Vec<KernelReport>,
    /// A whole picture.
    pub picture: Option<PictureReport>,
}

impl DeviceReport {
    /// Names of what breaches its tolerance: kernels, or `picture`.
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
    /// How many seeds each kernel was checked with.
    pub seed_count: u32,
    /// The sizes it was checked at.
    pub sizes: Vec<u32>,
    /// In the order in which they were checked.
    pub devices: Vec<DeviceReport>,
    /// Devices that failed, and how.
    pub failures: Vec<String>,
    /// Devices that were not checked, and why.
    pub notes: Vec<String>,
}

impl Report {
    /// Whether something was checked, no device failed, and nothing breaches its tolerance.
    pub fn passes(&self) -> bool {
        self.failures.is_empty()
            && !self.devices.is_empty()
            && self.devices.iter().all(|device| device.breaches().is_empty())
    }

    /// What a command returns that ends with this report.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.passes())
    }
}
