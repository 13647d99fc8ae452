//! `--weights`: its values and help.

use std::str::FromStr;
use viewfuse_weighting::attention::AttentionError;
use viewfuse_weighting::{Weighting, WeightingError, WeightingSpec, choice_grammar, grammar, scheme_names};

/// Help of an option that takes one scheme, or none to choose the best.
pub(crate) fn choice_help() -> String {
    let network = Weighting::default_scheme();
    format!("Weighting scheme: {} [default: auto; {network} with --model]", choice_grammar())
}

/// Help of an option that takes one scheme.
pub(crate) fn scheme_help() -> String {
    format!("Weighting scheme: {}", grammar())
}

/// Help of an option that can be given several times.
pub(crate) fn many_help() -> String {
    let grammar = grammar();
    format!("A weighting scheme; may be given several times: {grammar} [default: every scheme that needs no file]")
}

/// Help of an option that can be given several times, with the automatic choice.
pub(crate) fn many_choices_help() -> String {
    let grammar = choice_grammar();
    format!("A weighting scheme; may be given several times: {grammar} [default: every scheme that needs no file]")
}

/// The given schemes, or every scheme that needs no file.
pub(crate) fn or_every_scheme<T: Clone + FromStr<Err = WeightingError>>(given: &[T]) -> Result<Vec<T>, WeightingError> {
    if given.is_empty() { scheme_names().into_iter().map(str::parse).collect() } else { Ok(given.to_vec()) }
}

/// Opens all of them; reads the files of learned attention.
pub(crate) fn open_all(specs: &[WeightingSpec]) -> Result<Vec<Weighting>, AttentionError> {
    specs.iter().map(WeightingSpec::open).collect()
}
