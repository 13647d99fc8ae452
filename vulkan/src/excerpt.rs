//! The part of a module that one kernel needs.
//!
//! A driver works through all of a module for each pipeline that it creates: given the module of all kernels, a
//! software driver takes 14 s of processor time for each of them. An excerpt has one entry point, the functions that it
//! calls and the variables that these use: some drivers count the workgroup memory of all that are declared. Types and
//! constants are those of the whole module.

use std::collections::{HashMap, HashSet};

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

/// The instructions of a module, each with its number.
fn instructions(module: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    let mut rest = module.get(HEADER..).unwrap_or_default();
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let (instruction, next) = rest.split_at_checked((first >> 16).max(1) as usize)?;
        rest = next;
        Some((first & 0xffff, instruction))
    })
}

/// The module of one entry point; without one of this name it has none.
pub(crate) fn excerpt(module: &[u32], entry_point: &str) -> Vec<u32> {
    let is_named = |words: &[u32]| {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        bytes.strip_prefix(entry_point.as_bytes()).is_some_and(|rest| rest.first() == Some(&0))
    };
    let (mut entry, mut interface) = (None, &[][..]);
    let (mut function, mut types) = (None, HashSet::new());
    // Called functions, and the function that a value is computed in.
    let (mut calls, mut place) = (HashMap::<u32, Vec<u32>>::new(), HashMap::new());
    // Variables of the module, and those that a function may use: those whose numbers are among its words.
    let (mut variables, mut uses) = (HashSet::new(), HashMap::<u32, HashSet<u32>>::new());
    for (code, words) in instructions(module) {
        match (code, words) {
            (ENTRY_POINT, [_, _, id, name @ ..]) if is_named(name) => (entry, interface) = (Some(*id), name),
            (VARIABLE, [_, _, id, ..]) if function.is_none() => drop(variables.insert(*id)),
            (FIRST_TYPE..=LAST_TYPE | MATRIX_TYPE, [_, id, ..]) => drop(types.insert(*id)),
            (FUNCTION, [_, _, id, ..]) => function = Some(*id),
            _ => {}
        }
        if let (Some(function), [_, kind, id, rest @ ..]) = (function, words)
            && types.contains(kind)
        {
            // Only what has a type has a value.
            place.insert(*id, function);
            if let (FUNCTION_CALL, [called, ..]) = (code, rest) {
                calls.entry(function).or_default().push(*called);
            }
        }
        if let Some(function) = function {
            uses.entry(function).or_default().extend(words.iter().filter(|word| variables.contains(word)));
        }
        if code == FUNCTION_END {
            function = None;
        }
    }
    let (mut needed, mut open) = (HashSet::new(), Vec::from_iter(entry));
    while let Some(id) = open.pop() {
        if needed.insert(id) {
            open.extend(calls.get(&id).into_iter().flatten());
        }
    }
    let used = needed.iter().filter_map(|function| uses.get(function)).flatten();
    let used: HashSet<u32> = used.chain(interface).copied().collect();
    let is_unused = |id: &u32| variables.contains(id) && !used.contains(id);
    let mut excerpt = module.get(..HEADER).unwrap_or_default().to_vec();
    let mut is_needed = true;
    for (code, words) in instructions(module) {
        if let (FUNCTION, [_, _, id, ..]) = (code, words) {
            is_needed = needed.contains(id);
        }
        let is_kept = match (code, words) {
            (NAME | MEMBER_NAME, _) => false,
            (ENTRY_POINT, [_, _, id, ..]) | (EXECUTION_MODE, [_, id, ..]) => entry == Some(*id),
            (DECORATE | MEMBER_DECORATE, [_, id, ..]) => {
                !is_unused(id) && place.get(id).is_none_or(|place| needed.contains(place))
            }
            (VARIABLE, [_, _, id, ..]) => is_needed && !is_unused(id),
            _ => is_needed,
        };
        if is_kept {
            excerpt.extend(words);
        }
        is_needed |= code == FUNCTION_END;
    }
    excerpt
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
        let (kernels, subgroups, matrices) = (words(MODULE), words(SUBGROUPS), words(MATRICES));
        let mut seen = 0;
        for kernel in Kernel::ALL {
            for form in kernel.forms().iter().chain(kernel.rounded_forms()).copied() {
                let (module, known) = match form {
                    _ if form.needs_matrices() => (&matrices, &OF_MATRICES[..]),
                    Form::Subgroup => (&subgroups, &OF_SUBGROUPS[..]),
                    _ => (&kernels, &[][..]),
                };
                let module = excerpt(module, kernel.entry_point(form));
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

    #[test]
    fn an_excerpt_declares_the_workgroup_memory_of_its_kernel() {
        let module = words(MODULE);
        for kernel in Kernel::ALL {
            for form in kernel.forms().iter().filter(|form| !form.needs_subgroups()) {
                let part = excerpt(&module, kernel.entry_point(*form));
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
        let module = words(MODULE);
        let count = |module: &[u32], wanted| instructions(module).filter(|(code, _)| *code == wanted).count();
        for kernel in Kernel::ALL {
            let part = excerpt(&module, kernel.entry_point(Form::Single));
            assert_eq!((count(&part, ENTRY_POINT), count(&part, EXECUTION_MODE)), (1, 1), "{}", kernel.name());
            assert!(count(&part, FUNCTION) >= 1 && part.len() < module.len() / 4, "{}", kernel.name());
        }
        assert_eq!(count(&excerpt(&module, "fuse"), ENTRY_POINT), 0, "only whole names");
    }
}
