//! The calls of attention with parameters of 32 bits, measured as those of `calls`. 60 kB of parameters lie on the
//! stack: for a processor with an FPU, and memory.
#![no_std]
#![no_main]

use core::hint::black_box;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, PoseEmbedding, cross_attention};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weights::Weights;
use viewfuse_firmware::finish;
use viewfuse_list::Inputs;
use viewfuse_list::attended::fourier;
use viewfuse_list::rig::{Rig, VIEWS};

viewfuse_firmware::measured! {
    fn measured_embed(embedding: &FourierEmbedding, pose: &Pose) -> [f32; EMBEDDING] {
        embedding.embed(pose)
    }

    fn measured_attend(embedding: &FourierEmbedding, sources: &Sources<VIEWS>, target: &Pose) -> Weights<VIEWS> {
        cross_attention(embedding, sources, target)
    }
}

#[viewfuse_firmware::entry]
fn main() -> ! {
    let inputs = black_box(Inputs::STANDARD);
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    let embedding = fourier(inputs);
    black_box(measured_embed(&embedding, &target));
    black_box(measured_attend(&embedding, &sources, &target));
    finish()
}
