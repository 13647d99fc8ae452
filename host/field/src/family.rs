//! Learned fields: one row each. Which one a checkpoint is of, the names of its tensors tell.

use super::any::AnyField;
pub use super::options::Computable;
use super::options::{FieldOptions, OpenError};
use super::{genvs, pixelnerf};
use std::fmt;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// The views that no target uses: what every family may leave out.
pub const VIEWS: Computable = ("views", "Encode views that no target uses");

/// Declares the families from their rows.
macro_rules! families {
    ($($(#[$doc:meta])* $Family:ident {
        title: $title:literal, prefix: $prefix:literal, open: $open:path,
        options: $options:expr, computable: $computable:expr,
        test_networks: $test_networks:expr $(,)?
    })+) => {
        /// A family of networks.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Family {
            $($(#[$doc])* $Family,)+
        }

        impl Family {
            /// All of them.
            pub const ALL: [Family; [$($title),+].len()] = [$(Family::$Family),+];

            /// Its name in messages.
            const fn title(self) -> &'static str {
                match self { $(Family::$Family => $title,)+ }
            }

            /// What names of its tensors begin with, and of no other family.
            const fn prefix(self) -> &'static str {
                match self { $(Family::$Family => $prefix,)+ }
            }

            /// Names of the options of [`FieldOptions::given`] that it knows.
            const fn options(self) -> &'static [&'static str] {
                match self { $(Family::$Family => $options,)+ }
            }

            /// What it may leave out, besides [`VIEWS`].
            pub const fn computable(self) -> &'static [Computable] {
                match self { $(Family::$Family => $computable,)+ }
            }

            /// Its test networks, with deterministic initialisation.
            pub const fn test_networks(self) -> &'static [TestNetwork] {
                match self { $(Family::$Family => $test_networks,)+ }
            }

            fn constructor(self) -> fn(Checkpoint, &FieldOptions) -> Result<AnyField, OpenError> {
                match self { $(Family::$Family => $open,)+ }
            }
        }
    };
}

families! {
    /// [`super::pixelnerf`].
    PixelNerf {
        title: "PixelNeRF", prefix: "encoder.model.", open: pixelnerf::open,
        options: &["published-depth", "probe-step", "probe-error"],
        computable: pixelnerf::COMPUTABLE,
        test_networks: &[
            TestNetwork { name: "formula", small: Small::Width, checkpoint: pixelnerf::test_networks::deterministic_of_width },
            TestNetwork { name: "body", small: Small::Width, checkpoint: pixelnerf::test_networks::body_of_width },
        ],
    }
    /// [`super::genvs`].
    Genvs {
        title: "GeNVS", prefix: "pixel_nerf_net.", open: genvs::open,
        options: &["sampler", "steps", "tolerance", "churn", "half-volumes", "reuse", "noise"],
        computable: genvs::COMPUTABLE,
        test_networks: &[TestNetwork { name: "genvs", small: Small::One, checkpoint: genvs::test_networks::deterministic_of_size }],
    }
}

/// A network with deterministic initialisation: for measuring, and for checks against other implementations.
#[derive(Clone, Copy)]
pub struct TestNetwork {
    /// Its name.
    pub name: &'static str,
    /// Which small members its family has.
    pub small: Small,
    /// The published size without a number, otherwise the small member of that width (whatever it is for [`Small::One`]).
    pub checkpoint: fn(Option<u16>) -> Checkpoint,
}

/// Small members of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Small {
    /// One of every width.
    Width,
    /// One.
    One,
}

impl Family {
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
}

/// The learned field of a checkpoint, whatever its family.
///
/// # Errors
/// [`OpenError`] if the checkpoint is of no family or cannot be read, or an option does not go with the family.
pub fn open(checkpoint: Checkpoint, options: &FieldOptions) -> Result<AnyField, OpenError> {
    let family = Family::of(&checkpoint)?;
    let is = format!("is a {family}");
    let knows = |name: &str| name == VIEWS.0 || family.computable().iter().any(|(known, _)| *known == name);
    if let Some(unknown) = options.compute.iter().find(|name| !knows(name)) {
        return Err(OpenError::cannot(format!("compute {unknown}"), is));
    }
    if let Some(unknown) = options.given().into_iter().find(|name| !family.options().contains(name)) {
        return Err(OpenError::cannot(unknown, is));
    }
    family.constructor()(checkpoint, options)
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.title())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn told_by_names() {
        for family in Family::ALL {
            for network in family.test_networks() {
                let checkpoint = (network.checkpoint)(Some(8));
                assert_eq!(Family::of(&checkpoint).ok(), Some(family), "{}", network.name);
            }
        }
    }

    #[test]
    fn neither() {
        let other = Checkpoint::in_memory("other", [], BTreeMap::new());
        let message = Family::of(&other).expect_err("nothing").to_string();
        let expected = "other: holds no network that is known here: no tensor's name begins with 'encoder.model.' (PixelNeRF) \
             or 'pixel_nerf_net.' (GeNVS)";
        assert_eq!(message, expected);
    }

    #[test]
    fn options_of_the_other_family_are_refused() {
        for family in Family::ALL {
            let checkpoint = || (family.test_networks()[0].checkpoint)(Some(8));
            let computing = FieldOptions { compute: vec!["everything".to_owned()], ..FieldOptions::default() };
            let other =
                FieldOptions { published_depth: true, sampler: None, churn: Some(1.0), ..FieldOptions::default() };
            for options in [computing, other] {
                let refused = matches!(open(checkpoint(), &options), Err(OpenError::Refused { .. }));
                assert!(refused, "{family} takes {options:?}");
            }
            assert!(open(checkpoint(), &FieldOptions::default()).is_ok());
        }
    }
}
