//! The family of networks: which tensors a checkpoint must have, by its sizes.
//!
//! Names and shapes are those of the official `state_dict` (pixelNeRF, `src/model/{models,encoder,resnetfc}.py`; the
//! trunk is torchvision's ResNet of basic blocks). Sizes are read from the tensors: trunk width and depth, the number
//! of trunk levels for latents, the width and depth of the two point networks, the number of `lin_z` layers.

pub use viewfuse_nn::resnet::Level;

use std::collections::BTreeMap;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError, Sizes, TensorShape};
use viewfuse_nn::resnet;

/// The most octaves: sines of more are noise in `f32`.
const MAX_OCTAVES: usize = 20;

/// Sizes of a member of the family.
#[derive(Clone, Debug, PartialEq)]
pub struct Architecture {
    /// Channels after the first convolution (7x7, stride 2).
    pub stem_channels: usize,
    /// The levels behind it whose images are part of the latents.
    pub levels: Vec<Level>,
    /// Width of the point networks.
    pub width: usize,
    /// Residual blocks of a point network.
    pub block_count: usize,
    /// Blocks with a latent layer `lin_z` in front; behind them the views are combined.
    pub injected_count: usize,
    /// Octaves of sines and cosines.
    pub frequency_count: usize,
    /// Lowest angular frequency, radians a world unit.
    pub frequency: f32,
    /// Whether there is a second point network for the fine pass. Without one the first serves both.
    pub has_fine: bool,
    /// Whether the trunk has its max pool ([`resnet::ResNet::has_pool`]). The networks for 64 pixels have none
    /// (`use_first_pool=False` of `conf/exp/sn64.conf`), which their tensors do not tell.
    pub has_pool: bool,
    /// Where in a pixel its centre is; see [`viewfuse_core::rays::CastBlock::pixel_centre`]. 0 as published.
    pub pixel_centre: f32,
    /// Longest side of source photographs, pixels: the size at which the network was trained. Larger ones are resized,
    /// since the trunk's features are of that size.
    pub source_side: u32,
}

/// Longest side of the published networks' source photographs; also of checkpoints that do not tell theirs.
const SOURCE_SIDE: u32 = 128;
/// The largest side that a checkpoint may tell.
const MAX_SIDE: f32 = 65536.0;
/// The largest frequency.
const MAX_FREQUENCY: f32 = 1000.0;
/// Radians by which a phase may be off: pi/2 in half precision.
const MAX_PHASE_ERROR: f32 = 1.0e-3;

const FIRST_POOL: &str = "viewfuse.first_pool";
const FREQUENCY: &str = "viewfuse.frequency";
const PIXEL_CENTRE: &str = "viewfuse.pixel_centre";
const SIDE: &str = "viewfuse.source_side";
/// All keys of a checkpoint's metadata that are looked at.
pub const KEYS: [&str; 4] = [FIRST_POOL, FREQUENCY, PIXEL_CENTRE, SIDE];

/// The two point networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The first pass's.
    Coarse,
    /// The second's.
    Fine,
}

impl Pass {
    /// The prefix of its tensors' names.
    pub fn prefix(self) -> &'static str {
        match self {
            Pass::Coarse => "mlp_coarse",
            Pass::Fine => "mlp_fine",
        }
    }
}

impl Architecture {
    /// The published network (`conf/exp/srn.conf`).
    pub fn published() -> Architecture {
        let level = |channels, block_count| Level { channels, block_count };
        Architecture {
            stem_channels: 64,
            levels: vec![level(64, 3), level(128, 4), level(256, 6)],
            width: 512,
            block_count: 5,
            injected_count: 3,
            frequency_count: 6,
            frequency: 1.5,
            has_fine: true,
            has_pool: true,
            pixel_centre: 0.0,
            source_side: SOURCE_SIDE,
        }
    }

    /// A small member for machines without a GPU: a fraction of the published trunk, point networks of this width.
    pub fn small(width: usize) -> Architecture {
        let level = |channels, block_count| Level { channels, block_count };
        let stem_channels = (width / 4).max(4);
        Architecture {
            stem_channels,
            levels: vec![level(stem_channels, 1), level(2 * stem_channels, 1)],
            width,
            ..Architecture::published()
        }
    }

