//! Which network a checkpoint holds, by the names of its tensors.

use std::fmt;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// A family of networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// [`super::pixelnerf`].
    PixelNerf,
    /// [`super::genvs`].
    Genvs,
}

impl Family {
    /// All of them.
    pub const ALL: [Family; 2] = [Family::PixelNerf, Family::Genvs];

    /// The family of a checkpoint. Whether it has every tensor that the network needs, the network says itself.
    ///
    /// # Errors
    /// [`CheckpointError::Tensors`] if it is of none.
    pub fn of(checkpoint: &Checkpoint) -> Result<Family, CheckpointError> {
        let holds = |family: &Family| checkpoint.shapes().keys().any(|name| name.starts_with(family.prefix()));
        Family::ALL.into_iter().find(holds).ok_or_else(|| CheckpointError::Tensors {
            path: checkpoint.path().to_path_buf(),
            detail: format!(
                "holds no network that is known here: no tensor's name begins with {}",
                Family::ALL.map(|family| format!("'{}' ({family})", family.prefix())).join(" or ")
            ),
        })
    }

    /// What names of its tensors begin with, and of no other family.
    const fn prefix(self) -> &'static str {
        match self {
            Family::PixelNerf => "encoder.model.",
            Family::Genvs => "pixel_nerf_net.",
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Family::PixelNerf => "PixelNeRF",
            Family::Genvs => "GeNVS",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{genvs, pixelnerf};
    use std::collections::BTreeMap;

    #[test]
    fn told_by_names() {
        let pixelnerf = pixelnerf::test_networks::deterministic(&pixelnerf::Architecture::small(8));
        assert_eq!(Family::of(&pixelnerf).ok(), Some(Family::PixelNerf));
        let genvs = genvs::test_networks::deterministic(&genvs::Architecture::small());
        assert_eq!(Family::of(&genvs).ok(), Some(Family::Genvs));
    }

    #[test]
    fn neither() {
        let other = Checkpoint::in_memory("other", [], BTreeMap::new());
        let message = Family::of(&other).expect_err("nothing").to_string();
        let expected = "other: holds no network that is known here: no tensor's name begins with 'encoder.model.' (PixelNeRF) \
             or 'pixel_nerf_net.' (GeNVS)";
        assert_eq!(message, expected);
    }
}
