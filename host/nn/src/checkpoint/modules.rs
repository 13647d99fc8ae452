//! Networks that a pickle holds as objects: the tensors that their `state_dict` would have.
//!
//! An object of any class of PyTorch's modules has among its attributes the tables `_parameters`, `_buffers` and
//! `_modules`; the names in a `state_dict` are the paths through these. The attributes are the object's state, or, for
//! classes with their source text (`torch_utils.persistence` of NVIDIA's projects), the `state` of the
//! description from which the object would be created. The source text is not read.
//!
//! Modules can contain themselves and each other many times: the length of names and the work are limited.

use super::error::shortened;
use super::pickle::{Id, Object, Pickle, Value};
use std::collections::HashSet;

/// The most bytes of a tensor's name.
const LONGEST_NAME: usize = 256;

/// The most entries of tables that are read again, beside one for each value of the pickle.
const FEW_ENTRIES: usize = 1000;

/// The attributes of a module that are read.
#[derive(Default)]
struct Module<'a> {
    parameters: &'a [(Id, Id)],
    buffers: &'a [(Id, Id)],
    modules: &'a [(Id, Id)],
    /// Names of buffers that a `state_dict` leaves out.
    temporary: &'a [Id],
}

/// Whether a value is a module.
pub(super) fn is_module(pickle: &Pickle, id: Id) -> bool {
    Walk::new(pickle).module(id).is_ok_and(|module| module.is_some())
}

/// Calls `take` with the name and the value of each parameter and each buffer of a module and of all modules in it.
///
/// # Errors
/// A problem with the modules, or the error of `take`.
pub(super) fn each_tensor(
    pickle: &Pickle,
    id: Id,
    take: &mut dyn FnMut(&str, Id) -> Result<(), String>,
) -> Result<(), String> {
    Walk::new(pickle).enter(id, "", take)
}

/// A walk through modules.
struct Walk<'a> {
    pickle: &'a Pickle,
    /// Tables that were read.
    seen: HashSet<Id>,
    /// Entries of these that may be read again.
    left: usize,
}

impl<'a> Walk<'a> {
    /// Modules that a few others share are visited a few times, but not once a path: the work stays proportional to the
    /// pickle's size.
    fn new(pickle: &'a Pickle) -> Walk<'a> {
        Walk { pickle, seen: HashSet::new(), left: pickle.values().len() + FEW_ENTRIES }
    }

    fn enter(
        &mut self,
        id: Id,
        prefix: &str,
        take: &mut dyn FnMut(&str, Id) -> Result<(), String>,
    ) -> Result<(), String> {
        let pickle = self.pickle;
        let Some(module) = self.module(id)? else {
            let class = pickle.object(id).map_or("no object".to_owned(), |object| class_of(pickle, object));
            let name = shortened(prefix.trim_end_matches('.'));
            return Err(format!("module '{name}' ({class}) has no tables of parameters, buffers and modules"));
        };
        let temporary: HashSet<&str> = module.temporary.iter().filter_map(|&name| pickle.text(name)).collect();
        for &(key, value) in module.parameters {
            if self.is_there(value) {
                take(&self.name(prefix, key)?, value)?;
            }
        }
        for &(key, value) in module.buffers {
            if self.is_there(value) && !pickle.text(key).is_some_and(|key| temporary.contains(key)) {
                take(&self.name(prefix, key)?, value)?;
            }
        }
        for &(key, value) in module.modules {
            if self.is_there(value) {
                let prefix = format!("{}.", self.name(prefix, key)?);
                self.enter(value, &prefix, take)?;
            }
        }
        Ok(())
    }

    /// A place in a table can be kept free with `None`.
    fn is_there(&self, id: Id) -> bool {
        !matches!(self.pickle.value(id), Value::None)
    }

    fn name(&self, prefix: &str, key: Id) -> Result<String, String> {
        let key = self.pickle.text(key).ok_or_else(|| {
            format!("module '{}' has a part whose name is no text", shortened(prefix.trim_end_matches('.')))
        })?;
        if prefix.len() + key.len() > LONGEST_NAME {
            let name = shortened(&format!("{prefix}{key}"));
            return Err(format!(
                "a name is longer than {LONGEST_NAME} bytes, as if a module contained itself: '{name}'; the file is \
                 damaged or malicious"
            ));
        }
        Ok(format!("{prefix}{key}"))
    }

    /// The parts of a module, if it is one.
    fn module(&mut self, id: Id) -> Result<Option<Module<'a>>, String> {
        let Some(attributes) = self.attributes(id)? else { return Ok(None) };
        let (mut module, mut tables) = (Module::default(), 0);
        for &(key, value) in attributes {
            let part = match self.pickle.text(key) {
                Some("_parameters") => &mut module.parameters,
                Some("_buffers") => &mut module.buffers,
                Some("_modules") => &mut module.modules,
                Some("_non_persistent_buffers_set") => {
                    module.temporary = self.set(value)?;
                    continue;
                }
                _ => continue,
            };
            if let Some(table) = self.table(value)? {
                (*part, tables) = (table, tables + 1);
            }
        }
        Ok((tables >= 3).then_some(module))
    }