    /// The same with `count` levels of the trunk: each new one has twice the channels of the one before it, and one
    /// block.
    pub fn with_levels(mut self, count: usize) -> Architecture {
        self.levels.truncate(count);
        while self.levels.len() < count {
            let before = self.levels.last().map_or(self.stem_channels, |level| level.channels);
            self.levels.push(Level { channels: 2 * before, block_count: 1 });
        }
        self
    }

    /// Multiply-adds of a point network at a point that so many views see, where the grids hold `lin_z` outputs.
    pub fn point_multiply_adds(&self, view_count: u64) -> u64 {
        let [width, blocks, injected] = [self.width, self.block_count, self.injected_count].map(|size| size as u64);
        let block = 2 * width * width;
        view_count * (self.embedded_len() as u64 * width + injected * block) + (blocks - injected) * block + 4 * width
    }

    /// Channels of the latents: those of the stem and of all levels behind one another.
    pub fn latent_channels(&self) -> usize {
        self.stem_channels + self.levels.iter().map(|level| level.channels).sum::<usize>()
    }

    /// Inputs of the point networks for a point in a view.
    pub fn embedded_len(&self) -> usize {
        6 + 6 * self.frequency_count
    }

    /// The point networks there are.
    pub fn passes(&self) -> &'static [Pass] {
        if self.has_fine { &[Pass::Coarse, Pass::Fine] } else { &[Pass::Coarse] }
    }

    /// Reads the sizes from a checkpoint's tensors, and checks that it has every tensor of the architecture and no
    /// other.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family.
    pub fn of(checkpoint: &Checkpoint) -> Result<Architecture, CheckpointError> {
        let sizes = Sizes::new(checkpoint, "PixelNeRF");
        let stem_channels = sizes.size("encoder.model.conv1.weight", 4, 0)?;
        let width = sizes.size("mlp_coarse.lin_in.weight", 2, 0)?;
        let embedded_len = sizes.size("mlp_coarse.lin_in.weight", 2, 1)?;
        if embedded_len < 12 || embedded_len % 6 != 0 || embedded_len > 6 + 6 * MAX_OCTAVES {
            return Err(sizes.refuse(format!(
                "mlp_coarse.lin_in.weight takes {embedded_len} numbers a point; this family takes 6 + 6 x octaves (a \
                 point with sines and cosines, and a direction), at most {MAX_OCTAVES}"
            )));
        }
        let block_count = sizes.count(|block| format!("mlp_coarse.blocks.{block}.fc_0.weight"));
        let injected_count = sizes.count(|block| format!("mlp_coarse.lin_z.{block}.weight"));
        if block_count == 0 || injected_count == 0 || injected_count > block_count {
            return Err(sizes.refuse(format!(
                "mlp_coarse has {block_count} blocks and {injected_count} latent layers (lin_z); at least one of each \
                 is needed, and no more latent layers than blocks"
            )));
        }
        let latent_channels = sizes.size("mlp_coarse.lin_z.0.weight", 2, 1)?;
        let mut levels = Vec::new();
        let mut channels = stem_channels;
        while channels < latent_channels {
            let level = levels.len() + 1;
            let block_count = sizes.count(|block| format!("encoder.model.layer{level}.{block}.conv1.weight"));
            if block_count == 0 {
                return Err(sizes.refuse(format!(
                    "the point networks take latents of {latent_channels} channels, but the trunk's levels up to \
                     layer{} have {channels} and there is no layer{level}",
                    level - 1
                )));
            }
            let width = sizes.size(&format!("encoder.model.layer{level}.0.conv1.weight"), 4, 0)?;
            channels += width;
            levels.push(Level { channels: width, block_count });
        }
        if channels != latent_channels {
            return Err(sizes.refuse(format!(
                "the point networks take latents of {latent_channels} channels; the trunk's levels up to layer{} have \
                 {channels}",
                levels.len()
            )));
        }
        let architecture = Architecture {
            stem_channels,
            levels,
            width,
            block_count,
            injected_count,
            frequency_count: (embedded_len - 6) / 6,
            frequency: frequency(&sizes, (embedded_len - 6) / 6)?,
            has_fine: checkpoint.shapes().keys().any(|name| name.starts_with("mlp_fine.")),
            has_pool: has_pool(&sizes)?,
            pixel_centre: sizes.number_that(
                PIXEL_CENTRE,
                0.0,
                |centre| (0.0..=1.0).contains(&centre),
                "from 0 to 1",
            )?,
            source_side: source_side(&sizes)?,
        };
        checkpoint.check(&architecture.tensors(), |name| architecture.is_optional(name))?;
        Ok(architecture)
    }

    /// What is assumed of a network whose tensors and metadata leave something open, as a warning: whether there is a max
    /// pool, the size of its sources, where a pixel's centre is. `None` for a network that says all, and for one of
    /// another family.
    pub fn assumption(checkpoint: &Checkpoint) -> Option<String> {
        let is_of_family = checkpoint.shapes().contains_key("encoder.model.conv1.weight");
        let says = |key: &str| checkpoint.metadata().contains_key(key);
        let side = format!("sources of {SOURCE_SIDE} pixels");
        let open = [
            // The laboratory's networks, all with a pool, told where a pixel's centre is before they told this.
            (!says(FIRST_POOL) && !says(PIXEL_CENTRE), FIRST_POOL, "a max pool in the trunk"),
            (!says(SIDE), SIDE, side.as_str()),
            (!says(PIXEL_CENTRE), PIXEL_CENTRE, "pixel centres at 0 (0.5 in the laboratory's networks)"),
        ];
        let open = || open.into_iter().filter(|(is_open, ..)| *is_open);
        (is_of_family && open().next().is_some()).then(|| {
            let assumed = open().map(|(_, _, what)| what).collect::<Vec<_>>().join(", ");
            let keys = open().map(|(_, key, _)| key).collect::<Vec<_>>().join(", ");
            format!(
                "{}: what its tensors do not tell is assumed to be as in the authors' srn_car: {assumed} (their sn64 \
                 has no pool, and 64 pixels); keep the file as EXPERIMENT/pixel_nerf_latest, as their archive has it, \
                 or have `viewfuse convert` write what is right into it: {keys}",
                checkpoint.path().display()
            )
        })
    }

    /// All required tensors, in the order of the data.
    pub fn tensors(&self) -> Vec<TensorShape> {
        let mut tensors = resnet::tensors("encoder.model", self.stem_channels, &self.levels);
        for pass in self.passes() {
            let prefix = pass.prefix();
            linear(&mut tensors, &format!("{prefix}.lin_in"), self.width, self.embedded_len());
            linear(&mut tensors, &format!("{prefix}.lin_out"), 4, self.width);
            for block in 0..self.block_count {
                linear(&mut tensors, &format!("{prefix}.blocks.{block}.fc_0"), self.width, self.width);
                linear(&mut tensors, &format!("{prefix}.blocks.{block}.fc_1"), self.width, self.width);
            }
            for block in 0..self.injected_count {
                linear(&mut tensors, &format!("{prefix}.lin_z.{block}"), self.width, self.latent_channels());
            }
        }
        tensors
    }

    /// Optional tensors of official checkpoints: unused trunk levels, counters, and buffers that are computed from
    /// other values.
    fn is_optional(&self, name: &str) -> bool {
        let unused_level = name
            .strip_prefix("encoder.model.layer")
            .and_then(|rest| rest.split('.').next()?.parse::<usize>().ok())
            .is_some_and(|level| level > self.levels.len());
        const BUFFERS: [&str; 8] = [
            "code._freqs", "code._phases", "poses", "image_shape", "focal", "c", "encoder.latent",
            "encoder.latent_scaling",
        ];
        unused_level
            || name.ends_with(".num_batches_tracked")
            || name.starts_with("encoder.model.fc.")
            || BUFFERS.contains(&name)
    }

    /// Sizes in a checkpoint's metadata that its tensors do not determine.
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let number = |key: &str, value: f32| (key.to_owned(), value.to_string());
        BTreeMap::from([
            number(FREQUENCY, self.frequency),
            number(FIRST_POOL, if self.has_pool { 1.0 } else { 0.0 }),
            number(PIXEL_CENTRE, self.pixel_centre),
            number(SIDE, self.source_side as f32),
        ])
    }

    /// The number of required parameters.
    pub fn parameter_count(&self) -> usize {
        self.tensors().iter().map(|tensor| tensor.shape.iter().product::<usize>()).sum()
    }
}

