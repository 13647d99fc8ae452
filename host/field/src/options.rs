//! What a person gives of a field's options, as text by the flags of its row. A field has defaults for what is not
//! given, and rejects what it does not have.

use super::record::Omission;
use viewfuse_job::files::WriteError;
use viewfuse_nn::checkpoint::CheckpointError;

/// What a person gives of a field's options, as text by the names of its row. Opening the field makes a value of its
/// own options of it, once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Given {
    /// Seed of every random draw.
    pub seed: u64,
    /// Omit nothing.
    pub exact: bool,
    /// Names of the row's omissions that are switched off.
    pub compute: Vec<String>,
    /// Names of the row's flags with their values; those of switches are empty.
    pub flags: Vec<(String, String)>,
}

impl Given {
    /// The same with a flag; the value of a switch is empty.
    pub fn with(mut self, flag: impl Into<String>, value: impl Into<String>) -> Given {
        self.flags.push((flag.into(), value.into()));
        self
    }

    /// The value of a flag, if it is given. Opening a field has checked it: `parse` is that of the row.
    pub(crate) fn value<T>(&self, flag: &str, parse: impl Fn(&str) -> Result<T, String>) -> Option<T> {
        self.flags.iter().rfind(|(name, _)| name == flag).and_then(|(_, text)| parse(text).ok())
    }

    /// Does something with the value of a flag, if it is given.
    pub(crate) fn take<T>(&self, flag: &str, parse: impl Fn(&str) -> Result<T, String>, set: impl FnOnce(T)) {
        if let Some(value) = self.value(flag, parse) {
            set(value);
        }
    }

    /// Whether an omission is switched off.
    pub(crate) fn computes(&self, omission: &Omission) -> bool {
        self.exact || self.compute.iter().any(|name| name == omission.name)
    }
}

/// A flag of a field, and what it takes.
#[derive(Clone, Copy, Debug)]
pub struct Flag {
    /// Its name, without dashes before it.
    pub name: &'static str,
    /// The form of its value, the same in all rows that have it; empty for a switch.
    pub form: &'static str,
    /// Its help.
    pub help: &'static str,
    /// Refuses a text that is no value, with what a value is.
    pub check: fn(&str) -> Result<(), String>,
    /// What it is about.
    pub about: FlagAbout,
    /// Options of a command with which it cannot be given, `-` as `_` where they are not of a row.
    pub conflicts: &'static [&'static str],
}

/// What a flag is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlagAbout {
    /// The exact picture.
    Picture,
    /// An effort: what is left out of the exact picture.
    Effort,
    /// How a picture follows from the one before.
    Sequence,
}

/// Options that choose all efforts: a flag of one of them would say the same twice.
pub(crate) const BOUNDS: &[&str] = &["max_error", "max_time"];
/// The same, and the option that leaves nothing out.
pub(crate) const BOUNDS_OR_EXACT: &[&str] = &["max_error", "max_time", "exact"];

/// Declares a field's flags: name, form, parser, what it is about, conflicts, help, and what a value does to the
/// field's options. Makes the list for the row (`FLAGS`), and `taken`, the options with what is given, in the order of
/// the list.
macro_rules! flags {
    ($Options:ty; $($name:literal, $form:literal, $parse:path, $About:ident, $conflicts:expr, $help:expr, $set:expr;)+) => {
        const FLAGS: &[$crate::options::Flag] = &[$($crate::options::Flag {
            name: $name,
            form: $form,
            help: $help,
            check: |text| $parse(text).map(drop),
            about: $crate::options::FlagAbout::$About,
            conflicts: $conflicts,
        },)+];

        /// The options with the flags that are given.
        fn taken(given: &$crate::options::Given, mut options: $Options) -> $Options {
            $(given.take($name, $parse, |value| $crate::options::apply(&mut options, value, $set));)+
            options
        }
    };
}

pub(crate) use flags;

/// Does to options what a flag of this value does: the form in which a closure knows both types.
pub(crate) fn apply<O, T>(options: &mut O, value: T, set: impl FnOnce(&mut O, T)) {
    set(options, value);
}

/// Why a field cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The checkpoint is of no field, or cannot be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A folder that an option names cannot be used.
    #[error(transparent)]
    Folder(#[from] WriteError),
    /// An option does not go with the field.
    #[error("{option} {problem} with a network that {reason}")]
    Refused {
        /// The option's name, perhaps with a value.
        option: String,
        /// The problem, for example "cannot be used".
        problem: String,
        /// The reason, for example "is a PixelNeRF".
        reason: String,
    },
}

impl OpenError {
    /// An option that the field does not have.
    pub fn cannot(option: impl Into<String>, reason: impl Into<String>) -> OpenError {
        OpenError::Refused { option: option.into(), problem: "cannot be used".to_owned(), reason: reason.into() }
    }
}

/// The value of a switch.
pub(crate) fn switch(text: &str) -> Result<(), String> {
    text.is_empty().then_some(()).ok_or_else(|| "no value".to_owned())
}

/// A number within bounds, `is` says which.
pub(crate) fn number(text: &str, fits: impl Fn(f32) -> bool, is: &str) -> Result<f32, String> {
    text.parse().ok().filter(|number| fits(*number)).ok_or_else(|| is.to_owned())
}

/// A whole number within bounds.
pub(crate) fn count(text: &str, bounds: std::ops::RangeInclusive<u32>) -> Result<u32, String> {
    let count = text.parse().ok().filter(|count| bounds.contains(count));
    count.ok_or_else(|| format!("a whole number in {}..={}", bounds.start(), bounds.end()))
}

/// Numbers between commas; `None` if there is something else.
pub(crate) fn list<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split(',').map(|number| number.trim().parse().ok()).collect()
}