    /// The attributes that an object would have.
    fn attributes(&mut self, id: Id) -> Result<Option<&'a [(Id, Id)]>, String> {
        let Some(object) = self.pickle.object(id) else { return Ok(None) };
        if let Some(state) = object.state {
            // Of a class with slots, their values stand behind the other attributes.
            let state = self.pickle.sequence(state).and_then(|parts| parts.first()).copied().unwrap_or(state);
            return self.table(state);
        }
        let description = self.pickle.sequence(object.arguments).and_then(|arguments| arguments.first());
        let Some(description) = description.map_or(Ok(None), |&description| self.table(description))? else {
            return Ok(None);
        };
        match description.iter().find(|&&(key, _)| self.pickle.text(key) == Some("state")) {
            Some(&(_, state)) => self.table(state),
            None => Ok(None),
        }
    }

    /// The entries of a `dict`, or of an object with items.
    fn table(&mut self, id: Id) -> Result<Option<&'a [(Id, Id)]>, String> {
        let pairs = match self.pickle.value(id) {
            Value::Dict(pairs) => pairs,
            Value::Object(object) => &object.items,
            _ => return Ok(None),
        };
        self.spend(id, pairs.len())?;
        Ok(Some(pairs))
    }

    /// The elements of a `set`, which older protocols make of a list.
    fn set(&mut self, id: Id) -> Result<&'a [Id], String> {
        let of_list = |id: Id| {
            let arguments = self.pickle.sequence(self.pickle.object(id)?.arguments)?;
            self.pickle.sequence(*arguments.first()?)
        };
        let elements = match self.pickle.value(id) {
            Value::Set(elements) => elements,
            _ => of_list(id).unwrap_or_default(),
        };
        self.spend(id, elements.len())?;
        Ok(elements)
    }

    /// The first read of a table is free: all tables together are no larger than the pickle.
    fn spend(&mut self, id: Id, count: usize) -> Result<(), String> {
        if !self.seen.insert(id) {
            let left = self.left.checked_sub(count + 1);
            self.left =
                left.ok_or("holds the same modules in one another too often; the file is damaged or malicious")?;
        }
        Ok(())
    }
}

/// The class of an object, for messages.
pub(super) fn class_of(pickle: &Pickle, object: &Object) -> String {
    // Classes of somebody's own are made through helpers whose first argument is the class.
    let first = pickle.sequence(object.arguments).and_then(|arguments| arguments.first());
    let helper = pickle.global(object.callable);
    let class = first.and_then(|&first| pickle.global(first)).filter(|_| helper.is_some()).or(helper);
    class.map_or("object".to_owned(), |(module, name)| format!("{}.{}", shortened(module), shortened(name)))
}
