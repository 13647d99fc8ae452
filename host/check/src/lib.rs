//! Checks of devices: every kernel against an `f64` evaluation, and whole pictures.
//!
//! Each kernel runs through a device's trait method on small random inputs. The expected outputs are evaluated in `f64`
//! by independent code, with a bound for each number: running error analysis, or roundings counted by hand. The bounds
//! hold on every device, also with the least accurate divisions that Vulkan allows. An element that depends on rounding
//! (the side of a threshold) is undecided; such elements must be few.
//!
//! ```text
//! bounded, agreement            differences of numbers, and whether they are within their bounds
//! half                          half precision from its definition
//! oracle,                       expected outputs in f64
//!   camera_oracle, hull_oracle,
//!   ray_oracle, compositing_oracle,
//!   winograd_oracle,
//!   network_oracle, point_oracle,
//!   group_norm_oracle,
//!   matrix_oracle, volume_oracle,
//!   sweep_oracle, gaussian_oracle,
//!   list_oracle, step_oracle
//! poses, ray_inputs, world,     inputs for a seed
//!   swept
//! dispatch                      each kernel's parameters and arrays, from its row: upload, run, download
//! case, cases                   one for each kernel: inputs, negative controls, expected outputs
//! report, measure               the check of a device's kernels
//! picture                       a whole picture compared with the CPU's
//! rates                         rates of kernels beside the device's limits
//! verify                        this build compared with files of reference values
//! ```
#![forbid(unsafe_code)]

pub mod agreement;
pub mod bounded;
pub mod camera_oracle;
pub mod case;
pub mod cases;
pub mod compositing_oracle;
pub mod dispatch;
pub mod gaussian_oracle;
pub mod group_norm_oracle;
pub mod half;
pub mod hull_oracle;
pub mod list_oracle;
pub mod matrix_oracle;
pub mod measure;
pub mod network_oracle;
pub mod oracle;
pub mod picture;
pub mod point_oracle;
pub mod poses;
pub mod rates;
pub mod ray_inputs;
pub mod ray_oracle;
pub mod report;
pub mod step_oracle;
pub mod sweep_oracle;
pub mod swept;
pub mod verify;
pub mod volume_oracle;
pub mod winograd_oracle;
pub mod world;

pub use measure::{check_device, check_kernel};
pub use report::{CheckError, DeviceReport, KernelReport, PictureReport, Report};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
