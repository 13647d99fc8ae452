//! A variant of a field: a value of its own options, with what is typical of it.
//!
//! Everything that renders a scene in more than one way is a list of such values: the efforts that a bound chooses
//! from, the candidates that are tried on held-out sources, the pictures that are mixed, previews, and what `pareto`
//! draws. A field makes the lists of its options' own type; outside of it [`AnyOptions`] stands for them.

use serde::{Serialize, Serializer};
use std::any::Any;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// A value of a field's options.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant<O> {
    /// What it omits, or what it keeps, in a few words.
    pub label: String,
    /// The value.
    pub options: O,
    /// The root mean square difference of its pictures from the exact ones that is typical of it, colours from 0 to 1:
    /// where a search begins. 0 for the exact one.
    pub typical_error: f32,
    /// Its share of the exact one's time, likewise.
    pub typical_share: f32,
    /// Whether it omits nothing, and rounds about as much as `f32` does in another order of its sums: the exact
    /// pictures of two devices differ as much.
    pub rounds_as_f32: bool,
    /// Whether nothing is omitted, so that what omissions cost in a scene says nothing of its error.
    pub omits_nothing: bool,
}

/// Label of the variant that omits nothing.
pub const EXACT: &str = "exact";

impl<O> Variant<O> {
    /// One that omits something.
    pub fn new(label: impl Into<String>, options: O, typical_error: f32, typical_share: f32) -> Variant<O> {
        Variant {
            label: label.into(),
            options,
            typical_error,
            typical_share,
            rounds_as_f32: false,
            omits_nothing: false,
        }
    }

    /// The one that omits nothing.
    pub fn exact(options: O) -> Variant<O> {
        Variant { rounds_as_f32: true, omits_nothing: true, ..Variant::new(EXACT, options, 0.0, 1.0) }
    }

    /// One whose error and time are to be measured.
    pub fn to_measure(label: impl Into<String>, options: O) -> Variant<O> {
        Variant::new(label, options, f32::NAN, f32::NAN)
    }

    /// With other options.
    pub fn map<P>(self, to: impl FnOnce(O) -> P) -> Variant<P> {
        let Variant { label, options, typical_error, typical_share, rounds_as_f32, omits_nothing } = self;
        Variant { label, options: to(options), typical_error, typical_share, rounds_as_f32, omits_nothing }
    }
}

/// Options of a field: a plain value.
pub trait Options: Clone + PartialEq + fmt::Debug + Send + Sync + 'static {
    /// Whether views that were encoded under these options serve pictures under others.
    fn encodes_alike(&self, other: &Self) -> bool;

    /// The scalars that are not at their defaults, for a record.
    fn settings(&self) -> Vec<Setting> {
        Vec::new()
    }

    /// The folder in which what is found of a scene is kept between runs, if there is one.
    fn folder(&self) -> Option<&Path> {
        None
    }
}

/// A field without options.
impl Options for () {
    fn encodes_alike(&self, (): &()) -> bool {
        true
    }
}

/// A scalar of a field's options, in a record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f32,
}

/// Options of any field. Copies share them. In a record they are their settings.
#[derive(Clone, Debug)]
pub struct AnyOptions {
    value: Arc<dyn Erased>,
    settings: Vec<Setting>,
}

/// [`Options`] without their type; others of another type are never the same.
trait Erased: Any + fmt::Debug + Send + Sync {
    fn is(&self, other: &dyn Any) -> bool;

    fn encodes_alike(&self, other: &dyn Any) -> bool;

    fn folder(&self) -> Option<&Path>;
}

impl<O: Options> Erased for O {
    fn is(&self, other: &dyn Any) -> bool {
        other.downcast_ref::<O>().is_some_and(|other| self == other)
    }

    fn encodes_alike(&self, other: &dyn Any) -> bool {
        other.downcast_ref::<O>().is_some_and(|other| Options::encodes_alike(self, other))
    }

    fn folder(&self) -> Option<&Path> {
        Options::folder(self)
    }
}

impl AnyOptions {
    /// The options with their type erased.
    pub fn new(options: impl Options) -> AnyOptions {
        let settings = options.settings();
        AnyOptions::stated(options, settings)
    }

    /// The same with what a record says of them.
    pub(crate) fn stated(options: impl Options, settings: Vec<Setting>) -> AnyOptions {
        AnyOptions { value: Arc::new(options), settings }
    }

    /// All of the value, whatever a record says of it.
    pub(crate) fn in_full(&self) -> String {
        format!("{:?}", self.value)
    }

    /// The same with another line in a record.
    pub(crate) fn also_stating(&self, setting: Setting) -> AnyOptions {
        let settings = self.settings.iter().copied().chain([setting]).collect();
        AnyOptions { value: Arc::clone(&self.value), settings }
    }

    /// The options, if they are of this type.
    pub fn of<O: Options>(&self) -> Option<&O> {
        let options: &dyn Any = self.value.as_ref();
        options.downcast_ref()
    }

    /// Whether views that were encoded under these options serve pictures under others.
    pub fn encodes_alike(&self, other: &AnyOptions) -> bool {
        self.value.encodes_alike(other.value.as_ref())
    }

    /// The folder in which what is found of a scene is kept between runs, if there is one.
    pub fn folder(&self) -> Option<&Path> {
        self.value.folder()
    }

    /// The scalars that a record says of them: those that are not at their defaults.
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }
}

impl Serialize for AnyOptions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.settings.serialize(serializer)
    }
}

impl PartialEq for AnyOptions {
    fn eq(&self, other: &AnyOptions) -> bool {
        self.value.is(other.value.as_ref())
    }
}

/// A field's list with the type of its options erased.
pub(crate) fn erased<O: Options>(list: impl IntoIterator<Item = Variant<O>>) -> Vec<Variant<AnyOptions>> {
    list.into_iter().map(|variant| variant.map(AnyOptions::new)).collect()
}
