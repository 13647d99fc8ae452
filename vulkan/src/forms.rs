//! Forms of tiled kernels: which come into question for a product, and which was the fastest.
//!
//! A form is measured at the first use of a kernel for products of a class, sizes to within a factor of two. All forms
//! give the same bits, which is compared then, so a choice changes nothing but the time.

use crate::kernel::{Form, Kernel, TILE};
use std::collections::BTreeMap;
use viewfuse_kernels::network::tile::Shape;

/// Dispatches of a measurement, after one that makes what is made at the first use.
pub(crate) const ROUNDS: u32 = 3;
/// Multiply-adds of a product that is worth a measurement.
const MIN_WORK: u64 = 1 << 22;
/// Tiles that keep a large GPU busy, about two for each unit: with fewer, smaller tiles are faster.
pub(crate) const ENOUGH_TILES: u32 = 256;
/// Tiles that are measured: as many as keep a GPU busy, and few where a processor does their work.
const MEASURED_TILES: u32 = 4096;
const MEASURED_TILES_OF_SOFTWARE: u32 = 16;
/// Logarithm of the rows from which on all products are of one class.
const MAX_ROWS: u32 = 14;

/// Products of one kernel that have about the same sizes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Class {
    shape: Shape,
    key: Key,
}

/// What a class of products whose arrays lie in fours has behind its kernel's name.
const IN_FOURS: &str = "::in_fours";

/// The kernel, whether its arrays lie in fours, and the logarithms of rows, inner indices and columns.
type Key = (Kernel, bool, [u32; 3]);

impl Class {
    /// Whether the arrays lie in fours belongs to it.
    pub(crate) fn new(kernel: Kernel, shape: Shape, is_in_fours: bool) -> Class {
        let logarithm = |count: u32| u32::BITS - count.saturating_sub(1).leading_zeros();
        let Shape { row_count, inner_count, column_count } = shape;
        let sizes = [logarithm(row_count).min(MAX_ROWS), logarithm(inner_count), logarithm(column_count)];
        Class { shape, key: (kernel, is_in_fours, sizes) }
    }

    /// Whether its arrays lie in fours.
    pub(crate) fn is_in_fours(&self) -> bool {
        self.key.1
    }

    /// The forms that come into question, [`Form::Single`] first: one for little work. Sizes of tiles are a matter of
    /// how many units a GPU has; a processor takes as long for each of them.
    pub(crate) fn candidates(&self, is_software: bool) -> impl Iterator<Item = Form> {
        let Shape { row_count, inner_count, column_count } = self.shape;
        let work = u64::from(row_count) * u64::from(inner_count) * u64::from(column_count);
        let tiles = move |form: Form| form.tiles(row_count, column_count);
        // Of those in fours one: measured in a process that has just compiled them, GPUs are not what they are later.
        let in_fours = Form::IN_FOURS.into_iter().find(|form| tiles(*form) >= ENOUGH_TILES).unwrap_or(Form::Least);
        let has_fours = self.is_in_fours() && !is_software;
        let fits = move |form: &Form| match form {
            Form::Single => true,
            Form::Subgroup => !has_fours,
            form => has_fours && *form == in_fours,
        };
        Form::ALL.into_iter().filter(fits).take(if work >= MIN_WORK { Form::ALL.len() } else { 1 })
    }

    /// Elements of a measurement in a form: the first rows, the same for each form.
    pub(crate) fn measured_elements(&self, form: Form, is_software: bool) -> u32 {
        let Shape { row_count, column_count, .. } = self.shape;
        let tiles = if is_software { MEASURED_TILES_OF_SOFTWARE } else { MEASURED_TILES };
        let rows = TILE * tiles.div_ceil(column_count.div_ceil(TILE)).max(1);
        form.elements(row_count.min(rows.next_multiple_of(Form::Large.rows())), column_count)
    }
}

/// The fastest form of each class so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Choices {
    forms: BTreeMap<Key, Form>,
    has_new: bool,
}

impl Choices {
    pub(crate) fn get(&self, class: &Class) -> Option<Form> {
        self.forms.get(&class.key).copied()
    }

    pub(crate) fn set(&mut self, class: &Class, form: Form) {
        self.forms.insert(class.key, form);
        self.has_new = true;
    }

    /// The forms that were chosen for any class of a kernel.
    pub(crate) fn forms_of(&self, kernel: Kernel) -> Vec<Form> {
        let of_kernel = |((of, ..), form): (&Key, &Form)| (*of == kernel).then_some(*form);
        Form::ALL.into_iter().filter(|form| self.forms.iter().filter_map(of_kernel).any(|of| of == *form)).collect()
    }

    /// Adds another process's choices for classes without one.
    pub(crate) fn merge(&mut self, others: Choices) {
        for (key, form) in others.forms {
            self.forms.entry(key).or_insert(form);
        }
    }

    /// Whether one was measured since they were read.
    pub(crate) fn has_new(&self) -> bool {
        self.has_new
    }

