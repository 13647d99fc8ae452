//! OpenMVG's front end and its incremental engine.

use crate::answer::{Camera, Line, Pair, Photograph, Point, Solution};
use crate::apart::Apart;
use crate::job::{Features, JobPhotograph, PoseJob};
use crate::remembered::{Once, Remembered};
use crate::say;
use openmvg_core::camera::{RadialDistortion, TangentialDistortion};
use openmvg_sfm::model::{ImageMeta, IntrinsicPrior};
use openmvg_sfm::progress::{SfmProgressSink, SfmProgressStage};
use openmvg_sfm::reports::{RunReport, ViewVerdictStatus};
use openmvg_sfm::unstable::SfmWorkspace;
use openmvg_sfm::unstable::adapters::features::{AlpFeatureExtractor, SiftFrontendPreset};
use openmvg_sfm::unstable::adapters::matching::{MatchAcceptance, MatcherType, PairMatcherAdapter};
use openmvg_sfm::unstable::backends::{FeatureExtractor, PairMatcher};
use openmvg_sfm::unstable::types::GeometricModel;
use openmvg_sfm::{
    Camera as Model, Frontend, Incremental, IntrinsicId, Reconstruction, Result, SfmEngine, SfmError, ViewId, ViewPair,
};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The library whose answer it is.
pub(crate) const SOLVER: &str = "openmvg-sfm 0.1.0";

/// Pixels between the library's image coordinates, whose pixel centres are integers, and ours.
const CENTRE: f64 = 0.5;

/// The library's recommended kind of features, as [`Frontend::default`] takes it.
const PRESET: SiftFrontendPreset = SiftFrontendPreset::Quality;

/// Poses for a job's photographs. Of its front end, features and matches are those that are remembered.
pub(crate) fn solve(job: &PoseJob, remembered: &mut Remembered) -> Result<Solution> {
    let told = Told::default();
    let found = remembered.of(job);
    let frontend = Frontend::default().with_max_dimension(Some(job.max_side));
    let extractor: &dyn FeatureExtractor = match job.features {
        Features::Alp => &AlpFeatureExtractor::new(PRESET).with_max_dimension(job.max_side),
        Features::Sift => &frontend.sift().extractor(),
    };
    let matcher = PairMatcherAdapter::new(MatcherType::hnsw_default(), PRESET.ratio(), MatchAcceptance::Reciprocal);
    let mut workspace = workspace(job)?;
    let (extractor, matcher) = (Once { found, by: extractor }, Once { found, by: &matcher as &dyn PairMatcher });
    frontend.stage_with(&mut workspace, Some(&extractor), Some(&matcher), &told)?;
    let (cameras, pairs) = (workspace.camera_models().iter().map(camera).collect(), pairs(&workspace));
    // The library takes a photograph for misplaced whose rotation differs from the median over its pairs by 20 degrees.
    // Of few photographs far apart more than half of the pairs may be matched by chance: it refused true poses. Where
    // focal lengths are guesses it stays.
    let mut config = Incremental::default().config().clone();
    if job.cameras.iter().all(|camera| !camera.is_guess) {
        config = config.with_registration_max_rotation_edge_error(None);
    }
    let (workspace, report) = match Incremental::new(config).runner().progress(&told).run_workspace(workspace) {
        Ok(ended) => ended,
        Err(error) => return Ok(unposed(job, cameras, pairs, &error)),
    };
    let found = &Reconstruction::from_workspace(workspace, SfmEngine::Incremental, false);
    Ok(Solution {
        solver: SOLVER,
        cameras: found.camera_models().iter().map(camera).collect(),
        photographs: photographs(found, &report),
        points: points(found),
        pairs,
        apart: apart(job, found),
    })
}

fn apart(job: &PoseJob, found: &Reconstruction) -> Option<Apart> {
    let sizes: Vec<_> = job.photographs.iter().map(|photograph| photograph.size).collect();
    let cameras: Vec<_> = job.photographs.iter().map(|photograph| photograph.camera).collect();
    Apart::of(found, &sizes, &cameras)
}

/// What is known without a pose: which photographs match.
fn unposed(job: &PoseJob, cameras: Vec<Camera>, pairs: Vec<Pair>, error: &SfmError) -> Solution {
    let photograph = |_| Photograph { camera_from_world: None, reason: Some(error.to_string()) };
    let photographs = job.photographs.iter().map(photograph).collect();
    Solution { solver: SOLVER, cameras, photographs, points: Vec::new(), pairs, apart: None }
}

