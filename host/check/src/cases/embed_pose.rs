//! [`Kernel::EmbedPose`]: the paper's embedding with deterministic initialisation.

use crate::agreement::Limits;
use crate::attention_oracle::embed;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::random;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, HIDDEN, POSE_FEATURES};
use viewfuse_core::pose::PoseBlock;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_nn::initialisation;
use viewfuse_vulkan::kernel::Kernel;

/// Poses and parameters.
#[derive(Clone, Debug)]
pub struct Inputs {
    embedding: Vec<f32>,
    poses: Vec<PoseBlock>,
}

/// The parameters as their names determine them.
fn embedding() -> Vec<f32> {
    let layers = [("0", HIDDEN, POSE_FEATURES), ("2", HIDDEN, HIDDEN), ("4", EMBEDDING, HIDDEN)];
    let layer = |(name, outputs, inputs): (&str, usize, usize)| {
        let weights = initialisation::tensor(&format!("paper.{name}.weight"), &[outputs, inputs]);
        [weights, initialisation::tensor(&format!("paper.{name}.bias"), &[outputs])].concat()
    };
    layers.map(layer).concat()
}

/// See the module.
pub enum EmbedPose {}

impl Case for EmbedPose {
    const KERNEL: Kernel = Kernel::EmbedPose;
    const SEED_COUNT: u64 = 3;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "sines of arguments that are rounded at up to 48 times a centre, then sums over 42, 64 and \
        64 inputs, every rounding counted as if none cancelled";
    const SPOILERS: &'static [Spoiler<Inputs>] =
        &[("embedding", |inputs| inputs.embedding[3] *= 1.01), ("poses", |inputs| inputs.poses[0].right[3] *= 1.01)];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<f32>, D::Buffer<PoseBlock>, D::Buffer<f32>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        let random = &mut random(1, seed, size);
        let scale = [0.3, 1.0, 2.0][seed as usize % 3];
        Inputs { embedding: embedding(), poses: (0..size).map(|_| random.pose(scale).block()).collect() }
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.poses.len()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let embedded = device.zeros(inputs.poses.len() * EMBEDDING)?;
        Ok((device.upload(&inputs.embedding)?, device.upload(&inputs.poses)?, embedded))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.embed_pose(inputs.poses.len() as u32, &loaded.0, &loaded.1, &mut loaded.2)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        device.download(&loaded.2)
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let embedding = FourierEmbedding::from_flat(&inputs.embedding);
        let rows = map(inputs.poses.len(), 1, |pose| embed(&embedding, &inputs.poses[pose]));
        rows.into_iter().flatten().map(Some).collect()
    }
}