fn linear(tensors: &mut Vec<TensorShape>, name: &str, out_count: usize, in_count: usize) {
    tensors.push(TensorShape { name: format!("{name}.weight"), shape: vec![out_count, in_count] });
    tensors.push(TensorShape { name: format!("{name}.bias"), shape: vec![out_count] });
}

/// The longest side of source photographs, from the metadata.
fn source_side(sizes: &Sizes<'_>) -> Result<u32, CheckpointError> {
    let fits = |side: f32| (1.0..=MAX_SIDE).contains(&side) && side.fract() == 0.0;
    Ok(sizes.number_that(SIDE, SOURCE_SIDE as f32, fits, "a whole number from 1 to 65536")? as u32)
}

/// Whether there is a max pool, from the metadata.
fn has_pool(sizes: &Sizes<'_>) -> Result<bool, CheckpointError> {
    Ok(sizes.number_that(FIRST_POOL, 1.0, |pool| pool == 0.0 || pool == 1.0, "0 or 1")? == 1.0)
}

/// The lowest frequency: from the checkpoint's table if it has one, which its metadata may not contradict, otherwise from
/// these or the published one.
fn frequency(sizes: &Sizes<'_>, octaves: usize) -> Result<f32, CheckpointError> {
    const TABLE: &str = "code._freqs";
    let published = Architecture::published();
    let told = |otherwise: f32| {
        let fits = |frequency: f32| frequency > 0.0 && frequency <= MAX_FREQUENCY;
        sizes.number_that(FREQUENCY, otherwise, fits, "above 0 and at most 1000")
    };
    check_phases(sizes, octaves)?;
    let Some(shape) = sizes.shape(TABLE) else {
        // The same number of inputs has a network that takes sines of directions, too.
        if octaves > published.frequency_count && !sizes.checkpoint().metadata().contains_key(FREQUENCY) {
            return Err(sizes.refuse(format!(
                "mlp_coarse.lin_in.weight takes {} numbers a point: {octaves} octaves, or fewer and those of \
                 directions (use_code_viewdirs), which is not supported; with the tensor {TABLE} or the metadata \
                 {FREQUENCY} they are octaves",
                6 + 6 * octaves
            )));
        }
        return told(published.frequency);
    };
    // Each frequency stands twice, for sine and cosine.
    if shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side)) != Some(2 * octaves) {
        return Err(sizes.refuse(format!("{TABLE} has the shape {shape:?} instead of 2 x {octaves} numbers")));
    }
    let table = sizes.checkpoint().tensor(TABLE)?;
    let lowest = table.first().copied().unwrap_or(published.frequency);
    let is_octaves = table.iter().zip(0..).all(|(value, index)| *value == lowest * 2_f32.powi(index / 2));
    if !is_octaves || !(lowest > 0.0) {
        return Err(sizes.refuse(format!("{TABLE} does not hold octaves of one frequency")));
    }
    let told = told(lowest)?;
    if told != lowest {
        return Err(sizes.refuse(format!("its metadata says {FREQUENCY} = {told}, and {TABLE} begins with {lowest}")));
    }
    Ok(lowest)
}

/// Rejects a table of phases other than those of sine and cosine, in turns.
fn check_phases(sizes: &Sizes<'_>, octaves: usize) -> Result<(), CheckpointError> {
    const TABLE: &str = "code._phases";
    let Some(shape) = sizes.shape(TABLE) else { return Ok(()) };
    let holds_octaves = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side)) == Some(2 * octaves);
    let phase = |index: usize| if index.is_multiple_of(2) { 0.0 } else { std::f32::consts::FRAC_PI_2 };
    let is_usual =
        |table: &[f32]| table.iter().enumerate().all(|(at, value)| (value - phase(at)).abs() < MAX_PHASE_ERROR);
    if !holds_octaves || !is_usual(&sizes.checkpoint().tensor(TABLE)?) {
        return Err(sizes.refuse(format!("{TABLE} does not hold 0 and pi/2 in turns for {octaves} octaves")));
    }
    Ok(())
}
