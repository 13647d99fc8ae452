//! Synthetic scenes: objects described by formulas, and photographs of them.
//!
//! A scene of this making has what no photograph has: exact poses, exact alpha, exact depth and no licence but ours.
//! The repository's sample scenes are made here: `viewfuse-lab scenes toy FOLDER` and
//! `viewfuse-lab scenes photograph room FOLDER --views 11 --seed 17`.
//! The modules stand in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! prism         signed distance of a side view with a width    Prism
//! shape         signed distances of primitives                 Shape
//! placement     where a primitive stands in the world          Placement
//! noise         random numbers that belong to places           smooth, layered
//! material      patterns of wood, brick, cloth, print          Material
//! texture       colour as a function of the point              Texture, Finish
//! light         lamps                                          Light
//! part          a primitive, placed and painted; boxes around  Part, Bounds
//! object        parts together                                 Object
//! trace         first point of an object on a ray              trace, is_blocked
//! shade         light on that point                            shade
//! render        a camera's picture of an object                render, sources
//! orbit         cameras around an object                       Orbit
//! folder        pictures and poses on disk, SRN layout         write_scene
//! toy           the sample: a toy lorry with its load          lorry, training_cameras, test_cameras
//! cameras       where scenes to learn from are seen from       random_views, spiral_views
//! kinds         a whole distribution: cars                     car
//! collection    many scenes to learn from, on disk             make
//! lamp          lamps with a size                              Lamp
//! scenery       an object all around, with lamps               Scenery
//! illumination  soft shadows and light from around             illuminate
//! photograph    a camera's picture of it, and its depth        photograph, depth
//! rig           how a person goes around with a camera         Walk
//! room          a table with things on it in a room            room
//! shoot         photographs of a room by seed and size         generate
//! transforms    photographs and poses on disk, NeRF layout     write_shoot
//! ```
//!
//! Everything is computed in `f32` from additions, multiplications, divisions and square roots in one stated order,
//! with the elementary functions of [`viewfuse_core::math`]: a picture is the same bit for bit on every machine and
//! for any number of threads.
#![forbid(unsafe_code)]

pub mod cameras;
pub mod collection;
pub mod folder;
pub mod illumination;
pub mod kinds;
pub mod lamp;
pub mod light;
pub mod material;
pub mod noise;
pub mod object;
pub mod orbit;
pub mod part;
pub mod photograph;
pub mod placement;
pub mod prism;
pub mod render;
pub mod rig;
pub mod room;
pub mod scenery;
pub mod shade;
pub mod shape;
pub mod shoot;
pub mod texture;
pub mod toy;
pub mod trace;
pub mod transforms;

pub use folder::{WriteError, write_scene};
pub use kinds::car;
pub use light::Light;
pub use object::Object;
pub use orbit::Orbit;
pub use part::Part;
pub use placement::Placement;
pub use prism::Prism;
pub use render::{render, render_with, sources};
pub use scenery::Scenery;
pub use shape::Shape;
pub use shoot::{Shoot, generate};
pub use texture::{Finish, Patch, Texture};
pub use trace::{Hit, trace};
pub use transforms::write_shoot;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
