//! Requests of the page, as JSON, checked.

use serde::{Deserialize, Serialize};
use viewfuse_core::pose::{Pose, PoseError};
use viewfuse_weighting::{Weighting, WeightingError, WeightingSpec};

/// Longest side of coarse pictures, in pixels.
pub const COARSE_SIDE: u32 = 160;
/// Longest side of pictures of a live field while the camera moves, at most, in pixels.
pub(crate) const MAX_LIVE_SIDE: u32 = 1024;

/// Most frames of a video: ten seconds.
pub(crate) const MAX_FRAMES: usize = 240;

/// Most characters of a tab's name.
const LONGEST_TAB: usize = 40;

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RequestError {
    /// It is not the JSON that the page sends.
    #[error("the request cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// The matrix is no camera pose.
    #[error("the pose is invalid: {0}")]
    Pose(PoseError),
    /// There is no such scheme.
    #[error(transparent)]
    Weighting(#[from] WeightingError),
    /// The scheme would read a file that was not named when the program was started.
    #[error("the scheme '{0}' reads a file; only the scheme that the program was started with may")]
    File(String),
    /// A video is too long, or too short.
    #[error("a video has from 2 to {MAX_FRAMES} frames, not {0}")]
    Frames(usize),
    /// The name of the tab is too long.
    #[error("the name of the tab has more than {LONGEST_TAB} characters")]
    Tab,
}

/// What is shown besides the picture.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Layer {
    /// Nothing.
    #[default]
    None,
    /// Depth along the principal axis.
    Depth,
    /// How far each pixel can be relied on.
    Confidence,
}

/// A request for a picture, as the page writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    tab: String,
    /// World from camera, row-major, OpenCV axes.
    pose: [[f32; 4]; 4],
    scheme: String,
    #[serde(default)]
    layer: Layer,
    #[serde(default)]
    moving: bool,
    #[serde(default)]
    side: Option<u32>,
}

/// A checked request for a picture, or for weights alone.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    /// Which tab of the browser it comes from.
    pub(crate) tab: String,
    /// The camera.
    pub(crate) pose: Pose,
    /// The weighting.
    pub(crate) weighting: Weighting,
    /// What is shown besides the picture.
    pub(crate) layer: Layer,
    /// The hand is moving: a coarse picture, soon.
    pub(crate) is_moving: bool,
    /// Longest side of a coarse picture, at most.
    pub(crate) most_side: u32,
}

impl Request {
    /// Reads a request. `first` is the weighting that the program was started with, which may be one of a file.
    pub(crate) fn read(text: &[u8], first: &Weighting) -> Result<Request, RequestError> {
        let Written { tab, pose, scheme, layer, moving, side } = serde_json::from_slice(text)?;
        if tab.len() > LONGEST_TAB {
            return Err(RequestError::Tab);
        }
        let weighting = weighting_of(scheme, first)?;
        Ok(Request {
            tab,
            pose: Pose::from_opencv(&pose).map_err(RequestError::Pose)?,
            weighting,
            layer,
            is_moving: moving,
            most_side: side.unwrap_or(COARSE_SIDE).clamp(1, MAX_LIVE_SIDE),
        })
    }
}

/// The weighting of this name. `first` is the one that the program was started with, which may be one of a file.
fn weighting_of(scheme: String, first: &Weighting) -> Result<Weighting, RequestError> {
    if scheme == first.to_string() {
        return Ok(first.clone());
    }
    let spec: WeightingSpec = scheme.parse()?;
    match spec.file() {
        Some(_) => Err(RequestError::File(scheme)),
        None => Ok(spec.open().map_err(WeightingError::from)?),
    }
}

/// A request for a video, as the page writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenPath {
    /// World from camera, row-major, OpenCV axes: one a frame.
    poses: Vec<[[f32; 4]; 4]>,
    /// Null for the one that is chosen for the scene.
    scheme: Option<String>,
}

/// A checked request for a video.
#[derive(Clone, Debug)]
pub(crate) struct VideoRequest {
    /// The cameras, one a frame.
    pub(crate) poses: Vec<Pose>,
    /// The weighting; `None` for the one that is chosen for the scene.
    pub(crate) weighting: Option<Weighting>,
}

impl VideoRequest {
    /// Reads a request; `first` as of [`Request::read`].
    pub(crate) fn read(text: &[u8], first: &Weighting) -> Result<VideoRequest, RequestError> {
        let WrittenPath { poses, scheme } = serde_json::from_slice(text)?;
        if !(2..=MAX_FRAMES).contains(&poses.len()) {
            return Err(RequestError::Frames(poses.len()));
        }
        let poses = poses.iter().map(|pose| Pose::from_opencv(pose).map_err(RequestError::Pose));
        let weighting = scheme.map(|scheme| weighting_of(scheme, first)).transpose()?;
        Ok(VideoRequest { poses: poses.collect::<Result<_, _>>()?, weighting })
    }
}

#[cfg(test)]
mod tests {
    use super::{COARSE_SIDE, Layer, MAX_LIVE_SIDE, Request};
    use viewfuse_core::pose::Pose;
    use viewfuse_weighting::Weighting;

    fn read(change: impl Fn(&mut serde_json::Value)) -> Result<Request, String> {
        let mut value = serde_json::json!({"tab": "a", "pose": Pose::IDENTITY.to_opencv(), "scheme": "mean"});
        change(&mut value);
        let first = Weighting::default_scheme();
        Request::read(value.to_string().as_bytes(), &first).map_err(|error| error.to_string())
    }

    #[test]
    fn defaults() {
        let request = read(|_| {}).expect("a request");
        assert_eq!((request.tab.as_str(), request.pose, request.layer), ("a", Pose::IDENTITY, Layer::None));
        assert_eq!((request.is_moving, request.most_side), (false, COARSE_SIDE));
        assert_eq!(request.weighting.to_string(), "mean");
    }

    #[test]
    fn what_the_page_never_sends_is_refused() {
        for (key, value, part) in [
            ("pose", serde_json::json!([[1, 0, 0, 0]]), "cannot be read"),
            ("pose", serde_json::json!([[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "scaled"),
            ("scheme", "median".into(), "unknown weighting scheme"),
            ("scheme", "attention:/etc/passwd".into(), "reads a file"),
            ("layer", "albedo".into(), "cannot be read"),
            ("side", (-1).into(), "cannot be read"),
            ("tab", "x".repeat(100).into(), "40"),
            ("file", "x".into(), "unknown field"),
        ] {
            let error = read(|request| request[key] = value.clone()).expect_err(key);
            assert!(error.contains(part), "{key}: {error}");
        }
        assert_eq!(read(|request| request["side"] = 100_000.into()).expect("a request").most_side, MAX_LIVE_SIDE);
    }
}
