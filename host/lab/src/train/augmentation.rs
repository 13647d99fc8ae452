//! What differs from step to step of a run: sources and the scheme that weighs them.

use super::TrainError;
use super::batch::SourceDraw;
use super::draw::{Draw, Purpose};
use super::run::number;
use clap::Args;
use clap::builder::RangedU64ValueParser;
use serde::{Serialize, Serializer};
use viewfuse_core::weighting::Scheme;
use viewfuse_weighting::{WeightingError, WeightingSpec};

/// What differs from step to step, so that a network works with more than one kind of sources: of each list one is
/// drawn.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Augmentation {
    /// Numbers of sources; each step draws one of the list [default: 1,2,3,3,3,3,4,6 for a PixelNeRF, 1,2,3,3 for a
    /// GeNVS]
    #[arg(long, value_name = "N,N", value_delimiter = ',',
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=256))]
    pub(crate) sources: Vec<usize>,
    // Sides of the sources' pictures, pixels, multiples of 16 up to the settings' side. Empty: that side. Rays are
    // always of pictures of the settings' side. A GeNVS has pictures of one side only: its volumes are made for it.
    #[arg(skip)]
    pub(crate) sides: Vec<u32>,
    /// Let each source show only a square of its photograph, somewhere in it, of at least this share of its side
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser =
        number(|share: &f32| *share > 0.0 && *share <= 1.0, "a number above 0, at most 1, is needed"))]
    pub(crate) least_crop: f32,
    /// The views' weights: a formula, mean, error:alpha=1, ...; of several, each step draws one, and validation has the
    /// first [default: mean]
    // With any other than the mean, an object has one target view in a step, as weights are for one.
    #[arg(long = "weights", value_name = "SCHEME", value_parser = formula)]
    #[serde(serialize_with = "texts")]
    pub(crate) schemes: Vec<Scheme>,
}

fn formula(text: &str) -> Result<Scheme, String> {
    let spec: WeightingSpec = text.parse().map_err(|error: WeightingError| error.to_string())?;
    spec.formula()
        .ok_or_else(|| "networks are trained with formulas only (`train weighting` trains attention)".to_owned())
}

impl Augmentation {
    /// The same with these numbers of sources and equal weights where none are said.
    pub(crate) fn or(mut self, sources: &[usize]) -> Augmentation {
        if self.sources.is_empty() {
            self.sources = sources.to_vec();
        }
        if self.schemes.is_empty() {
            self.schemes.push(Scheme::MEAN);
        }
        self
    }

    /// The largest number of sources.
    pub(crate) fn most_sources(&self) -> usize {
        self.sources.iter().copied().max().unwrap_or(1)
    }

    /// Refuses sources larger than pictures of this side.
    pub(crate) fn check(&self, side: u32) -> Result<(), TrainError> {
        match self.sides.iter().find(|size| **size > side) {
            None => Ok(()),
            Some(wrong) => Err(TrainError::Setting {
                name: "sides",
                value: f64::from(*wrong),
                allowed: "it must be a multiple of 16 from 16 to the side",
            }),
        }
    }

    /// The sources of a step, and its scheme.
    pub(crate) fn drawn(&self, draw: &Draw) -> (SourceDraw, Scheme) {
        let pick = |purpose, count| draw.below(purpose, 0, count);
        let count = self.sources[pick(Purpose::SourceCount, self.sources.len())];
        let side = self.sides.get(pick(Purpose::Sides, self.sides.len())).copied();
        let scheme = self.schemes[pick(Purpose::Schemes, self.schemes.len())];
        (SourceDraw { count, side, least_crop: self.least_crop }, scheme)
    }
}

fn texts<S: Serializer>(schemes: &[Scheme], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(schemes.iter().map(Scheme::to_string))
}
