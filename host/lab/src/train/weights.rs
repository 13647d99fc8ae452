//! The views' weights of a batch by a formula.

use candle_core::{DType, Device, Error, Result, Tensor};
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{Scheme, weigh};
use viewfuse_weighting::sources::SourcePoses;

/// Weights `[object][view]` by a scheme, for one target of each object, from the objects' sources `[object][view]`, of
/// which each object has as many.
pub(crate) fn of_scheme<'a>(
    scheme: Scheme,
    sources: &[Vec<Camera>],
    targets: impl Iterator<Item = &'a Camera>,
    dtype: DType,
) -> Result<Tensor> {
    let mut weights = Vec::new();
    for (sources, target) in sources.iter().zip(targets) {
        let poses: Vec<Pose> = sources.iter().map(|camera| camera.pose).collect();
        let poses = SourcePoses::new(&poses).map_err(Error::wrap)?;
        weights.extend_from_slice(&weigh(scheme, &poses, &target.pose).values()[..sources.len()]);
    }
    Tensor::from_vec(weights, (sources.len(), sources[0].len()), &Device::Cpu)?.to_dtype(dtype)
}
