//! The Python package `viewfuse`: scenes, weights and pictures as numpy arrays.
//!
//! ```text
//! error          errors as Python exceptions
//! progress       the course of long work, as a bar or for a function
//! interrupt      work without Python's lock, which Ctrl-C ends
//! whole          whole numbers as arguments
//! arrays         arrays in and out
//! request        what to render: targets and sources from Python's arguments
//! weights        weights of the sources for targets
//! given_weights  weights of the caller's own: an array, or a function
//! frame          a rendered view
//! render         the render loop
//! evaluate       schemes on held-out views
//! optimise       photographs to a file of Gaussians
//! scene          a scene, with the methods that use the modules above
//! pose           bare photographs to a scene
//! scores         PSNR and SSIM of two pictures
//! ```

mod arrays;
mod error;
mod evaluate;
mod frame;
mod given_weights;
mod interrupt;
mod optimise;
mod pose;
mod progress;
mod render;
mod request;
mod scene;
mod scores;
mod weights;
mod whole;

/// Few-shot novel view synthesis: scenes, weights and pictures as numpy arrays.
#[pyo3::pymodule(name = "viewfuse")]
mod module {
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::evaluate::PyScore;
    #[pymodule_export]
    use crate::frame::PyFrame;
    #[pymodule_export]
    use crate::optimise::PyGaussians;
    #[pymodule_export]
    use crate::pose::pose;
    #[pymodule_export]
    use crate::scene::{PyScene, open};
    #[pymodule_export]
    use crate::scores::{psnr, ssim};
    #[pymodule_export]
    use crate::weights::PyWeights;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        viewfuse::job::panics::silence_caught();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
