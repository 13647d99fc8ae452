//! Errors of the render loop.

use crate::FieldError;
use crate::error::NoObject;
use viewfuse_core::camera::PinholeError;
use viewfuse_core::sources::SourcesError;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_scene::photographs::PhotographsError;
use viewfuse_scene::{Scene, SceneError};

/// Why a render failed.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene or a photograph could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A photograph could not be prepared.
    #[error(transparent)]
    Photographs(#[from] PhotographsError),
    /// There are too few or too many sources.
    #[error("{0}")]
    Sources(SourcesError),
    /// The size does not fit the scene.
    #[error(
        "{scene}: a size of {width}x{height} does not keep the shape of the views ({view_width}x{view_height}); for this width \
         it would be {width}x{fitting_height}"
    )]
    Shape {
        /// The scene's path.
        scene: String,
        /// The requested value.
        width: u32,
        /// The requested value.
        height: u32,
        /// That of the views.
        view_width: u32,
        /// That of the views.
        view_height: u32,
        /// The height that keeps the views' shape.
        fitting_height: u32,
    },
    /// The size is invalid.
    #[error("a size of {width}x{height} is invalid: {error}")]
    Size {
        /// The requested value.
        width: u32,
        /// The requested value.
        height: u32,
        /// The reason.
        error: PinholeError,
    },
    /// The scene does not suit the field.
    #[error("{scene}: {reason}")]
    Unsuitable {
        /// The scene's path.
        scene: String,
        /// The field's own error.
        reason: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The field failed.
    #[error(transparent)]
    Field(#[from] FieldError),
}

impl RenderError {
    /// A field's error, with the scene's path if it is about the scene.
    pub(super) fn of(error: FieldError, scene: &Scene) -> RenderError {
        match error {
            FieldError::Unsuitable(reason) => {
                RenderError::Unsuitable { scene: scene.path.display().to_string(), reason }
            }
            error => error.into(),
        }
    }

    /// Whether the error is a device failure.
    pub fn is_of_device(&self) -> bool {
        matches!(self, RenderError::Field(FieldError::Device(_)))
    }
}

impl Hinted for RenderError {
    fn hint(&self) -> Option<Hint> {
        match self {
            RenderError::Shape { .. } | RenderError::Size { .. } => Some(Hint::PictureSize),
            RenderError::Unsuitable { reason, .. } if reason.is::<NoObject>() => Some(Hint::NoObject),
            RenderError::Photographs(error) => error.hint(),
            _ => None,
        }
    }
}
