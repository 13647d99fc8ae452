//! Deterministic initialisation: network parameters computed from their names, the same numbers on every machine.
//!
//! Networks of full size can be checked against other implementations without a download if both fill every
//! tensor by the same rule. With `h` the FNV-1a hash (64 bits) of the tensor's name, element `i` (flat, row-major)
//! starts from `z = h + (i + 1) * 0x9E3779B97F4A7C15`, which SplitMix64's finaliser scrambles; its top 24 bits give
//! `u = (z >> 40) / 2^23 - 1`, exact in `f32`, in `[-1, 1)`. What `u` becomes depends on the leaf, the part of the name
//! after the last dot, and on the number of dimensions:
//!
//! | tensor | value |
//! |---|---|
//! | leaf `running_var` | `1 + 0.25 u` |
//! | leaf `running_mean` | `0.125 u` |
//! | leaf `num_batches_tracked` | `0` |
//! | leaf `weight`, one dimension | `1 + 0.125 u` |
//! | leaf `bias` or `in_proj_bias` | `0.125 u` |
//! | two or more dimensions | `sqrt(3 / fan_in) u`, `fan_in` the product of the shape without its first axis |
//!
//! The variance of the last is that of an initialisation that keeps the size of the activations.

use viewfuse_device::parallel::for_each;

/// Elements that are enough work for a core.
const LEAST: usize = 1 << 14;

/// The tensor of that name and shape, flat and row-major. A tensor that the table does not cover (one dimension and
/// another leaf) is `0.125 u`; one without elements is empty.
pub fn tensor(name: &str, shape: &[usize]) -> Vec<f32> {
    let hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    let fan_in: usize = shape.iter().skip(1).product();
    let leaf = name.rsplit('.').next().unwrap_or(name);
    let (offset, factor) = match leaf {
        "running_var" => (1.0, 0.25),
        "running_mean" | "bias" | "in_proj_bias" => (0.0, 0.125),
        "num_batches_tracked" => (0.0, 0.0),
        _ if shape.len() > 1 => (0.0, (3.0 / fan_in as f64).sqrt() as f32),
        "weight" => (1.0, 0.125),
        _ => (0.0, 0.125),
    };
    let mut values = vec![0.0; shape.iter().product()];
    for_each(&mut values, LEAST, |i, value| *value = offset + factor * unit(hash, i));
    values
}

/// Element `i` of the sequence that a hash starts, in `[-1, 1)`.
fn unit(hash: u64, i: usize) -> f32 {
    let z = hash.wrapping_add((i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let z = z ^ (z >> 31);
    ((z >> 40) as i64 - (1 << 23)) as f32 / 8_388_608.0
}