    /// A line a class: kernel, logarithms of the sizes, form.
    pub(crate) fn text(&self) -> String {
        let line = |((kernel, is_in_fours, [rows, inner, columns]), form): (&Key, &Form)| {
            let fours = if *is_in_fours { IN_FOURS } else { "" };
            format!("{}{fours} {rows} {inner} {columns} {}\n", kernel.name(), form.name())
        };
        self.forms.iter().map(line).collect()
    }

    /// Choices from their text; `None` if it is not one.
    pub(crate) fn parse(text: &str) -> Option<Choices> {
        let forms = text.lines().map(parse_line).collect::<Option<_>>()?;
        Some(Choices { forms, has_new: false })
    }
}

fn parse_line(line: &str) -> Option<(Key, Form)> {
    let words: Vec<&str> = line.split(' ').collect();
    let &[name, rows, inner, columns, form] = &words[..] else { return None };
    let plain = name.strip_suffix(IN_FOURS).unwrap_or(name);
    let kernel = Kernel::ALL.into_iter().find(|known| known.is_tiled() && known.name() == plain)?;
    let form = Form::ALL.into_iter().find(|known| known.name() == form)?;
    let sizes = [rows.parse().ok()?, inner.parse().ok()?, columns.parse().ok()?];
    Some(((kernel, name.ends_with(IN_FOURS), sizes), form))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::bytes_of;
    use viewfuse_kernels::network::linear::LinearBlock;

    fn class(row_count: u32, inner_count: u32, column_count: u32) -> Class {
        Class::new(Kernel::Linear, Shape { row_count, inner_count, column_count }, true)
    }

    #[test]
    fn shapes_are_read_from_parameters() {
        let block = LinearBlock { row_count: 5, inner_count: 6, column_count: 7, ..LinearBlock::default() };
        let found = Kernel::Linear.shape(bytes_of(&block));
        assert_eq!(found, Some(Shape { row_count: 5, inner_count: 6, column_count: 7 }));
        assert_eq!(Kernel::Linear.shape(&[0; 3]), None);
        for kernel in Kernel::ALL {
            let parameters = vec![0; kernel.parameter_bytes()];
            assert_eq!(kernel.shape(&parameters).is_some(), kernel.is_tiled(), "{}", kernel.name());
        }
    }

    #[test]
    fn candidates_are_a_matter_of_the_work_the_outputs_and_the_kind_of_device() {
        use Form::{Large, Least, Single, Small, Subgroup, Tiny};
        let candidates = |class: Class, is_software| class.candidates(is_software).collect::<Vec<_>>();
        for is_software in [true, false] {
            assert_eq!(candidates(class(128, 128, 128), is_software), [Single], "little work");
        }
        assert_eq!(candidates(class(4096, 512, 512), true), [Single, Subgroup]);
        assert_eq!(candidates(class(32_768, 512, 512), false), [Single, Large]);
        assert_eq!(candidates(class(2046, 512, 512), false), [Single, Small]);
        // Convolutions of 32x32 pixels with 256 channels, and of 16x16 with 512.
        assert_eq!(candidates(class(1024, 2304, 256), false), [Single, Tiny]);
        assert_eq!(candidates(class(256, 4608, 512), false), [Single, Least]);
        let shape = Shape { row_count: 32_768, inner_count: 510, column_count: 512 };
        assert_eq!(candidates(Class::new(Kernel::Linear, shape, false), false), [Single, Subgroup]);
    }

    #[test]
    fn a_measurement_is_of_the_first_rows() {
        // Five tiles of columns: four bands of tiles, two of large ones, eight of tiny ones.
        let class = class(10_000, 64, 300);
        let tiles = |form: Form| class.measured_elements(form, true) / form.invocations();
        assert_eq!([Form::Single, Form::Large, Form::Tiny].map(tiles), [4 * 5, 2 * 5, 8 * 10]);
        assert_eq!(class.measured_elements(Form::Single, false), Form::Single.elements(10_000, 300));
    }

    #[test]
    fn choices_are_kept_by_class() {
        let mut choices = Choices::default();
        choices.set(&class(1000, 64, 128), Form::Subgroup);
        choices.set(&class(1000, 512, 512), Form::Single);
        assert_eq!(choices.get(&class(600, 60, 100)), Some(Form::Subgroup));
        assert_eq!(choices.get(&class(600, 512, 512)), Some(Form::Single));
        assert_eq!(choices.get(&class(2000, 64, 128)), None);
        let parsed = Choices::parse(&choices.text()).expect("choices");
        assert_eq!((parsed.get(&class(600, 60, 100)), parsed.has_new()), (Some(Form::Subgroup), false));
        let mut merged = Choices::parse("linear::in_fours 10 6 7 single\nlinear 2 3 4 subgroup\n").expect("choices");
        merged.merge(parsed);
        assert_eq!(merged.get(&class(600, 60, 100)), Some(Form::Single), "what was measured here");
        assert_eq!(merged.get(&class(600, 512, 512)), Some(Form::Single), "what was measured elsewhere");
        for broken in ["linear 1 2 3", "lines 1 2 3 single", "linear 1 2 3 triple", "linear 1 b 3 single", "\n"] {
            assert_eq!(Choices::parse(broken), None, "{broken}");
        }
    }
}
