//! Whether the photographs of a camera were taken with one focal length: those of a phone whose EXIF is gone may be of
//! several zooms, and poses that suppose one are wrong by a third of the cameras' extent, at a mean error of less than
//! a pixel.

use openmvg_ba::{
    BundleAdjuster, BundleIntrinsic, BundleObservation, BundlePoint, BundlePose, BundleProblem, Gauge,
    IntrinsicCertification, IntrinsicVariables, NativeBundleAdjuster, PoseVariables, ResidualScale, RobustLoss,
    Solution, SolveConfig,
};
use openmvg_core::model::CameraIntrinsics;
use openmvg_core::units::PixelThreshold;
use openmvg_sfm::{Reconstruction, ViewId};
use serde::Serialize;
use std::collections::BTreeMap;

/// Scale of the loss in pixels.
const LOSS_SCALE: f64 = 2.0;
/// Most iterations.
const MAX_ITERATIONS: usize = 100;

/// The same photographs adjusted once more, each with a focal length of its own.
#[derive(Serialize)]
pub(crate) struct Apart {
    /// The loss (Huber's, over all observations), as a share of that with a focal length for each camera.
    pub(crate) loss: f64,
    /// Focal lengths in pixels, in the order of the job; null without a pose.
    pub(crate) focal: Vec<Option<f64>>,
}

impl Apart {
    /// `None` if either adjustment fails. `sizes` are the photographs', `cameras` their cameras.
    pub(crate) fn of(found: &Reconstruction, sizes: &[[u32; 2]], cameras: &[usize]) -> Option<Apart> {
        let views: Vec<usize> =
            (0..found.view_count()).filter(|view| found.pose(ViewId::new(*view)).is_some()).collect();
        let size_of = |camera: usize| cameras.iter().position(|of| *of == camera).map_or([2, 2], |view| sizes[view]);
        let shared: Vec<_> = (0..found.camera_models().len()).map(|camera| (camera, size_of(camera))).collect();
        let apart: Vec<_> = views.iter().map(|view| (cameras[*view], sizes[*view])).collect();
        let together = adjusted(found, &views, &shared, true, |_, view| cameras[view])?;
        let apart = adjusted(found, &views, &apart, false, |index, _| index)?;
        let mut focal = vec![None; found.view_count()];
        for (view, lens) in views.iter().zip(apart.intrinsics()) {
            focal[*view] = Some(crate::solve::camera(lens.camera()).focal);
        }
        let loss = |solution: &Solution| solution.report().final_objective();
        Some(Apart { loss: loss(&apart) / loss(&together).max(f64::MIN_POSITIVE), focal })
    }
}

/// All poses, points and lenses, adjusted. `lenses` are cameras of the reconstruction with the size of their
/// photographs; `lens_of` says which is that of a view, by its index among `views` and its number. With `is_radial`
/// their distortion is adjusted, too: a single photograph does not determine it.
fn adjusted(
    found: &Reconstruction,
    views: &[usize],
    lenses: &[(usize, [u32; 2])],
    is_radial: bool,
    lens_of: impl Fn(usize, usize) -> usize,
) -> Option<Solution> {
    let variables = IntrinsicVariables::default().with_focal(true).with_radial(is_radial);
    let lens = |(camera, [width, height]): &(usize, [u32; 2])| {
        let model = found.camera_models().get(*camera)?.clone();
        let intrinsics = CameraIntrinsics::try_new(model, *width, *height).ok()?;
        // Guesses, which nothing holds.
        let lens = BundleIntrinsic::try_new(intrinsics, variables).ok()?;
        Some(lens.with_certification(IntrinsicCertification::Waived))
    };
    let pose = |view: &usize| Some(BundlePose::new(found.pose(ViewId::new(*view))?.pose.clone(), PoseVariables::FREE));
    let landmarks: Vec<_> = found.landmarks().iter_active().collect();
    let points = landmarks.iter().map(|landmark| BundlePoint::try_new(landmark.point).ok());
    let point_of: BTreeMap<usize, usize> = landmarks.iter().map(|landmark| landmark.id.index()).zip(0..).collect();
    let pose_of: BTreeMap<usize, usize> = views.iter().copied().zip(0..).collect();
    let mut observations = Vec::new();
    for observation in found.observations() {
        let view = observation.view.index();
        if let (Some(pose), Some(point)) = (pose_of.get(&view), point_of.get(&observation.landmark.index())) {
            let lens = lens_of(*pose, view);
            observations.push(BundleObservation::try_new(*pose, lens, *point, observation.pixel).ok()?);
        }
    }
    // The solver holds a lens whose uncertainty it cannot tell: a free gauge, and a loss that is not convex, would add to
    // these.
    let centre = |view: &usize| Some(found.pose(ViewId::new(*view))?.pose.center());
    let first = centre(views.first()?)?;
    let away = |view: &usize| centre(view).map_or(0.0, |centre| (centre - first).norm());
    let (second, distance) = views.iter().map(away).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let scale = ResidualScale::Pixels(PixelThreshold::try_new(LOSS_SCALE).ok()?);
    let problem = BundleProblem::builder(
        views.iter().map(pose).collect::<Option<_>>()?,
        lenses.iter().map(lens).collect::<Option<_>>()?,
        points.collect::<Option<_>>()?,
        observations,
    );
    let problem = problem
        .with_robust_loss(RobustLoss::Huber(scale))
        .with_gauge(Gauge::FixedBaseline { first: 0, second, distance })
        .build()
        .ok()?;
    NativeBundleAdjuster::new().solve(&problem, SolveConfig::default().with_max_iterations(MAX_ITERATIONS)).ok()
}
