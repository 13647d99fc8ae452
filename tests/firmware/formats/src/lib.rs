//! Every error and every value of core that a firmware may log has defmt's `Format`. Only compiled, by
//! `tests/embedded/defmt.rs`, which also finds a type that is not here.
#![no_std]
#![forbid(unsafe_code)]

use viewfuse_core::attention::quantised::SourceKeys;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError, Projection, Ray};
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::fuse::VisibleFusion;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::lens::{self, Lens, LensError, Undistorted};
use viewfuse_core::pose::{Pose, PoseError};
use viewfuse_core::rays::{RayPoint, TargetRay};
use viewfuse_core::sampler::churn::{Churn, Churned};
use viewfuse_core::sampler::control::Verdict;
use viewfuse_core::sampler::{Corrected, History, Mix, Sampler, UnknownSampler};
use viewfuse_core::schedule::{HeunStep, NoiseSchedule, Preconditioning, ScheduleError};
use viewfuse_core::sources::{Sources, SourcesError};
use viewfuse_core::weighting::{AngleKind, Choice, Formula, Parameter, Row, Scheme, SchemeError};
use viewfuse_core::weights::{Omission, Weights};

fn has_format<T: defmt::Format>() {}

/// Compiles only if all of them have it.
pub fn all() {
    has_format::<(SourceKeys<8>, Camera, Pinhole, PinholeError)>();
    has_format::<(Projection, Ray, Composite<3>, Compositor<3>)>();
    has_format::<(VisibleFusion<3>, lens::Projection, Lens)>();
    has_format::<(LensError, Undistorted<f32>, Undistorted<f64>)>();
    has_format::<(Pose, PoseError, RayPoint, TargetRay)>();
    has_format::<(Churn, Churned, Verdict, Corrected)>();
    has_format::<(History, Mix, Sampler, UnknownSampler)>();
    has_format::<(HeunStep, NoiseSchedule, Preconditioning, ScheduleError)>();
    has_format::<(Sources<8>, SourcesError, AngleKind, Choice)>();
    has_format::<(Formula, Parameter, Row, Scheme)>();
    has_format::<(SchemeError, Omission<8>, Weights<8>, ProjectedGaussian)>();
}

/// As a firmware logs them.
pub fn logged(error: PoseError, weights: &Weights<8>) {
    defmt::error!("{}", error);
    defmt::info!("weights {}", weights);
}
