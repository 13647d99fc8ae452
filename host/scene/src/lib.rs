//! Posed photographs: from folders on disk to source views at working size, and the choice of sources and targets.
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! numpy         arrays as NumPy's files
//! scene         a folder of posed photographs, in any layout: Scene, View, Photograph, ScenePoint
//!               reader: what a layout's reader is, and READERS, all of them
//! parser_world  the world of nerfstudio's training
//! ply           headers of PLY files: PlyElement, PlyProperty
//! gaussians     scenes of Gaussians and their files: GaussianScene
//! dataset       folders of many scenes: Dataset, Split
//! rig           the cameras as a whole: focus, up
//! poses         what is wrong with the poses as a whole: views of one pose, flipped axes
//! unit          the unit of length of weightings and networks: RigUnit
//! coverage      how much of a camera's picture the photographs show
//! path          cameras without photographs: from files, or generated
//! listing       the views as a list, with their neighbours: ListedView
//! few_shot      which views are sources, which cameras are targets: FewShot
//! photographs   sources at working size without their background: SourceImages
//! inspect       what a scene holds, and likely faults in it
//! write         a scene written out, in each layout that can hold it: Layout
//! ```
#![forbid(unsafe_code)]

pub mod coverage;
pub mod dataset;
pub mod few_shot;
pub mod gaussians;
pub mod inspect;
pub mod listing;
pub mod numpy;
mod parser_world;
pub mod path;
pub mod photographs;
pub mod ply;
mod poses;
pub mod rig;
mod scene;
pub mod unit;
pub mod write;

pub use scene::{
    FaultLocation, FileFault, FilePlace, ImageFault, IntrinsicsFault, MAX_SIDE, MaskChoice, MaskMeaning, NumpyFault,
    Photograph, PlyFault, READERS, Scene, SceneError, SceneFault, SceneFrame, ScenePoint, Split, View, encode_png,
    looked_for, picture_size, read_picture, reader, reads_below,
};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
