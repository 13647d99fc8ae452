//! The scalars that are chosen for a scene, and the pictures that are worth mixing.

use super::{DEFAULT, Sweep};
use crate::Setting;

const FRONT_SHARE: &str = "front share";
const SECOND_SHARE: &str = "second share";
const DISSENT_SHARE: &str = "dissent share";

impl Sweep {
    /// The scalars that differ most from scene to scene, by their names in a record, in the order in which they are
    /// chosen.
    fn scalars(&self) -> [Setting; 5] {
        [
            (FRONT_SHARE, self.front_share),
            ("near cost", self.near_cost),
            (DISSENT_SHARE, self.dissent_share),
            (SECOND_SHARE, self.second_share),
            ("temperature", self.temperature),
        ]
        .map(|(name, value)| Setting { name, value })
    }

    /// What a record says of them: those that are not at their defaults, and at last these, whatever they are.
    pub(super) fn stated(&self, last: &[&'static str]) -> Vec<Setting> {
        let scalars = self.scalars();
        let is_varied = |(scalar, default): &(&Setting, Setting)| *scalar != default && !last.contains(&scalar.name);
        let varied = scalars.iter().zip(DEFAULT.scalars()).filter(is_varied).map(|(scalar, _)| *scalar);
        varied
            .chain(last.iter().flat_map(|name| scalars.into_iter().filter(move |scalar| scalar.name == *name)))
            .collect()
    }

    /// What a step of the search tries in place of these settings, the most effective scalars first; nothing after the
    /// last step.
    pub(in crate::training_free) fn candidates(&self, step: usize) -> Vec<Sweep> {
        match step {
            0 => [0.0, 0.2].map(|front_share| Sweep { front_share, ..*self }).to_vec(),
            1 => [0.002, 0.02].map(|near_cost| Sweep { near_cost, ..*self }).to_vec(),
            2 => [0.0, 0.125].map(|dissent_share| Sweep { dissent_share, ..*self }).to_vec(),
            3 => vec![Sweep { second_share: 0.03, ..*self }],
            4 => [0.005, 0.013].map(|temperature| Sweep { temperature, ..*self }).to_vec(),
            _ => Vec::new(),
        }
    }

    /// Where the scene is as most sources see it, as the sources' own disparities say, and as the disparities say that
    /// are found the second time: each is right where the others are not. With what a record says of each.
    pub(in crate::training_free) fn parts(&self) -> [(Sweep, Vec<Setting>); 3] {
        let seen = Sweep { front_share: 0.0, second_share: 0.0, ..*self };
        let second = Sweep { front_share: 0.2, second_share: 0.03, dissent_share: 0.0, ..*self };
        [
            (seen, seen.stated(&[FRONT_SHARE, SECOND_SHARE])),
            (*self, self.stated(&[])),
            (second, second.stated(&[FRONT_SHARE, SECOND_SHARE, DISSENT_SHARE])),
        ]
    }
}
