//! Gaussians optimised for a scene: some ten seconds of gradient descent on the source views, then every picture at
//! once.
//!
//! ```text
//! tiles      a picture's tiles, and which splats each shows
//! picture    pictures and derivatives on a device
//! residuals  what they leave of the photographs, carried to a target
//! recipe     the settings, chosen by measurement
//! quality    the recipes for sharper Gaussians
//! level      the source views at the sizes of the pyramid
//! loss       how far a picture is from a photograph, and its derivative
//! start      the Gaussians to begin with: the sources' surfaces, and faint ones at random
//! harmonics  colours by direction
//! particles  Gaussians with the state of their optimisation: steps, pruning, splitting
//! growth     more Gaussians where the photographs ask for them
//! course     what an iteration does, wherever its steps are made
//! resident   an optimisation whose iterations are a device's own
//! optimise   the loop, on the device or by the host
//! covers     whether given Gaussians show what the sources show
//! given      a scene of Gaussians that is there already, as a field
//! ```
//!
//! No network and no data but the scene's own photographs. The start is the cloud of the sources' depths
//! ([`crate::point_cloud`]): gradient descent does not repair wrong surfaces. On a GPU an iteration is the device's
//! own; on the CPU lists of tiles, the loss and the steps are the host's. All sums run in one order, so that the same
//! seed gives the same scene in every run, and on the CPU for any number of threads.
//!
//! Source: "3D Gaussian Splatting for Real-Time Radiance Field Rendering" (Kerbl et al. 2023); the pyramid, the faint
//! Gaussians at random and the penalty on opacity are for few views.

mod course;
mod covers;
mod given;
mod growth;
mod harmonics;
mod level;
mod loss;
mod optimise;
mod particles;
mod picture;
mod quality;
mod recipe;
mod resident;
mod residuals;
mod start;
mod tiles;

pub use course::{Optimisation, Optimised};
pub use given::{GIVEN, GivenGaussians, behind, scene_of};
pub use optimise::{optimisation, optimisation_by_host, optimisation_on_device, optimised};
pub use picture::{Begun, Drawn, Room, Splatted, Splatter};
pub use quality::{Quality, RecipeOptions};
pub use recipe::{MAX_COUNT, MAX_ITERATIONS, Recipe};
pub use residuals::Residuals;
pub use tiles::Tiles;
