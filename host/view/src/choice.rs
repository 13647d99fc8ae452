//! The scheme and the field's options that suit the scene, chosen beside the pictures: while no request waits.

use crate::Viewed;
use viewfuse_field::auto::Chosen;
use viewfuse_field::{AnyOptions, Mixture};

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

    /// The field's options under a scheme: those that were chosen along with it, or those of the render's options.
    pub(crate) fn options<'a>(&'a self, scheme: &str, viewed: &Viewed<'a>) -> Option<&'a AnyOptions> {
        self.made(scheme).map(|chosen| &chosen.options).or(viewed.options.field.as_ref())
    }

    /// The pictures that are mixed under a scheme, if that was chosen along with it. Coarse pictures are not mixed.
    pub(crate) fn mixture(&self, scheme: &str) -> Option<&Mixture> {
        self.made(scheme).and_then(|chosen| chosen.mixture.as_ref())
    }
}
