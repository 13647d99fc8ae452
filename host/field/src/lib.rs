//! Fields: what there is at a point in space, from source views.
//!
//! ```text
//! error             why a field could not make a picture
//! finite            NaN and infinity are found at the stage that produced them
//! record            what a field tells about its work
//! field             what a field is: it prepares, encodes and renders
//! renderer          a field on a device, without types
//! session           when views are encoded
//! training_free     visual hull and plane sweep
//! any               a field of any kind
//! options           what a person can say about a learned field
//! learned           what learned fields share
//! *                 the learned fields, a folder each
//! family            one row a learned field
//! enlarged          small pictures, enlarged
//! render            the way of the data, from a scene to pictures
//! ```
//!
//! A field of one's own implements [`Field`] and [`Prepared`]; [`On`] puts it on a device, and [`render::render`] renders
//! with it as with those that are here.
#![forbid(unsafe_code)]

pub mod any;
pub mod enlarged;
pub mod error;
pub mod family;
pub mod field;
pub mod finite;
pub mod genvs;
pub mod learned;
pub mod options;
pub mod pixelnerf;
pub mod record;
pub mod render;
pub mod renderer;
pub mod session;
pub mod training_free;

pub use any::AnyField;
pub use error::FieldError;
pub use field::{About, Encoding, Field, LONGEST_DEFAULT_SIDE, Prepared, Rendered, Request, SourceSide};
pub use record::{Denoising, LeftOut, Record};
pub use renderer::{On, Renderer};
pub use session::Session;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
