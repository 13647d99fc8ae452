//! What was found out about forms of [`Form::ROUNDED`] and [`Form::FUSED`]: a text, for later processes.

use crate::kernel::{Form, Kernel};
use std::collections::BTreeMap;

/// Whether forms of rounded factors are used, as far as they were tried by this process or by earlier ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Verdicts {
    forms: BTreeMap<(Kernel, Form), bool>,
    has_new: bool,
}

impl Verdicts {
    pub(crate) fn get(&self, kernel: Kernel, form: Form) -> Option<bool> {
        self.forms.get(&(kernel, form)).copied()
    }

    pub(crate) fn set(&mut self, kernel: Kernel, form: Form, is_trusted: bool) {
        self.has_new |= self.forms.insert((kernel, form), is_trusted) != Some(is_trusted);
    }

    /// Without those of [`Form::FUSED`], which most devices have no use for, and without what only measures.
    pub(crate) fn distrusted(&self) -> Vec<(Kernel, Form)> {
        let is_used = |(kernel, form): &(Kernel, Form)| !form.may_fuse() && *kernel != Kernel::RepeatProduct;
        let distrusted = self.forms.iter().filter(|(form, is_trusted)| is_used(form) && !**is_trusted);
        distrusted.map(|(form, _)| *form).collect()
    }

    /// Adds another process's verdicts on forms without one.
    pub(crate) fn merge(&mut self, others: Verdicts) {
        for (form, is_trusted) in others.forms {
            self.forms.entry(form).or_insert(is_trusted);
        }
    }

    /// Whether one was found since they were read.
    pub(crate) fn has_new(&self) -> bool {
        self.has_new
    }

    /// A line a form: kernel, form, whether it is used.
    pub(crate) fn text(&self) -> String {
        let line = |((kernel, form), is_trusted): (&(Kernel, Form), &bool)| {
            format!("{} {} {is_trusted}\n", kernel.name(), form.name())
        };
        self.forms.iter().map(line).collect()
    }

    /// Verdicts from their text; `None` if it is not one.
    pub(crate) fn parse(text: &str) -> Option<Verdicts> {
        let parse_line = |line: &str| {
            let words: Vec<&str> = line.split(' ').collect();
            let &[kernel, form, is_trusted] = &words[..] else { return None };
            let kernel = Kernel::ALL.into_iter().find(|known| known.name() == kernel)?;
            let form = Form::ROUNDED.into_iter().chain(Form::FUSED).find(|known| known.name() == form)?;
            Some(((kernel, form), is_trusted.parse().ok()?))
        };
        Some(Verdicts { forms: text.lines().map(parse_line).collect::<Option<_>>()?, has_new: false })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_are_kept() {
        let mut verdicts = Verdicts::default();
        verdicts.set(Kernel::Linear, Form::Half, true);
        verdicts.set(Kernel::Convolve, Form::TwoHalves, false);
        verdicts.set(Kernel::Linear, Form::FusedTiny, false);
        let parsed = Verdicts::parse(&verdicts.text()).expect("verdicts");
        assert_eq!((&parsed.forms, parsed.has_new(), verdicts.has_new()), (&verdicts.forms, false, true));
        assert_eq!(parsed.distrusted(), [(Kernel::Convolve, Form::TwoHalves)]);
        let mut merged = Verdicts::parse("linear half false\n").expect("a verdict");
        merged.merge(parsed);
        assert_eq!(merged.get(Kernel::Linear, Form::Half), Some(false), "what was tried here");
        assert_eq!(merged.get(Kernel::Convolve, Form::TwoHalves), Some(false), "what was tried elsewhere");
        merged.set(Kernel::Linear, Form::Half, false);
        assert!(!merged.has_new(), "the same again");
        for broken in ["linear half", "lines half true", "linear single true", "linear half yes", "\n"] {
            assert_eq!(Verdicts::parse(broken), None, "{broken}");
        }
    }
}
