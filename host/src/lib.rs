#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

#[cfg(feature = "check")]
pub use viewfuse_check as check;
pub use viewfuse_core as core;
pub use viewfuse_device as device;
#[cfg(feature = "evaluate")]
pub use viewfuse_evaluate as evaluate;
pub use viewfuse_field as field;
pub use viewfuse_job as job;
pub use viewfuse_kernels as kernels;
pub use viewfuse_nn as nn;
pub use viewfuse_output as output;
#[cfg(feature = "pose")]
pub use viewfuse_pose as pose;
pub use viewfuse_scene as scene;
#[cfg(feature = "view")]
pub use viewfuse_view as view;
pub use viewfuse_vulkan as vulkan;
pub use viewfuse_weighting as weighting;

/// The items of a program that renders: `use viewfuse::prelude::*;`.
pub mod prelude {
    pub use crate::device::cpu::Cpu;
    pub use crate::field::On;
    pub use crate::field::render::{Frame, RenderOptions, RenderRun, render, render_all};
    pub use crate::field::training_free::TrainingFree;
    pub use crate::job::progress::{Progress, Silent};
    pub use crate::scene::Scene;
    pub use crate::scene::few_shot::{PathChoice, Selection};
    pub use crate::weighting::Weighting;
}
