//! Random orders of views that depend on the seed, scene and trial, and not on the order of draws.

use viewfuse_core::random::threefry_2x32;

/// The random numbers of a trial on a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    key: [u32; 2],
    trial: u32,
}

impl Draw {
    /// The random numbers of a seed, a scene's name and a trial.
    pub(super) fn of(seed: u64, scene_name: &str, trial: u32) -> Draw {
        Draw { key: threefry_2x32(words(seed), words(fingerprint(scene_name))), trial }
    }

    /// The random numbers of one view of the trial.
    pub(super) fn of_view(&self, view: usize) -> Draw {
        // The complement of the trial: a counter that no order of the trial itself uses.
        Draw { key: threefry_2x32(self.key, [!self.trial, view as u32]), trial: self.trial }
    }

    /// Views in random order, independent of their order in the input.
    pub(super) fn order(&self, views: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut views: Vec<usize> = views.into_iter().collect();
        views.sort_unstable();
        views.sort_by_key(|&view| threefry_2x32(self.key, [self.trial, view as u32]));
        views
    }
}

fn words(number: u64) -> [u32; 2] {
    [number as u32, (number >> 32) as u32]
}

/// A number for a text (FNV-1a, 64 bits).
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
