//! viewfuse: from a handful of posed photographs, the picture from a camera that was never there.
//!
//! The modules stand in the order of the data; a module uses only modules listed above it.
//!
//! ```text
//! interrupt, progress, files    stopping cleanly, showing progress, outputs that appear whole
//! scene                         a folder of posed photographs: Scene, View, Photograph
//! dataset                       folders of many scenes: Dataset, Split
//! synthetic                     scenes made by ourselves
//! rig                           the cameras as a whole: focus, up, orbits
//! sources                       how many sources there can be
//! formula, attention, weighting pose -> weight, by name: Weighting
//! few_shot                      which views are sources, which cameras are targets: FewShot
//! photographs                   sources at working size without their background: SourceImages
//! checkpoint                    files of network parameters: Checkpoint
//! device                        where kernels run: Device, the CPU, Vulkan devices, which one
//! field                         photographs -> picture: Field, the field that needs no weights file
//! metrics                       how good pictures are, as numbers and through networks' eyes: Metrics
//! render                        the way of the data from scene to picture, in one function
//! canvas, sheet, record         contact sheets, camera maps, run records
//! evaluate, inspect, verify     the other jobs
//! protocol, run_folder, gallery evaluations that can be compared, that go on after a kill, and what they show
//! summary                       their tables
//! pareto                        error against run time
//! report                        all of that on one page
//! check                         how closely devices agree with the mathematics
//! train                         networks and weightings, learned from scenes
//! ```
//!
//! The command line is the binary's (`main.rs`, `cli/`).
#![forbid(unsafe_code)]

pub mod attention;
pub mod canvas;
pub mod check;
pub mod checkpoint;
pub mod dataset;
pub mod device;
pub mod digest;
pub mod evaluate;
pub mod few_shot;
pub mod field;
pub mod files;
pub mod formula;
pub mod gallery;
pub mod inspect;
pub mod interrupt;
pub mod metrics;
pub mod pareto;
pub mod photographs;
pub mod progress;
pub mod protocol;
pub mod record;
pub mod render;
pub mod report;
pub mod rig;
pub mod run_folder;
pub mod scene;
pub mod sheet;
pub mod sources;
pub mod summary;
pub mod synthetic;
pub mod train;
pub mod verify;
pub mod weighting;

/// The README's code is compiled with the documentation's tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
