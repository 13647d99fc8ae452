//! The part of a module that one kernel needs.
//!
//! A driver works through all of a module for each pipeline that it creates: given the module of all kernels, a
//! software driver takes 14 s of processor time for each of them. An excerpt has one entry point, the functions that it
//! calls and the variables that these use: some drivers count the workgroup memory of all that are declared. Types and
//! constants are those of the whole module.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// Words before the first instruction.
const HEADER: usize = 5;

// Instructions, by their numbers in the specification of SPIR-V.
const NAME: u32 = 5;
const MEMBER_NAME: u32 = 6;
const ENTRY_POINT: u32 = 15;
const EXECUTION_MODE: u32 = 16;
const FIRST_TYPE: u32 = 19;
const LAST_TYPE: u32 = 39;
const MATRIX_TYPE: u32 = 4456;
const FUNCTION: u32 = 54;
const FUNCTION_END: u32 = 56;
const FUNCTION_CALL: u32 = 57;
const VARIABLE: u32 = 59;
const DECORATE: u32 = 71;
const MEMBER_DECORATE: u32 = 72;

/// A decoration: a device must not fuse the operation with another.
const NO_CONTRACTION: u32 = 42;

/// The instructions of a module, each with its number.
fn instructions(module: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    instructions_of(module.get(HEADER..).unwrap_or_default())
}

/// Those of a part of a module.
fn instructions_of(mut rest: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let (instruction, next) = rest.split_at_checked((first >> 16).max(1) as usize)?;
        rest = next;
        Some((first & 0xffff, instruction))
    })
}

/// A module whose instructions were looked at once, for the excerpts of all its kernels.
pub(crate) struct Index {
    words: Vec<u32>,
    /// Words before the first function, and of all functions, each with its number.
    head: Range<usize>,
    functions: HashMap<u32, Function>,
    /// The functions' numbers in the module's order.
    order: Vec<u32>,
    /// `[number]`: the function that a value is computed in, 0 for none.
    places: Vec<u32>,
    /// `[number]`: whether it is a variable of the module.
    variables: Vec<bool>,
}

/// A function of a module.
#[derive(Default)]
struct Function {
    words: Range<usize>,
    /// The functions that it calls.
    calls: Vec<u32>,
    /// The variables of the module that it may use: those whose numbers are among its words.
    variables: Vec<u32>,
}

impl Index {
    /// Looks at a module, given as bytes.
    pub(crate) fn new(module: &[u8]) -> Index {
        let words: Vec<u32> = module.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        let count = words.get(3).map_or(0, |bound| *bound as usize);
        let (mut places, mut variables, mut types) = (vec![0; count], vec![false; count], vec![false; count]);
        let (mut functions, mut order) = (HashMap::new(), Vec::new());
        let (mut function, mut current, mut head) = (None, Function::default(), words.len());
        let mut at = HEADER;
        for (code, words) in instructions(&words) {
            let is = |marks: &[bool], id: &u32| marks.get(*id as usize).copied().unwrap_or(false);
            match (code, words) {
                (VARIABLE, [_, _, id, ..]) if function.is_none() => mark(&mut variables, *id, true),
                (FIRST_TYPE..=LAST_TYPE | MATRIX_TYPE, [_, id, ..]) => mark(&mut types, *id, true),
                (FUNCTION, [_, _, id, ..]) => {
                    (function, current.words.start) = (Some(*id), at);
                    head = head.min(at);
                }
                _ => {}
            }
            at += words.len();
            let Some(id) = function else { continue };
            if let [_, kind, value, rest @ ..] = words
                && is(&types, kind)
            {
                // Only what has a type has a value.
                mark(&mut places, *value, id);
                if let (FUNCTION_CALL, [called, ..]) = (code, rest) {
                    current.calls.push(*called);
                }
            }
            current.variables.extend(words.iter().filter(|word| is(&variables, word)));
            if code == FUNCTION_END {
                current.words.end = at;
                functions.insert(id, std::mem::take(&mut current));
                order.push(id);
                function = None;
            }
        }
        Index { head: HEADER.min(head)..head, words, functions, order, places, variables }
    }

    /// The module of one entry point; without one of this name it has none. If it `may_fuse`, a device may fuse its
    /// operations.
    pub(crate) fn excerpt(&self, entry_point: &str, may_fuse: bool) -> Vec<u32> {
        let is_named = |words: &[u32]| {
            let bytes: &[u8] = bytemuck::cast_slice(words);
            bytes.strip_prefix(entry_point.as_bytes()).is_some_and(|rest| rest.first() == Some(&0))
        };
        let head = || instructions_of(&self.words[self.head.clone()]);
        let found = head().find_map(|instruction| match instruction {
            (ENTRY_POINT, [_, _, id, name @ ..]) if is_named(name) => Some((*id, name)),
            _ => None,
        });
        let (entry, interface) = found.map_or((None, &[][..]), |(id, interface)| (Some(id), interface));
        let (mut needed, mut open) = (HashSet::new(), Vec::from_iter(entry));
        while let Some(id) = open.pop() {
            if needed.insert(id) {
                open.extend(self.functions.get(&id).into_iter().flat_map(|function| &function.calls));
            }
        }
        let used = needed.iter().filter_map(|id| self.functions.get(id)).flat_map(|function| &function.variables);
        let used: HashSet<u32> = used.chain(interface).copied().collect();
        let is_unused = |id: &u32| self.variables.get(*id as usize) == Some(&true) && !used.contains(id);
        let is_placed = |id: &u32| match self.places.get(*id as usize) {
            None | Some(0) => true,
            Some(place) => needed.contains(place),
        };
        let mut excerpt = self.words.get(..HEADER).unwrap_or_default().to_vec();
        for (code, words) in head() {
            let is_kept = match (code, words) {
                (NAME | MEMBER_NAME, _) => false,
                (ENTRY_POINT, [_, _, id, ..]) | (EXECUTION_MODE, [_, id, ..]) => entry == Some(*id),
                (DECORATE, [_, _, NO_CONTRACTION]) if may_fuse => false,
                (DECORATE | MEMBER_DECORATE, [_, id, ..]) => !is_unused(id) && is_placed(id),
                (VARIABLE, [_, _, id, ..]) => !is_unused(id),
                _ => true,
            };
            if is_kept {
                excerpt.extend(words);
            }
        }
        let functions = self.order.iter().filter(|id| needed.contains(id)).filter_map(|id| self.functions.get(id));
        functions.for_each(|function| excerpt.extend(&self.words[function.words.clone()]));
        excerpt
    }
}

