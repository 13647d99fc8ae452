//! Test networks: checkpoints with deterministic initialisation, for comparison with other implementations and for
//! timing.

use super::architecture::Architecture;
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse_nn::initialisation;

/// Outputs of test networks are multiplied by this, so that densities vary.
const OUTPUT_GAIN: f32 = 6.0;

/// Every tensor by [`initialisation`]; the density is small everywhere. With [`Architecture::published`] it is the
/// network of the reference values.
pub fn deterministic(architecture: &Architecture) -> Checkpoint {
    computed("formula", architecture, |tensor| {
        let gain = if tensor.name.ends_with("lin_out.weight") { OUTPUT_GAIN } else { 1.0 };
        let mut values = initialisation::tensor(&tensor.name, &tensor.shape);
        values.iter_mut().for_each(|value| *value *= gain);
        values
    })
}

/// A solid, nearly spherical body around the world's origin, of a radius near 0.3, coloured by the views, with empty
/// space outside: a network for measuring omissions.
///
/// It is [`deterministic`] with one channel of the residual stream reserved: its input is the sum of the cosines of the
/// lowest frequency, which decreases with the distance from the origin for any axes of the view; it passes all blocks
/// unchanged, and determines the density.
pub fn body(architecture: &Architecture) -> Checkpoint {
    let frequency_axes = 6..9;
    let frequency = architecture.frequency;
    computed("body", architecture, move |tensor| {
        let TensorShape { name, shape } = tensor;
        let mut values = initial_values(tensor);
        let leaf = name.split_once('.').map_or("", |(_, leaf)| leaf);
        let columns = shape.get(1).copied().unwrap_or(1);
        if !name.starts_with("mlp_") {
            return values;
        }
        match leaf {
            "lin_in.weight" => {
                for (column, value) in values[..columns].iter_mut().enumerate() {
                    *value = if frequency_axes.contains(&column) { 1.0 } else { 0.0 };
                }
            }
            // The sum of three cosines at the surface.
            "lin_in.bias" => values[0] = -3.0 * (frequency * SURFACE_COORDINATE).cos(),
            "lin_out.weight" => {
                let density = &mut values[3 * columns..];
                density.iter_mut().for_each(|value| *value *= DENSITY_NOISE);
                density[0] = DENSITY_SLOPE;
            }
            "lin_out.bias" => values[3] = -DENSITY_OFFSET,
            // Neither the second layers of blocks nor the latents change the channel.
            _ if leaf.ends_with("fc_1.weight") || leaf.contains("lin_z") && leaf.ends_with("weight") => {
                values[..columns].fill(0.0);
            }
            _ if leaf.ends_with("fc_1.bias") || leaf.contains("lin_z") => values[0] = 0.0,
            _ => {}
        }
        values
    })
}

/// Coordinate on each axis of a point of the body's surface on the space diagonal: its radius is 1.73 times that.
const SURFACE_COORDINATE: f32 = 0.18;
/// Density gained for a change of the channel by 1.
const DENSITY_SLOPE: f32 = 2000.0;
/// Density below zero just outside of the surface.
const DENSITY_OFFSET: f32 = 2.0;
/// Factor of the initialisation's own density.
const DENSITY_NOISE: f32 = 0.02;

fn initial_values(tensor: &TensorShape) -> Vec<f32> {
    initialisation::tensor(&tensor.name, &tensor.shape)
}

fn computed(
    label: &str,
    architecture: &Architecture,
    values: impl Fn(&TensorShape) -> Vec<f32> + Send + Sync + 'static,
) -> Checkpoint {
    Checkpoint::computed(label, architecture.tensors(), architecture.metadata(), values)
}

/// [`deterministic`] of the published size, or of the small member of a width.
pub fn deterministic_of_width(width: Option<u16>) -> Checkpoint {
    deterministic(&of_width(width))
}

/// [`body`] of the published size, or of the small member of a width.
pub fn body_of_width(width: Option<u16>) -> Checkpoint {
    body(&of_width(width))
}

fn of_width(width: Option<u16>) -> Architecture {
    width.map_or_else(Architecture::published, |width| Architecture::small(width.into()))
}
