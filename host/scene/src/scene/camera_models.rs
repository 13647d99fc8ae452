//! Camera models by the names that COLMAP and nerfstudio give them: the meaning of each parameter.

use viewfuse_core::lens::{Lens, LensError, Projection};

/// The meaning of a camera model's parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Parameter {
    /// Focal length of both axes.
    Focal,
    FocalX,
    FocalY,
    PrincipalX,
    PrincipalY,
    /// A coefficient of the lens, as an index into those of [`Lens::new`].
    Coefficient(usize),
}

/// A camera model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CameraModel {
    /// Its name.
    pub(super) name: &'static str,
    /// COLMAP's number of it, in binary files.
    pub(super) id: u32,
    projection: Projection,
    parameters: &'static [Parameter],
}

const K1: Parameter = Parameter::Coefficient(0);
const K2: Parameter = Parameter::Coefficient(1);
const K3: Parameter = Parameter::Coefficient(2);
const K4: Parameter = Parameter::Coefficient(3);
const K5: Parameter = Parameter::Coefficient(4);
const K6: Parameter = Parameter::Coefficient(5);
const P1: Parameter = Parameter::Coefficient(6);
const P2: Parameter = Parameter::Coefficient(7);

/// The models that are read. COLMAP's FOV, THIN_PRISM_FISHEYE and RAD_TAN_THIN_PRISM_FISHEYE (7, 10, 11) are not.
pub(super) const CAMERA_MODELS: [CameraModel; 9] = {
    use Parameter::{Focal, FocalX, FocalY, PrincipalX, PrincipalY};
    use Projection::{Fisheye, Perspective};
    const fn model(
        name: &'static str,
        id: u32,
        projection: Projection,
        parameters: &'static [Parameter],
    ) -> CameraModel {
        CameraModel { name, id, projection, parameters }
    }
    [
        model("SIMPLE_PINHOLE", 0, Perspective, &[Focal, PrincipalX, PrincipalY]),
        model("PINHOLE", 1, Perspective, &[FocalX, FocalY, PrincipalX, PrincipalY]),
        model("SIMPLE_RADIAL", 2, Perspective, &[Focal, PrincipalX, PrincipalY, K1]),
        model("RADIAL", 3, Perspective, &[Focal, PrincipalX, PrincipalY, K1, K2]),
        model("OPENCV", 4, Perspective, &[FocalX, FocalY, PrincipalX, PrincipalY, K1, K2, P1, P2]),
        model("OPENCV_FISHEYE", 5, Fisheye, &[FocalX, FocalY, PrincipalX, PrincipalY, K1, K2, K3, K4]),
        model("FULL_OPENCV", 6, Perspective, &[FocalX, FocalY, PrincipalX, PrincipalY, K1, K2, P1, P2, K3, K4, K5, K6]),
        model("SIMPLE_RADIAL_FISHEYE", 8, Fisheye, &[Focal, PrincipalX, PrincipalY, K1]),
        model("RADIAL_FISHEYE", 9, Fisheye, &[Focal, PrincipalX, PrincipalY, K1, K2]),
    ]
};

/// The values of a camera's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parameters {
    pub(super) focal: [f64; 2],
    pub(super) principal: [f64; 2],
    /// `None` for a pinhole.
    pub(super) lens: Option<Lens>,
}

impl CameraModel {
    pub(super) fn named(name: &str) -> Option<CameraModel> {
        CAMERA_MODELS.into_iter().find(|model| model.name.eq_ignore_ascii_case(name))
    }

    pub(super) fn numbered(id: u32) -> Option<CameraModel> {
        CAMERA_MODELS.into_iter().find(|model| model.id == id)
    }

    /// Number of parameters.
    pub(super) fn parameter_count(&self) -> usize {
        self.parameters.len()
    }

    /// The values of parameters in the model's order; missing ones are 0.
    pub(super) fn interpret(&self, numbers: &[f64]) -> Result<Parameters, LensError> {
        let (mut focal, mut principal, mut coefficients) = ([0.0; 2], [0.0; 2], [0.0; 8]);
        for (parameter, &number) in self.parameters.iter().zip(numbers) {
            match *parameter {
                Parameter::Focal => focal = [number; 2],
                Parameter::FocalX => focal[0] = number,
                Parameter::FocalY => focal[1] = number,
                Parameter::PrincipalX => principal[0] = number,
                Parameter::PrincipalY => principal[1] = number,
                Parameter::Coefficient(index) => coefficients[index] = number,
            }
        }
        let lens = Lens::new(self.projection, coefficients)?;
        Ok(Parameters { focal, principal, lens: (!lens.is_pinhole()).then_some(lens) })
    }
}

/// The names of all models, for messages.
pub(super) fn camera_model_names() -> String {
    CAMERA_MODELS.map(|model| model.name).join(", ")
}
