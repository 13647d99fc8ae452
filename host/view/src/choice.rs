//! The scheme and the field's scalars that suit the scene, chosen beside the pictures: while no request waits.

use crate::Viewed;
use viewfuse_field::auto::Chosen;
use viewfuse_field::{Mixture, Setting};

/// What is known of the choice.
#[derive(Debug, Default)]
pub(crate) enum Choice {
    /// The weighting was given.
    #[default]
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

    /// What was chosen, if it is the choice of this scheme.
    pub(crate) fn made(&self, scheme: &str) -> Option<&Chosen> {
        match self {
            Choice::Made(chosen) if chosen.weighting.to_string() == scheme => Some(chosen),
            _ => None,
        }
    }

    /// The field's scalars under a scheme: those that were chosen along with it, or those of the options.
    pub(crate) fn settings<'a>(&'a self, scheme: &str, viewed: &Viewed<'a>) -> &'a [Setting] {
        self.made(scheme).map_or(&viewed.options.settings, |chosen| &chosen.settings)
    }

    /// The pictures that are mixed under a scheme, if that was chosen along with it. Coarse pictures are not mixed.
    pub(crate) fn mixture(&self, scheme: &str) -> Option<&Mixture> {
        self.made(scheme).and_then(|chosen| chosen.mixture.as_ref())
    }
}
