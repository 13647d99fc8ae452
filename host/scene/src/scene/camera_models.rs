//! Camera models by the names that COLMAP, nerfstudio, instant-ngp and Metashape give them: the meaning of each
//! parameter, in COLMAP's files by position, in `transforms.json` by key.

use viewfuse_core::lens::{Coefficients, Lens, LensError, Projection};

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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CameraModel {
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

/// COLMAP's models that are not read.
const UNREAD_MODELS: [(&str, u32); 7] = [
    ("FOV", 7),
    ("THIN_PRISM_FISHEYE", 10),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 11),
    ("SIMPLE_DIVISION", 12),
    ("DIVISION", 13),
    ("EUCM", 16),
    ("EQUIRECTANGULAR", 17),
];

/// COLMAP's models that are read.
const CAMERA_MODELS: [CameraModel; 11] = {
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
        model("SIMPLE_FISHEYE", 14, Fisheye, &[Focal, PrincipalX, PrincipalY]),
        model("FISHEYE", 15, Fisheye, &[FocalX, FocalY, PrincipalX, PrincipalY]),
    ]
};

/// A lens of `transforms.json`: what its keys mean under a value of `camera_model`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyedLens {
    /// Values of `camera_model`; the first is written.
    pub(crate) models: &'static [&'static str],
    pub(crate) projection: Projection,
    /// Its keys, each with its index into [`Coefficients`].
    pub(crate) keys: &'static [(&'static str, usize)],
}

/// The lenses of `transforms.json`. nerfstudio has one perspective camera for all of COLMAP's perspective models but
/// FULL_OPENCV, whose k4 goes on with the polynomial (r^8), as Metashape's; instant-ngp reads k1, k2, p1, p2 of it.
/// FULL_OPENCV is OpenCV's rational lens. instant-ngp's `is_fisheye` is the last one.
pub(crate) const KEYED_LENSES: [KeyedLens; 3] = [
    KeyedLens {
        models: &["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "SIMPLE_RADIAL", "RADIAL"],
        projection: Projection::Perspective,
        keys: &[("k1", 0), ("k2", 1), ("k3", 2), ("k4", 8), ("p1", 6), ("p2", 7)],
    },
    KeyedLens {
        models: &["FULL_OPENCV"],
        projection: Projection::Perspective,
        keys: &[("k1", 0), ("k2", 1), ("k3", 2), ("k4", 3), ("k5", 4), ("k6", 5), ("p1", 6), ("p2", 7)],
    },
    KeyedLens {
        models: &["OPENCV_FISHEYE", "FISHEYE", "SIMPLE_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"],
        projection: Projection::Fisheye,
        keys: &[("k1", 0), ("k2", 1), ("k3", 2), ("k4", 3)],
    },
];

/// All keys of lenses' numbers: those above, OpenCV's thin prism and tilt, Metashape's affinity, skew and further
/// tangential terms, instant-ngp's f-theta polynomial, COLMAP's FOV. A lens that has not the key needs a 0 there.
pub(super) const LENS_KEYS: &str = "k1 k2 k3 k4 k5 k6 p1 p2 p3 p4 s1 s2 s3 s4 tau_x tau_y b1 b2 \
                                    ftheta_p0 ftheta_p1 ftheta_p2 ftheta_p3 ftheta_p4 omega";

/// nerfstudio's list of a lens's numbers, and the keys whose numbers it holds, in their order.
pub(super) const LENS_LIST: (&str, [&str; 6]) = ("distortion_params", ["k1", "k2", "k3", "k4", "p1", "p2"]);

/// Flags of projections that are not read (instant-ngp), with any numbers.
pub(super) const REFUSED_FLAGS: [&str; 2] = ["equirectangular", "latlong"];

impl KeyedLens {
    pub(super) fn named(name: &str) -> Option<&'static KeyedLens> {
        let is_one = |lens: &&KeyedLens| lens.models.iter().any(|model| model.eq_ignore_ascii_case(name));
        KEYED_LENSES.iter().find(is_one)
    }

    /// The first that has all coefficients of a lens.
    pub(crate) fn of(lens: &Lens) -> Option<&'static KeyedLens> {
        let has = |keyed: &KeyedLens, index: usize| keyed.keys.iter().any(|(_, known)| *known == index);
        let holds = |keyed: &&KeyedLens| {
            let mut coefficients = lens.coefficients().into_iter().enumerate();
            keyed.projection == lens.projection()
                && coefficients.all(|(index, value)| value == 0.0 || has(keyed, index))
        };
        KEYED_LENSES.iter().find(holds)
    }
}

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

    /// COLMAP's name of a number, for messages.
    pub(super) fn title(id: u32) -> String {
        let name = UNREAD_MODELS.iter().find(|(_, known)| *known == id).map(|(name, _)| *name);
        name.map_or_else(|| id.to_string(), |name| format!("{name} ({id})"))
    }

    /// Number of parameters.
    pub(super) fn parameter_count(&self) -> usize {
        self.parameters.len()
    }

    /// The values of parameters in the model's order; missing ones are 0.
    pub(super) fn interpret(&self, numbers: &[f64]) -> Result<Parameters, LensError> {
        let (mut focal, mut principal, mut coefficients) = ([0.0; 2], [0.0; 2], Coefficients::default());
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

/// The names of COLMAP's models that are read, for messages.
pub(super) fn camera_model_names() -> String {
    CAMERA_MODELS.map(|model| model.name).join(", ")
}

/// Those of `transforms.json`.
pub(super) fn keyed_lens_names() -> String {
    KEYED_LENSES.map(|lens| lens.models.join(", ")).join(", ")
}