/// The photographs with one camera for each group, its principal point in the middle; each is matched with each.
fn workspace(job: &PoseJob) -> Result<SfmWorkspace> {
    let mut models = Vec::new();
    for (index, guess) in job.cameras.iter().enumerate() {
        let size = job
            .photographs
            .iter()
            .find(|photograph| photograph.camera == index)
            .map_or([2, 2], |photograph| photograph.size);
        let [x, y] = size.map(|side| f64::from(side) / 2.0 - CENTRE);
        let (radial, tangential) = (RadialDistortion::K1(0.0), TangentialDistortion::None);
        models.push(Model::try_brown_conrady(guess.focal, guess.focal, x, y, radial, tangential)?);
    }
    let meta = |photograph: &JobPhotograph| ImageMeta::path(&photograph.path, photograph.size[0], photograph.size[1]);
    let prior = |is_guess: bool| if is_guess { IntrinsicPrior::Guess } else { IntrinsicPrior::Trusted };
    SfmWorkspace::builder()
        .root_seed(job.seed)
        .image_meta(job.photographs.iter().map(meta))
        .camera_models(models)
        .intrinsic_priors(job.cameras.iter().map(|guess| prior(guess.is_guess)))
        .view_intrinsics(job.photographs.iter().map(|photograph| IntrinsicId::new(photograph.camera)))
        .one_pose_per_view()
        .exhaustive_pairs()
        .build()
}

pub(crate) fn camera(model: &Model) -> Camera {
    match model {
        Model::BrownConrady(lens) => Camera {
            focal: 0.5 * (lens.focal_x() + lens.focal_y()),
            principal: [lens.principal_x() + CENTRE, lens.principal_y() + CENTRE],
            k1: lens.radial_distortion().k1(),
        },
        // No other model was given.
        _ => Camera { focal: 0.0, principal: [0.0; 2], k1: 0.0 },
    }
}

fn photographs(found: &Reconstruction, report: &RunReport) -> Vec<Photograph> {
    let mut all = Vec::new();
    for index in 0..found.view_count() {
        let view = ViewId::new(index);
        let camera_from_world = found.pose(view).map(|record| {
            let (rotation, translation) = (record.pose.rotation_matrix(), record.pose.translation());
            [0, 1, 2].map(|row| [rotation[(row, 0)], rotation[(row, 1)], rotation[(row, 2)], translation[row]])
        });
        let verdict = report.view_verdicts().get(index).map(|verdict| verdict.status());
        let reason = match verdict {
            Some(ViewVerdictStatus::Unregistered { reason }) => Some(reason.to_string()),
            _ => None,
        };
        all.push(Photograph { camera_from_world, reason });
    }
    all
}

fn points(found: &Reconstruction) -> Vec<Point> {
    let mut seen: BTreeMap<usize, Vec<(usize, [f64; 2])>> = BTreeMap::new();
    for observation in found.observations() {
        let place = [observation.pixel.x + CENTRE, observation.pixel.y + CENTRE];
        seen.entry(observation.landmark.index()).or_default().push((observation.view.index(), place));
    }
    let mut of = |landmark: &openmvg_sfm::model::Landmark| {
        let seen = seen.remove(&landmark.id.index())?;
        Some(Point { position: landmark.point.coords.into(), error: landmark.reprojection_error.value(), seen })
    };
    found.landmarks().iter_active().filter_map(&mut of).collect()
}

fn pairs(workspace: &SfmWorkspace) -> Vec<Pair> {
    let pair = |(index, pair): (usize, &ViewPair)| {
        let model = workspace.geometric_model_store().get(index)?;
        let is_general = matches!(model, GeometricModel::Essential { .. } | GeometricModel::Fundamental { .. });
        let photographs = [pair.first().index(), pair.second().index()];
        Some(Pair { photographs, inliers: model.evidence().inlier_count, is_general })
    };
    workspace.pair_graph().pairs().iter().enumerate().filter_map(pair).collect()
}

/// Says how far the work is; stops it when nobody reads that any more.
#[derive(Default)]
struct Told {
    now: Mutex<(usize, usize)>,
    is_alone: AtomicBool,
}

impl Told {
    fn say(&self, stage: SfmProgressStage, of: usize, done: usize) {
        if !say(&Line::Progress { stage: name(stage), of, done }) {
            self.is_alone.store(true, Ordering::Relaxed);
        }
    }
}

impl SfmProgressSink for Told {
    fn begin(&self, stage: SfmProgressStage, total: usize) {
        if let Ok(mut now) = self.now.lock() {
            *now = (total, 0);
        }
        self.say(stage, total, 0);
    }

    fn advance(&self, stage: SfmProgressStage, completed: usize) {
        let Ok(mut now) = self.now.lock() else { return };
        now.1 += completed;
        let (of, done) = *now;
        drop(now);
        self.say(stage, of, done);
    }

    fn is_canceled(&self) -> bool {
        self.is_alone.load(Ordering::Relaxed)
    }
}

/// What a person reads.
fn name(stage: SfmProgressStage) -> &'static str {
    match stage {
        SfmProgressStage::FeatureExtraction => "finding features",
        SfmProgressStage::MatcherPreparation | SfmProgressStage::Matching => "matching features",
        SfmProgressStage::Verification => "verifying pairs",
        SfmProgressStage::RadialCalibration => "estimating the lens",
        SfmProgressStage::TrackBuilding => "building tracks",
        SfmProgressStage::InitialPair | SfmProgressStage::Registration => "registering photographs",
        _ => "bundle adjustment",
    }
}
