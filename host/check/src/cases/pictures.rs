//! [`Kernel::MixPictures`] and [`Kernel::AddNoise`]: every number of results; arrays with coefficient 0, which are not
//! read, have another length and hold NaN; noise of several streams on pictures of all sizes and on zeros.

use super::*;
use crate::ray_oracle;

impl Case for MixPictures {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition an array, two roundings each";
    // Each array has a coefficient in some dispatch.
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("parameters", |case| case.block.state *= 1.01),
        ("state", |case| increase(&mut case.state)),
        ("newest", |case| increase(&mut case.newest)),
        ("second", |case| increase(&mut case.second)),
        ("third", |case| increase(&mut case.third)),
        ("fourth", |case| increase(&mut case.fourth)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<MixPictures> {
        let random = &mut random(29, seed, size);
        // Which of the arrays count: state first.
        let patterns =
            [[1, 1, 1, 1, 1], [1, 1, 1, 1, 0], [1, 1, 0, 0, 0], [0, 1, 1, 1, 1], [0, 0, 0, 0, 1], [1, 0, 1, 0, 1]];
        let dispatch = |counts: [u32; 5]| {
            let [state, results @ ..] = counts.map(|counts| match counts {
                0 => (0.0, vec![f32::NAN; 1]),
                _ => (random.normal() as f32, numbers(size as usize, || random.normal())),
            });
            let coefficients = results.each_ref().map(|(coefficient, _)| *coefficient);
            let [newest, second, third, fourth] = results.map(|(_, values)| values);
            MixPictures {
                block: Mix { state: state.0, results: coefficients },
                element_count: size,
                state: state.1,
                newest,
                second,
                third,
                fourth,
                mixed: Output::Zeros(size as usize),
            }
        };
        patterns.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let MixPictures { block, state, newest, second, third, fourth, .. } = self;
        let results = block.results.iter().zip([newest, second, third, fourth]);
        let terms = std::iter::once((&block.state, state)).chain(results);
        let terms: Vec<_> = terms.filter(|(coefficient, _)| **coefficient != 0.0).collect();
        let element = |element: usize| {
            let products =
                terms.iter().map(|(coefficient, values)| Bounded::from(**coefficient) * values[element].into());
            products.fold(Bounded::ZERO, |sum, term| sum + term)
        };
        decided((0..self.element_count()).map(element), 0)
    }
}

impl Case for AddNoise {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition; for normal numbers 2 ULP of the logarithm, 4.5 ULP of the \
        root, 9e-8 of the cosine, two roundings of its argument of up to a turn";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("parameters", |case| case.block.scale *= 1.01), ("picture", |case| increase(&mut case.picture))];

    fn inputs(seed: u64, size: u32) -> Vec<AddNoise> {
        let random = &mut random(30, seed, size);
        let count = size as usize;
        let dispatch = |(scale, stream, is_empty): (f32, u32, bool)| AddNoise {
            block: NoiseBlock { seed: [random.below(1 << 32) as u32, random.below(1 << 32) as u32], stream, scale },
            element_count: size,
            picture: if is_empty { vec![0.0; count] } else { numbers(count, || random.normal()) },
            noisy: Output::Zeros(count),
        };
        [(1.0, 0, true), (0.5, 1, false), (0.002, 24, false), (3.0, u32::MAX, false)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let NoiseBlock { seed, stream, scale } = self.block;
        let noisy = |(element, value): (u32, &f32)| {
            Bounded::from(*value) + Bounded::from(scale) * ray_oracle::normal(seed, element, stream)
        };
        decided((0..).zip(&self.picture).map(noisy), 0)
    }
}
