//! The scalars that are chosen for a scene, and the pictures that are worth mixing.

use super::views::Views;
use super::{DEFAULT, Sweep};
use crate::{Setting, Tunable, Tuned};
use viewfuse_device::Device;

const NEAR_COST: &str = "near cost";
const FRONT_SHARE: &str = "front share";
const DISSENT_SHARE: &str = "dissent share";
const TEMPERATURE_NAME: &str = "temperature";
const SECOND_SHARE: &str = "second share";

/// The scalars that differ most from scene to scene, the most effective ones first.
const TUNABLES: &[Tunable] = &[
    Tunable { name: FRONT_SHARE, default: DEFAULT.front_share, others: &[0.0, 0.2] },
    Tunable { name: NEAR_COST, default: DEFAULT.near_cost, others: &[0.002, 0.02] },
    Tunable { name: DISSENT_SHARE, default: DEFAULT.dissent_share, others: &[0.0, 0.125] },
    Tunable { name: SECOND_SHARE, default: DEFAULT.second_share, others: &[0.03] },
    Tunable { name: TEMPERATURE_NAME, default: DEFAULT.temperature, others: &[0.005, 0.013] },
];

/// The front share, and the second share, of pictures that are mixed.
const PART_FRONT_SHARE: f32 = 0.2;
const PART_SECOND_SHARE: f32 = 0.03;

impl Sweep {
    /// The scalars that can be chosen for a scene, by the names in [`TUNABLES`].
    fn scalars(&mut self) -> [(&'static str, &mut f32); 5] {
        [
            (FRONT_SHARE, &mut self.front_share),
            (SECOND_SHARE, &mut self.second_share),
            (NEAR_COST, &mut self.near_cost),
            (DISSENT_SHARE, &mut self.dissent_share),
            (TEMPERATURE_NAME, &mut self.temperature),
        ]
    }
}

impl<D: Device> Tuned for Views<'_, D> {
    fn tunables(&self) -> &'static [Tunable] {
        TUNABLES
    }

    fn tune(&mut self, settings: &[Setting]) {
        let Sweep { plane_count, match_side, neighbours, .. } = self.settings;
        self.settings = Sweep { plane_count, match_side, neighbours, ..self.scene.defaults };
        for Setting { name, value } in settings {
            if let Some((_, scalar)) = self.settings.scalars().into_iter().find(|(known, _)| known == name) {
                *scalar = *value;
            }
        }
    }

    /// Where the scene is as most sources see it, as the sources' own disparities say, and as the disparities say that
    /// are found the second time: each is right where the others are not.
    fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        if self.scene.has_silhouettes {
            return Vec::new();
        }
        let with = |others: &[(&'static str, f32)]| {
            let kept = chosen.iter().filter(|setting| others.iter().all(|(name, _)| *name != setting.name)).copied();
            kept.chain(others.iter().map(|&(name, value)| Setting { name, value })).collect()
        };
        vec![
            with(&[(FRONT_SHARE, 0.0), (SECOND_SHARE, 0.0)]),
            chosen.to_vec(),
            with(&[(FRONT_SHARE, PART_FRONT_SHARE), (SECOND_SHARE, PART_SECOND_SHARE), (DISSENT_SHARE, 0.0)]),
        ]
    }
}
