//! A field's row: all that the command, `pareto` and training know of it beside its pictures. The table of rows is in
//! [`rows`](crate::rows).

use super::any::AnyField;
use super::budget::DEFAULT_BOUND;
use super::options::{Flag, Given, OpenError};
use super::record::{Omission, VIEWS};
use super::render::{DEFAULT_EARLY_TERMINATION, DEFAULT_LEAVE_OUT, RenderOptions};
use super::variant::Variant;
use crate::budget::Bound;
use viewfuse_device::Precision;
use viewfuse_nn::checkpoint::Checkpoint;

/// A field's row.
#[derive(Clone, Copy)]
pub struct Row {
    /// Its name in the run record; that of a training-free field is also a value of `--model`.
    pub name: &'static str,
    /// Its name in messages, for example "PixelNeRF".
    pub title: &'static str,
    /// Heading of its own flags.
    pub heading: &'static str,
    /// How it is opened.
    pub origin: Origin,
    /// Its own flags.
    pub flags: &'static [Flag],
    /// What may be left out of its work, besides [`VIEWS`].
    pub omissions: &'static [Omission],
    /// Variants to draw of a field of this row, the exact one first; empty if it is of another, or for the exact one
    /// and the default alone. The options say what is omitted by default; the number is that of the targets, and the
    /// precisions are those that the device has besides the exact one.
    pub drawn: fn(&AnyField, &RenderOptions, usize, &[Precision]) -> Vec<Drawn>,
}

/// How a field is opened.
#[derive(Clone, Copy)]
pub enum Origin {
    /// It has no learned parameters.
    TrainingFree {
        /// Opens it.
        open: fn(&Given) -> Result<AnyField, OpenError>,
    },
    /// From a checkpoint.
    Learned {
        /// The prefix of its tensors' names, which no other row has.
        prefix: &'static str,
        /// Its test networks, with deterministic initialisation.
        test_networks: &'static [TestNetwork],
        /// Opens it.
        open: fn(Checkpoint, &Given) -> Result<AnyField, OpenError>,
    },
}

/// What `pareto` draws: a field, and what the render loop omits.
pub type Drawn = Variant<(AnyField, RenderOptions)>;

/// Label of the variant that omits everything that is omitted by default.
pub const ALL: &str = "all";

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

/// Small members of a family of networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Small {
    /// One for each width.
    Width,
    /// A single one.
    One,
}

impl Row {
    /// The prefix of its tensors' names; `None` for a training-free field.
    pub const fn prefix(&self) -> Option<&'static str> {
        match self.origin {
            Origin::TrainingFree { .. } => None,
            Origin::Learned { prefix, .. } => Some(prefix),
        }
    }

    /// The options of a render, with [`DEFAULT_BOUND`] for a learned field where they have no bound and do not say to
    /// omit more than by default. Of a field without a network a bound on the error omits no view: its pictures are
    /// mixed by what is found of held-out sources under the same omissions, and would not be those of all views.
    pub fn bounded(&self, options: RenderOptions) -> RenderOptions {
        let is_more = options.leave_out > DEFAULT_LEAVE_OUT || options.early_termination > DEFAULT_EARLY_TERMINATION;
        let usual = (self.prefix().is_some() && !is_more).then_some(DEFAULT_BOUND);
        let is_mixed = self.prefix().is_none() && matches!(options.bound, Some(Bound::Error(_)));
        let leave_out = if is_mixed { 0.0 } else { options.leave_out };
        RenderOptions { bound: options.bound.or(usual), leave_out, ..options }
    }

    /// Its test networks.
    pub const fn test_networks(&self) -> &'static [TestNetwork] {
        match self.origin {
            Origin::TrainingFree { .. } => &[],
            Origin::Learned { test_networks, .. } => test_networks,
        }
    }

    /// Opens the field without a checkpoint.
    ///
    /// # Errors
    /// [`OpenError`] if it is a learned one, or does not accept an option.
    pub fn open(&self, given: &Given) -> Result<AnyField, OpenError> {
        self.check(given)?;
        match self.origin {
            Origin::TrainingFree { open } => open(given),
            Origin::Learned { .. } => Err(OpenError::Refused {
                option: self.name.to_owned(),
                problem: "needs a checkpoint".to_owned(),
                reason: format!("is a {}", self.title),
            }),
        }
    }

    /// Refuses what the field does not have, and values that it does not take.
    pub(crate) fn check(&self, given: &Given) -> Result<(), OpenError> {
        let is = || format!("is a {}", self.title);
        let knows = |name: &str| name == VIEWS.name || self.omissions.iter().any(|omission| omission.name == name);
        if let Some(unknown) = given.compute.iter().find(|name| !knows(name)) {
            return Err(OpenError::cannot(format!("compute {unknown}"), is()));
        }
        for (name, value) in &given.flags {
            let flag = self.flags.iter().find(|flag| flag.name == name.as_str());
            let flag = flag.ok_or_else(|| OpenError::cannot(name.as_str(), is()))?;
            (flag.check)(value).map_err(|form| OpenError::Refused {
                option: name.clone(),
                problem: format!("takes {form},"),
                reason: is(),
            })?;
        }
        Ok(())
    }
}
