//! Colours by direction: a Gaussian's spherical harmonics above degree 0, with the state of their optimisation.

use viewfuse_core::Vec3;
use viewfuse_core::gaussian::{REST_COUNTS, harmonics};
use viewfuse_device::parallel::map;
use viewfuse_kernels::gaussians::steps::{HarmonicTerm, TermState, colour_along, step_term};

/// Terms that a core makes at once.
const TERMS_A_CORE: usize = 1 << 14;

/// The terms of coefficients `[gaussian][channel][coefficient]`, so many a channel: `[gaussian][term]`.
pub(super) fn terms_of(coefficients: &[f32], count: usize) -> Vec<HarmonicTerm> {
    let term = |index: usize| {
        let (gaussian, term) = (index / count, index % count);
        let value = [0, 1, 2].map(|channel| coefficients[(3 * gaussian + channel) * count + term]);
        HarmonicTerm { value, padding: 0.0 }
    };
    map(coefficients.len() / 3, TERMS_A_CORE, term)
}

/// The coefficients in their order; none for a colour that is the same from everywhere.
#[derive(Clone, Debug, Default)]
pub(super) struct Harmonics {
    pub(super) terms: Vec<HarmonicTerm>,
    /// `[term]`.
    pub(super) states: Vec<TermState>,
}

impl Harmonics {
    /// Of coefficients `[channel][coefficient]`.
    pub(super) fn new(coefficients: &[f32]) -> Harmonics {
        Harmonics::begun(terms_of(coefficients, coefficients.len() / 3))
    }

    /// At the beginning of an optimisation.
    pub(super) fn begun(terms: Vec<HarmonicTerm>) -> Harmonics {
        let states = vec![TermState::default(); terms.len()];
        Harmonics { terms, states }
    }

    /// The same coefficients at the beginning of an optimisation.
    pub(super) fn begun_anew(&self) -> Harmonics {
        Harmonics::begun(self.terms.clone())
    }

    /// The coefficients, `[channel][coefficient]`, with zeros up to `count` a channel.
    pub(super) fn coefficients(&self, count: usize) -> impl Iterator<Item = f32> + '_ {
        let value = move |channel: usize, index: usize| self.terms.get(index).map_or(0.0, |term| term.value[channel]);
        (0..3).flat_map(move |channel| (0..count).map(move |index| value(channel, index)))
    }

    /// How many coefficients a channel has.
    pub(super) fn count(&self) -> usize {
        self.terms.len()
    }

    /// Adds those of this degree, as zeros, if they are not there.
    pub(super) fn raise(&mut self, degree: u32) {
        let count = REST_COUNTS[degree.min(3) as usize] as usize;
        if self.terms.len() < count {
            self.terms.resize(count, HarmonicTerm::default());
            self.states.resize(count, TermState::default());
        }
    }

    /// A colour of degree 0 as it is seen along a direction of length 1: at least 0, once there are harmonics.
    pub(super) fn along(&self, colour: [f32; 3], unit: Vec3) -> [f32; 3] {
        colour_along(colour, &self.terms[..], 0, self.terms.len() as u32, unit)
    }

    /// Steps against the derivatives by the colour along a direction of length 1.
    pub(super) fn step(&mut self, by_colour: [f32; 3], unit: Vec3, colour_rate: f32, corrections: [f32; 2]) {
        for ((term, state), basis) in self.terms.iter_mut().zip(&mut self.states).zip(harmonics(unit)) {
            (*term, *state) = step_term(term, state, by_colour, basis, colour_rate, corrections);
        }
    }
}
