//! What differs from step to step of a run: sources and the scheme that weighs them.

use super::TrainError;
use super::batch::SourceDraw;
use super::draw::{Draw, Purpose};
use serde::{Serialize, Serializer};
use viewfuse_core::weighting::Scheme;
use viewfuse_weighting::sources::MAX_SOURCES;

/// What differs from step to step, so that a network works with more than one kind of sources: of each list one is
/// drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Augmentation {
    /// Numbers of sources, at least 1.
    pub sources: Vec<usize>,
    /// Sides of the sources' pictures, pixels, multiples of 16 up to the settings' side. Empty: that side. Rays are
    /// always of pictures of the settings' side. A GeNVS has pictures of one side only: its volumes are made for it.
    pub sides: Vec<u32>,
    /// Each source shows a square somewhere in its photograph, of at least this share of its side and at most the
    /// whole, above 0; 1: always the whole.
    pub least_crop: f32,
    /// Weighting schemes. With any other than the mean, an object has one target view in a step, as weights are for
    /// one. Validation has the first of the list.
    #[serde(serialize_with = "texts")]
    pub schemes: Vec<Scheme>,
}

impl Augmentation {
    /// Whole photographs at the settings' side with equal weights, and these numbers of sources.
    fn whole(sources: &[usize]) -> Augmentation {
        Augmentation { sources: sources.to_vec(), sides: Vec::new(), least_crop: 1.0, schemes: vec![Scheme::MEAN] }
    }

    /// The default of a PixelNeRF, as published but for the number of sources: mostly three, so that the network works
    /// with few sources, sometimes one or more, so that it works with any weights.
    #[must_use]
    pub fn pixelnerf() -> Augmentation {
        Augmentation::whole(&[1, 2, 3, 3, 3, 3, 4, 6])
    }

    /// The default of a GeNVS: as [`Augmentation::pixelnerf`], with one to three sources.
    #[must_use]
    pub fn genvs() -> Augmentation {
        Augmentation::whole(&[1, 2, 3, 3])
    }

    /// The largest number of sources.
    pub(crate) fn most_sources(&self) -> usize {
        self.sources.iter().copied().max().unwrap_or(1)
    }

    /// Refuses empty lists and numbers out of range, for pictures of this side.
    pub(crate) fn check(&self, side: u32) -> Result<(), TrainError> {
        let refuse = |name, value, allowed| Err(TrainError::Setting { name, value, allowed });
        if let Some(count) = self.sources.iter().find(|count| !(1..=MAX_SOURCES).contains(*count)) {
            return refuse("sources", *count as f64, "it must be from 1 to 256");
        }
        if self.sources.is_empty() || self.schemes.is_empty() {
            let name = if self.sources.is_empty() { "sources" } else { "schemes" };
            return refuse(name, 0.0, "at least one is needed");
        }
        let fits = |size: &u32| (16..=side).contains(size) && size.is_multiple_of(16);
        if let Some(wrong) = self.sides.iter().find(|size| !fits(size)) {
            return refuse("sides", f64::from(*wrong), "it must be a multiple of 16 from 16 to the side");
        }
        if !(self.least_crop > 0.0 && self.least_crop <= 1.0) {
            return refuse("least_crop", f64::from(self.least_crop), "it must be above 0 and at most 1");
        }
        Ok(())
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
