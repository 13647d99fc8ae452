//! The refinement: a network that is pooled over the sources. It adds logits to the sources' parts of a plane's colour, and to
//! the planes' shares. Its last layers start at zero: untrained it is the field.

use super::candidates::{DIRECTION, KEPT, OF_PLANE, OF_SOURCE, POSITION, Pixels, WEIGHT};
use candle_core::{D, DType, Device, Result, Tensor, Var};
use viewfuse_core::random::normal;

/// Width of all layers.
const WIDTH: usize = 16;
/// Logits stay within plus and minus this.
const MAX_LOGIT: f64 = 3.0;
/// Slope of the rectifiers below zero.
const SLOPE: f64 = 0.1;

/// What is learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts {
    /// Only one number for all scenes: a factor on the costs.
    pub(crate) temperature: bool,
    /// Logits of the sources.
    pub(crate) blend: bool,
    /// Logits of the planes.
    pub(crate) planes: bool,
    /// Directions of the sources as inputs.
    pub(crate) directions: bool,
    /// The pixel's position and the plane's disparity as inputs.
    pub(crate) position: bool,
    /// Camera weights in the pooling and as inputs; otherwise only in the blend.
    pub(crate) pooled_weights: bool,
}

/// The layers, by number of inputs and outputs.
const SHAPES: [[usize; 2]; 8] = [
    [OF_SOURCE, WIDTH],
    [WIDTH, WIDTH],
    [2 * WIDTH + OF_PLANE, WIDTH],
    [WIDTH, WIDTH],
    [2 * WIDTH, WIDTH],
    [WIDTH, 1],
    [2 * WIDTH, WIDTH],
    [WIDTH, 1],
];
/// The layers whose outputs are logits.
const PLANE_LOGIT: usize = 5;
const SOURCE_LOGIT: usize = 7;

/// The network.
pub(crate) struct Network {
    parts: Parts,
    /// A matrix and a bias for each layer; of `temperature` a single number.
    pub(crate) variables: Vec<Var>,
    /// 1 for inputs that are used.
    source_mask: Tensor,
    plane_mask: Tensor,
}

/// A picture and how far it is from the field's.
pub(crate) struct Refined {
    /// `[pixel][3]`.
    pub(crate) colours: Tensor,
    /// Mean square of the logits.
    pub(crate) square: Tensor,
}

impl Network {
    /// Untrained.
    pub(crate) fn new(parts: Parts, seed: u64) -> Result<Network> {
        let mut variables = Vec::new();
        if parts.temperature {
            variables.push(Var::zeros(1, DType::F32, &Device::Cpu)?);
        } else {
            for (layer, [inner, outer]) in SHAPES.into_iter().enumerate() {
                let is_last = layer == PLANE_LOGIT || layer == SOURCE_LOGIT;
                let scale = if is_last { 0.0 } else { (2.0 / inner as f32).sqrt() };
                let value = |index: usize| scale * normal([seed as u32, layer as u32], index as u32, 0);
                let matrix = Tensor::from_vec((0..inner * outer).map(value).collect(), (inner, outer), &Device::Cpu)?;
                variables.push(Var::from_tensor(&matrix)?);
                variables.push(Var::zeros(outer, DType::F32, &Device::Cpu)?);
            }
        }
        let mask = |count: usize, used: &dyn Fn(usize) -> bool| {
            let values: Vec<f32> = (0..count).map(|index| if used(index) { 1.0 } else { 0.0 }).collect();
            Tensor::from_vec(values, count, &Device::Cpu)
        };
        let of_source = |index: usize| match index {
            DIRECTION.. => parts.directions,
            WEIGHT => parts.pooled_weights,
            _ => true,
        };
        Ok(Network {
            parts,
            variables,
            source_mask: mask(OF_SOURCE, &of_source)?,
            plane_mask: mask(OF_PLANE, &|index| index < POSITION || parts.position)?,
        })
    }

    /// How many numbers are learned, with those of inputs that a variant does not use.
    pub(crate) fn parameter_count(&self) -> usize {
        let unused = |layer: usize| {
            let heads = [(4..6, self.parts.planes), (6..8, self.parts.blend)];
            heads.iter().any(|(layers, used)| layers.contains(&layer) && !used)
        };
        let used = self.variables.iter().enumerate().filter(|(index, _)| self.parts.temperature || !unused(index / 2));
        used.map(|(_, variable)| variable.elem_count()).sum()
    }

