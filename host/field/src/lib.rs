//! Fields: density and colour (or features) at points in space, from source views.
//!
//! ```text
//! error             the errors of a field
//! finite            NaN and infinity are found at the stage that produced them
//! variant           a value of a field's options: efforts, candidates, pictures that are mixed
//! rounding          efforts of a product: what rounded factors change in the lists of efforts
//! record            what a field may leave out, and the record of its work
//! field             the traits of a field: it prepares, encodes and renders
//! renderer          a field on a device, with types erased
//! any               a field of any kind
//! standing          how far a camera is from its sources
//! mixture           pictures under several settings, mixed by region
//! session           when views are encoded
//! scores            PSNR and SSIM of what a photograph shows
//! budget            how much of a field's work a bound on the error or on the time needs
//! render            the render loop, from a scene to pictures
//! held_out          photographs that are rendered from others as if they were not there
//! point_cloud       the sources' depths as one cloud of points
//! gaussians         Gaussians optimised for the sources
//! auto              the scheme and the field's scalars for a scene, and the score to expect
//! enlarged          small pictures, enlarged
//! options           a person's options of a field, and the flags that take them
//! row               what a field states of itself
//! learned           common parts of learned fields
//! *                 the fields, a folder each
//! rows              one row a field
//! optimise          a scene's photographs to Gaussians, with scores on the way
//! ```
//!
//! A field of your own implements [`Field`] and [`Prepared`]; [`On`] puts it on a device, and [`render::render`]
//! renders with it as with the fields of this crate.
#![forbid(unsafe_code)]

pub mod any;
pub mod auto;
pub mod budget;
mod enlarged;
pub mod error;
pub mod field;
pub mod finite;
pub mod gaussians;
pub mod genvs;
pub mod held_out;
pub mod learned;
pub mod mixture;
pub mod optimise;
pub mod options;
pub mod pixelnerf;
pub mod point_cloud;
pub mod record;
pub mod render;
pub mod renderer;
mod rounding;
pub mod row;
pub mod rows;
pub mod scores;
mod session;
mod standing;
pub mod training_free;
pub mod variant;

pub use any::AnyField;
pub use error::FieldError;
pub use field::{
    About, Check, DepthMap, Drawing, Encoding, Field, Geometry, LONGEST_DEFAULT_SIDE, Prepared, Purpose, Rendered,
    Request, Rounded, SourceSide, Surfaces,
};
pub use mixture::Mixture;
pub use record::{Denoising, LeftOut, Omission, Record, VIEWS};
pub use renderer::{On, Renderer};
pub use variant::{AnyOptions, Options, Setting, Variant};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
