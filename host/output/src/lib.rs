//! The output of a run: pictures, depth maps, contact sheets, and the run record ([`run`]).
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! png      pictures as files
//! canvas   text, lines and small pictures on a picture
//! camera_map  the cameras of a scene, seen from above
//! match_graph  which photographs match which
//! sheet    the contact sheet of a target
//! record   the run record, as JSON
//! exr      depth maps as OpenEXR (feature `exr`)
//! depth    depth maps as files of any format
//! ply      point clouds as PLY
//! scripts  scripts that pages share
//! ring           how much is seen from around a subject
//! gaussian_page  a scene of Gaussians as one page
//! rate     frames per second
//! webp     animated pictures
//! gif      the same for who takes no WebP
//! y4m      video without compression
//! video    the frames of a run as one file of any format
//! weights  the weights of many targets: JSON, NumPy's arrays
//! selected  the few sources that targets need: JSON, lines
//! journal  what an interrupted run continues from
//! earlier  what an earlier run left in a folder
//! unwritten  frames whose files other threads write
//! videos   videos that grow with the frames
//! run      all of it in a folder
//! folder   checks of that folder before work begins
//! ```
#![forbid(unsafe_code)]

pub mod camera_map;
pub mod canvas;
pub mod depth;
mod earlier;
#[cfg(feature = "exr")]
pub mod exr;
pub mod folder;
pub mod gaussian_page;
mod gif;
pub mod journal;
pub mod match_graph;
pub mod ply;
pub mod png;
pub mod rate;
pub mod record;
pub mod ring;
pub mod run;
pub mod scripts;
pub mod selected;
pub mod sheet;
mod unwritten;
pub mod video;
mod videos;
pub mod webp;
pub mod weights;
pub mod y4m;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
