//! [`Kernel::Attend`]: softmax of products of random embeddings, from nearly equal weights to a single weight of 1.

use super::*;
use crate::attention_oracle::attend;

impl Case for Attend {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 3.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "an error of a logit is a relative error of its weight: differences from the largest \
        logit, five roundings, then the exponential";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("queries", |own| own.queries[0] *= 1.01), ("keys", |own| own.keys[5] *= 1.01)];

    fn inputs(seed: u64, size: u32) -> Vec<Attend> {
        let random = &mut random(2, seed, size);
        let first = seed as usize * 5 + size as usize;
        let dispatch = |(index, scale): (usize, f64)| {
            let source_count = (first + 11 * index) % MAX_WEIGHED + 1;
            Attend {
                source_count: source_count as u32,
                target_count: size,
                queries: numbers(size as usize * EMBEDDING, || scale * random.normal()),
                keys: numbers(source_count * EMBEDDING, || scale * random.normal()),
                weights: Output::Zeros(size as usize * MAX_WEIGHED),
            }
        };
        [0.1, 0.5, 1.0, 2.0].into_iter().enumerate().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let row = |target: usize| {
            let query = &self.queries[target * EMBEDDING..][..EMBEDDING];
            let mut row = [Bounded::ZERO; MAX_WEIGHED];
            row.iter_mut().zip(attend(query, &self.keys)).for_each(|(place, weight)| *place = weight);
            row
        };
        decided(map(self.target_count as usize, 1, row).into_iter().flatten(), 0)
    }
}
