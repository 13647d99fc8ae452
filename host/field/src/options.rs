//! A person's options of a field, as text by the flags of its row. A field has defaults for missing options, and rejects
//! options that it does not have.

use std::collections::BTreeMap;
use viewfuse_job::files::WriteError;
use viewfuse_nn::checkpoint::CheckpointError;

/// Options of a field as a person gives them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FieldOptions {
    /// Seed of every random draw.
    pub seed: u64,
    /// Leave nothing out.
    pub exact: bool,
    /// Omissions that are switched off, by names of the row's list.
    pub compute: Vec<String>,
    /// Values by the names of the row's flags; those of switches are empty.
    pub flags: BTreeMap<String, String>,
}

impl FieldOptions {
    /// These options with a flag; the value of a switch is empty.
    pub fn with(mut self, flag: impl Into<String>, value: impl Into<String>) -> FieldOptions {
        self.flags.insert(flag.into(), value.into());
        self
    }

    /// The value of a flag, if it is given. Opening a field has checked it: `parse` is that of the row.
    pub(crate) fn value<T>(&self, flag: &str, parse: impl Fn(&str) -> Result<T, String>) -> Option<T> {
        self.flags.get(flag).and_then(|text| parse(text).ok())
    }

    /// Whether an omission is switched off.
    pub(crate) fn computes(&self, what: &str) -> bool {
        self.exact || self.compute.iter().any(|name| name == what)
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

/// Declares a field's flags: the type of a value, name, form, parser, what it is about, conflicts, help. Makes the list for
/// the row (`Given::FLAGS`) and the values that are given (`Given::of`).
macro_rules! flags {
    ($($field:ident: $Type:ty = $name:literal, $form:literal, $parse:ident, $About:ident, $conflicts:expr, $help:expr;)+) => {
        /// The flags that are given.
        struct Given {
            $($field: Option<$Type>,)+
        }

        impl Given {
            const FLAGS: &'static [Flag] = &[$(Flag {
                name: $name,
                form: $form,
                help: $help,
                check: |text| $parse(text).map(drop),
                about: FlagAbout::$About,
                conflicts: $conflicts,
            },)+];

            fn of(options: &FieldOptions) -> Given {
                Given { $($field: options.value($name, $parse),)+ }
            }
        }
    };
}

pub(crate) use flags;

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
