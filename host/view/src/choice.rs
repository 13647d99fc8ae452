//! The scheme and the field's options that suit the scene, chosen beside the pictures: while no request waits.

use crate::Viewed;
use viewfuse_field::auto::Chosen;
use viewfuse_weighting::Weighting;

/// What is known of the choice.
#[derive(Debug)]
pub(crate) enum Choice {
    /// The weighting was given.
    None,
    /// It is still to be made.
    Due,
    /// It is made.
    Made(Box<Chosen>),
}

impl Choice {
    pub(crate) fn of(viewed: &Viewed<'_>) -> Choice {
        if viewed.chooses { Choice::Due } else { Choice::None }
    }

    /// The weighting that was chosen, once it is.
    pub(crate) fn weighting(&self) -> Option<&Weighting> {
        match self {
            Choice::Made(chosen) => Some(&chosen.weighting),
            _ => None,
        }
    }

    /// What was chosen, if it is the choice of this scheme.
    pub(crate) fn made(&self, scheme: &str) -> Option<&Chosen> {
        match self {
            Choice::Made(chosen) if chosen.weighting.to_string() == scheme => Some(chosen),
            _ => None,
        }
    }
}
