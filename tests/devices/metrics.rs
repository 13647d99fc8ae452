//! Metrics' networks on each device give the CPU's scores.

use crate::candidate::{Candidate, Test};
use image::RgbImage;
use libtest_mimic::Failed;
use std::collections::BTreeMap;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse::evaluate::metrics::convention::Convention;
use viewfuse::evaluate::metrics::dists::Dists;
use viewfuse::evaluate::metrics::heads::{published_dists, published_lpips};
use viewfuse::evaluate::metrics::lpips::{Lpips, LpipsTrunk};
use viewfuse::evaluate::metrics::trunk::{Convolution, Pooling, Step, tensors, vgg16};
use viewfuse::evaluate::metrics::{Metrics, Scored};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::nn::initialisation;
use viewfuse_vulkan::GpuOptions;

pub(crate) const TESTS: &[Test] = &[Test::new("metrics_are_the_cpus", metrics_are_the_cpus)];

/// A picture with slopes and edges; the shift moves the edges.
fn picture(shift: u32) -> RgbImage {
    RgbImage::from_fn(48, 40, |x, y| {
        let edge = if (x + shift) / 7 % 2 == y / 9 % 2 { 90 } else { 0 };
        [x * 3, y * 4, x + y].map(|level| (level + edge) as u8).into()
    })
}

fn made(steps: &[Step<Convolution>]) -> Checkpoint {
    Checkpoint::computed("formula", tensors(steps, 3).0, BTreeMap::new(), |tensor| {
        initialisation::tensor(&tensor.name, &tensor.shape)
    })
}

/// LPIPS with the two small networks, whose layers stand in a row and beside one another, and DISTS.
fn scores<D: Device>(device: &D) -> Result<Vec<Scored>, Failed> {
    let lpips = |kind: LpipsTrunk| -> Result<Lpips<D>, Failed> {
        Ok(Lpips::new(device, kind, &made(&kind.steps()), &published_lpips(kind)?)?)
    };
    let metrics = Metrics {
        convention: Convention::Plain,
        lpips: vec![lpips(LpipsTrunk::Alex)?, lpips(LpipsTrunk::Squeeze)?],
        dists: Some(Dists::new(device, &made(&vgg16(Pooling::L2)), &published_dists()?)?),
        inception: None,
    };
    Ok(metrics.compare(device, &picture(0), &picture(2), None)?)
}

fn metrics_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let (actual, expected) = (scores(&candidate.vulkan(&GpuOptions::default())?)?, scores(&Cpu)?);
    assert_eq!(expected.len(), 5);
    for (actual, expected) in actual.iter().zip(&expected) {
        let is_near = (actual.value - expected.value).abs() <= 1.0e-5 * expected.value;
        if actual.name != expected.name || !is_near || expected.value <= 0.0 {
            return Err(format!("{actual:?} is not {expected:?}").into());
        }
    }
    Ok(())
}
