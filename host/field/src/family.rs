//! Learned fields: one row each. The names of a checkpoint's tensors tell its family.

use super::any::AnyField;
pub use super::options::Computable;
use super::options::{FieldOptions, OpenError};
use std::fmt;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// The omission of every family: the encoding of views that no target uses.
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

            /// The prefix of its tensors' names, which no other family has.
            const fn prefix(self) -> &'static str {
                match self { $(Family::$Family => $prefix,)+ }
            }

            /// The options of [`FieldOptions::given`] that it accepts.
            const fn options(self) -> &'static [&'static str] {
                match self { $(Family::$Family => $options,)+ }
            }

            /// Its omissions besides [`VIEWS`].
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
        title: "PixelNeRF", prefix: "encoder.model.", open: super::pixelnerf::open,
        options: &["published-depth", "probe-step", "probe-error", "half-latents"],
        computable: super::pixelnerf::COMPUTABLE,
        test_networks: &[
            TestNetwork { name: "formula", small: Small::Width, checkpoint: super::pixelnerf::test_networks::deterministic_of_width },
            TestNetwork { name: "body", small: Small::Width, checkpoint: super::pixelnerf::test_networks::body_of_width },
        ],
    }
    /// [`super::genvs`].
    Genvs {
        title: "GeNVS", prefix: "pixel_nerf_net.", open: super::genvs::open,
        options: &["sampler", "steps", "tolerance", "churn", "half-volumes", "reuse", "noise"],
        computable: super::genvs::COMPUTABLE,
        test_networks: &[TestNetwork { name: "genvs", small: Small::One, checkpoint: super::genvs::test_networks::deterministic_of_size }],
    }
}

/// A network with deterministic initialisation: for measuring, and for checks against other implementations.
#[derive(Clone, Copy)]
pub struct TestNetwork {
    /// Its name.
    pub name: &'static str,
    /// The small members of its family.
    pub small: Small,
    /// `None` gives the published size, a number the small member of that width (any number for [`Small::One`]).
    pub checkpoint: fn(Option<u16>) -> Checkpoint,
}

/// Small members of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Small {
    /// One for each width.
    Width,
    /// A single one.
    One,
}

impl Family {
    /// The family of a checkpoint. Opening the network checks that no tensor is missing.
    ///
    /// # Errors
    /// [`CheckpointError::Tensors`] if it is of no family.
    pub fn of(checkpoint: &Checkpoint) -> Result<Family, CheckpointError> {
        let holds = |family: &Family| checkpoint.shapes().keys().any(|name| name.starts_with(family.prefix()));
        Family::ALL.into_iter().find(holds).ok_or_else(|| CheckpointError::Tensors {
            path: checkpoint.path().to_path_buf(),
            detail: format!(
                "holds no supported network: no tensor's name begins with {}",
                Family::ALL.map(|family| format!("'{}' ({family})", family.prefix())).join(" or ")
            ),
        })
    }
}

/// Opens the learned field of a checkpoint of any family.
///
/// # Errors
/// [`OpenError`] if the checkpoint is of no family or cannot be read, or if the family does not accept an option.
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
        let expected = "other: holds no supported network: no tensor's name begins with 'encoder.model.' (PixelNeRF) \
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