    /// A layer on the last dimension.
    fn layer(&self, layer: usize, input: &Tensor) -> Result<Tensor> {
        let mut shape = input.dims().to_vec();
        let inner = shape.pop().unwrap_or(0);
        let flat = input.reshape(((), inner))?;
        let output = flat.matmul(self.variables[2 * layer].as_tensor())?;
        let output = output.broadcast_add(self.variables[2 * layer + 1].as_tensor())?;
        shape.push(SHAPES[layer][1]);
        output.reshape(shape)
    }

    fn rectified(&self, layer: usize, input: &Tensor) -> Result<Tensor> {
        let output = self.layer(layer, input)?;
        output.maximum(&(&output * SLOPE)?)
    }

    /// The picture.
    pub(crate) fn refine(&self, pixels: &Pixels) -> Result<Refined> {
        let [sources, planes] = self.logits(pixels)?;
        let bounded = |logits: &Tensor| (logits / MAX_LOGIT)?.tanh()? * MAX_LOGIT;
        let (sources, planes) = (bounded(&sources)?, bounded(&planes)?);
        let part = (&pixels.part * sources.exp()?)?;
        let sum = part.unsqueeze(D::Minus1)?.broadcast_mul(&pixels.colour)?.sum(2)?;
        let colour = sum.broadcast_div(&(part.sum_keepdim(2)? + 1.0e-12)?)?;
        let share = (&pixels.share * planes.exp()?)?;
        let sum = (share.unsqueeze(D::Minus1)?.broadcast_mul(&colour)?.sum(1)? + pixels.rest.narrow(1, 0, 3)?)?;
        let all = (share.sum_keepdim(1)? + pixels.rest.narrow(1, 3, 1)?)?;
        let square = (sources.sqr()?.mean_all()? + planes.sqr()?.mean_all()?)?;
        Ok(Refined { colours: sum.broadcast_div(&all)?, square })
    }

    /// Logits of the sources, `[pixel][plane][source]`, and of the planes, `[pixel][plane]`.
    fn logits(&self, pixels: &Pixels) -> Result<[Tensor; 2]> {
        let (count, _, views, _) = pixels.source.dims4()?;
        let none = [pixels.part.zeros_like()?, pixels.share.zeros_like()?];
        let [no_sources, no_planes] = none;
        if self.parts.temperature {
            let excess = pixels.plane.narrow(2, 0, 1)?.squeeze(2)?;
            return Ok([no_sources, excess.broadcast_mul(self.variables[0].as_tensor())?]);
        }
        let source = pixels.source.broadcast_mul(&self.source_mask)?;
        let source = self.rectified(1, &self.rectified(0, &source)?)?;
        let weight = match self.parts.pooled_weights {
            true => (&pixels.part + 1.0e-9)?,
            false => pixels.part.ones_like()?,
        };
        let weight = weight.broadcast_div(&weight.sum_keepdim(2)?)?.unsqueeze(D::Minus1)?;
        let mean = source.broadcast_mul(&weight)?.sum(2)?;
        let spread = source.broadcast_sub(&mean.unsqueeze(2)?)?.sqr()?.broadcast_mul(&weight)?.sum(2)?;
        let plane = pixels.plane.broadcast_mul(&self.plane_mask)?;
        let plane = self.rectified(3, &self.rectified(2, &Tensor::cat(&[mean, spread, plane], 2)?)?)?;
        let planes = match self.parts.planes {
            false => no_planes,
            true => {
                let share = pixels.share.broadcast_div(&pixels.share.sum_keepdim(1)?)?.unsqueeze(D::Minus1)?;
                let around = plane.broadcast_mul(&share)?.sum_keepdim(1)?;
                let around = around.broadcast_as((count, KEPT, WIDTH))?.contiguous()?;
                self.layer(PLANE_LOGIT, &self.rectified(4, &Tensor::cat(&[&plane, &around], 2)?)?)?.squeeze(2)?
            }
        };
        let sources = match self.parts.blend {
            false => no_sources,
            true => {
                let plane = plane.unsqueeze(2)?.broadcast_as((count, KEPT, views, WIDTH))?.contiguous()?;
                self.layer(SOURCE_LOGIT, &self.rectified(6, &Tensor::cat(&[&source, &plane], 3)?)?)?.squeeze(3)?
            }
        };
        Ok([sources, planes])
    }
}
