//! Weighting by attention with parameters of 8 bits, and fusion of sensors' readings.

use crate::formulas::CHANNELS;
use crate::rig::{Rig, VIEWS};
use crate::{Emit, Inputs, emit_all, wave};
use viewfuse_core::attention::HIDDEN;
use viewfuse_core::attention::quantised::{QuantisedAttention, QuantisedLinear, SourceKeys, quantised_attention};
use viewfuse_core::fuse::{Reading, fuse_readings};
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{Scheme, weigh};

/// Parameters by a formula: constants, which stay in flash memory.
pub static ATTENTION: QuantisedAttention = QuantisedAttention {
    first: layer(1, 3.0),
    second: layer(2, 3.0),
    key: layer(3, 0.6),
    offset: offset(),
    offset_scale: 1.0e-5,
};

const fn offset() -> [i8; HIDDEN] {
    let layer: QuantisedLinear<1, { HIDDEN / 2 }, 1> = layer(4, 1.0);
    let (mut offset, mut input) = ([0; HIDDEN], 0);
    while input < HIDDEN {
        offset[input] = layer.weight[0][input / 2][0][input % 2][0];
        input += 1;
    }
    offset
}

/// A layer with irregular parameters, smaller the more inputs there are.
const fn layer<const P: usize, const N: usize, const B: usize>(first: u32, range: f32) -> QuantisedLinear<P, N, B> {
    let mut layer = QuantisedLinear::ZERO;
    let (mut index, mut row) = (first, 0);
    while row < 4 * B {
        let mut input = 0;
        while input < 2 * P * N {
            // A multiplicative hash.
            index = index.wrapping_mul(0x9e37_79b1).wrapping_add(0x7f4a_7c15);
            layer.weight[row / 4][input / (2 * P)][input / 2 % P][input % 2][row % 4] =
                (((index >> 8) % 255) as i32 - 127) as i8;
            input += 1;
        }
        layer.scale[row / 4][row % 4] = range / (127.0 * (2 * P * N) as f32) * (1.0 + 0.01 * (row % 7) as f32);
        layer.bias[row / 4][row % 4] = ((index >> 16) % 256) as f32 * (0.5 / 256.0);
        row += 1;
    }
    layer
}

/// Another target of the same sources.
pub fn further_target(inputs: Inputs) -> Pose {
    Rig::around(Inputs { phase: inputs.phase + 0.7, ..inputs }, 2.0).target
}

/// What eight sensors of a kind measured: whole numbers up to `most`, negative ones too where the kind has them.
pub fn readings<T: Default + Copy>(inputs: Inputs, whole: impl Fn(f32) -> T) -> [[T; CHANNELS]; VIEWS] {
    let mut readings = [[T::default(); CHANNELS]; VIEWS];
    for (index, reading) in readings.as_flattened_mut().iter_mut().enumerate() {
        *reading = whole(wave(inputs, 900 + index as u32));
    }
    readings
}

/// Readings of a camera.
pub fn bytes(inputs: Inputs) -> [[u8; CHANNELS]; VIEWS] {
    readings(inputs, |wave| (127.5 + 127.5 * wave) as u8)
}

/// Readings of an accelerometer.
pub fn words(inputs: Inputs) -> [[i16; CHANNELS]; VIEWS] {
    readings(inputs, |wave| (32_767.0 * wave) as i16)
}

/// The list of attention with 8 bits, and of readings.
pub fn quantised(inputs: Inputs, emit: Emit) {
    for scale in [2.0, 1.0e-3, 40.0] {
        let Rig { sources, target } = Rig::around(inputs, scale);
        emit_all("8 bits", quantised_attention(&ATTENTION, &sources, &target).values(), emit);
        let keys = SourceKeys::new(&ATTENTION, &sources);
        let mut step = 0;
        while step < 9 {
            let target = further_target(Inputs { phase: inputs.phase + 0.3 * step as f32, ..inputs });
            emit_all("further target", keys.weigh(&ATTENTION, &target).values(), emit);
            step += 1;
        }
    }
    fused("u8", &bytes(inputs), inputs, emit);
    fused("i16", &words(inputs), inputs, emit);
}

fn fused<T: Reading>(name: &str, readings: &[[T; CHANNELS]; VIEWS], inputs: Inputs, emit: Emit) {
    let rig = Rig::around(inputs, 2.0);
    for (_, scheme) in crate::rig::schemes() {
        emit_all(name, &fuse_readings(&weigh(scheme, &rig.sources, &rig.target), readings), emit);
    }
    emit_all(name, &fuse_readings(&weigh(Scheme::ERROR, &rig.sources, &rig.target), readings), emit);
}