/// Sets what is known of a number; numbers beyond the module's bound have nothing.
fn mark<T>(marks: &mut [T], id: u32, value: T) {
    if let Some(mark) = marks.get_mut(id as usize) {
        *mark = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Form, Kernel};
    use crate::pipelines::{MATRICES, MODULE, SUBGROUPS};

    const CAPABILITY: u32 = 17;
    /// A storage class.
    const WORKGROUP: u32 = 4;
    /// `Shader` and `VulkanMemoryModel`: Vulkan has the one, a device without the other is refused.
    const OF_ALL: [u32; 2] = [1, 5345];
    /// `GroupNonUniform`, `GroupNonUniformBallot`, `GroupNonUniformShuffle`: asked for in `subgroups::fitting_size`.
    const OF_SUBGROUPS: [u32; 3] = [61, 64, 65];
    /// `Float16`, `GroupNonUniform`, `CooperativeMatrixKHR`: asked for in `matrices::fit`.
    const OF_MATRICES: [u32; 3] = [9, 61, 6022];

    fn words(module: &[u8]) -> Vec<u32> {
        module.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect()
    }

    #[test]
    fn an_excerpt_relies_on_nothing_that_was_not_asked_for() {
        let [kernels, subgroups, matrices] = [MODULE, SUBGROUPS, MATRICES].map(Index::new);
        let mut seen = 0;
        for kernel in Kernel::ALL {
            for form in kernel.forms().iter().chain(kernel.rounded_forms()).copied() {
                let (module, known) = match form {
                    _ if form.needs_matrices() => (&matrices, &OF_MATRICES[..]),
                    Form::Subgroup => (&subgroups, &OF_SUBGROUPS[..]),
                    _ => (&kernels, &[][..]),
                };
                let module = module.excerpt(kernel.entry_point(form), false);
                let coded = |wanted| instructions(&module).filter(move |(code, _)| *code == wanted);
                assert_eq!(coded(ENTRY_POINT).count(), 1, "{} {}", kernel.name(), form.name());
                for (_, capability) in coded(CAPABILITY) {
                    let is_asked_for = OF_ALL.contains(&capability[1]) || known.contains(&capability[1]);
                    assert!(is_asked_for, "{} {}: capability {}", kernel.name(), form.name(), capability[1]);
                    seen += 1;
                }
            }
        }
        assert!(seen >= 2 * Kernel::ALL.len());
    }

    /// What may be fused differs in nothing else, and nothing that may not be is fused.
    #[test]
    fn an_excerpt_may_allow_to_fuse() {
        let index = Index::new(MODULE);
        for form in Form::FUSED {
            let name = Kernel::Linear.entry_point(form);
            let (strict, free) = (index.excerpt(name, false), index.excerpt(name, true));
            let is_mark = |(code, words): &(u32, &[u32])| *code == DECORATE && words[2..] == [NO_CONTRACTION];
            let marks = |module: &[u32]| instructions(module).filter(is_mark).count();
            assert!(marks(&strict) > 0 && marks(&free) == 0, "{name}");
            let others = instructions(&strict).filter(|instruction| !is_mark(instruction));
            assert!(others.eq(instructions(&free)) && strict[..HEADER] == free[..HEADER], "{name}");
        }
    }

    #[test]
    fn an_excerpt_declares_the_workgroup_memory_of_its_kernel() {
        let (index, module) = (Index::new(MODULE), words(MODULE));
        for kernel in Kernel::ALL {
            for form in kernel.forms().iter().filter(|form| !form.needs_subgroups()) {
                let part = index.excerpt(kernel.entry_point(*form), false);
                let declared =
                    |module| instructions(module).filter(|(code, words)| *code == VARIABLE && words[3] == WORKGROUP);
                let shared = declared(&part).count();
                assert_eq!(shared > 0, kernel.has_barriers(*form), "{} {}: {shared}", kernel.name(), form.name());
                assert!(shared < declared(&module).count(), "{} {}", kernel.name(), form.name());
            }
        }
    }

    #[test]
    fn an_excerpt_has_one_entry_point_and_little_else() {
        let (index, module) = (Index::new(MODULE), words(MODULE));
        let count = |module: &[u32], wanted| instructions(module).filter(|(code, _)| *code == wanted).count();
        for kernel in Kernel::ALL {
            let part = index.excerpt(kernel.entry_point(Form::Single), false);
            assert_eq!((count(&part, ENTRY_POINT), count(&part, EXECUTION_MODE)), (1, 1), "{}", kernel.name());
            assert!(count(&part, FUNCTION) >= 1 && part.len() < module.len() / 4, "{}", kernel.name());
        }
        assert_eq!(count(&index.excerpt("fuse", false), ENTRY_POINT), 0, "only whole names");
    }
}
