//! Forms of tiled kernels: which come into question for a product, and which was the fastest.
//!
//! A form is measured at the first use of a kernel for products of a class, sizes to within a factor of two. All forms give the
//! same bits, which is compared then, so a choice changes nothing but the time.

use crate::kernel::{Form, Kernel, TILE, WORKGROUP};
use std::collections::BTreeMap;
use viewfuse_kernels::network::tile::Shape;

/// Dispatches of a measurement, after one that makes what is made at the first use.
pub(crate) const ROUNDS: u32 = 3;
/// Multiply-adds of a product that is worth a measurement.
const MIN_WORK: u64 = 1 << 22;
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

/// The kernel's name and the logarithms of rows, inner indices and columns.
type Key = (String, [u32; 3]);

impl Class {
    pub(crate) fn new(kernel: Kernel, shape: Shape) -> Class {
        let logarithm = |count: u32| u32::BITS - count.saturating_sub(1).leading_zeros();
        let Shape { row_count, inner_count, column_count } = shape;
        let sizes = [logarithm(row_count).min(MAX_ROWS), logarithm(inner_count), logarithm(column_count)];
        Class { shape, key: (kernel.name().to_owned(), sizes) }
    }

    /// The forms that come into question, [`Form::Single`] first: none that would leave half of its tiles empty, none that
    /// the device cannot run, and none that does not pay on a device of its kind.
    pub(crate) fn candidates(&self, is_software: bool, has_subgroups: bool) -> Vec<Form> {
        let Shape { row_count, inner_count, column_count } = self.shape;
        let work = u64::from(row_count) * u64::from(inner_count) * u64::from(column_count);
        if work < MIN_WORK {
            return vec![Form::Single];
        }
        let comes_into_question = |form: &Form| {
            let [rows, columns] = form.tiles();
            let is_filled = (rows == 1 || row_count > TILE) && (columns == 1 || column_count > TILE);
            let is_able = match form {
                Form::Subgroup => has_subgroups,
                // A processor has nothing to do while it waits for a fetch: a second buffer is only work.
                Form::Buffered => !is_software,
                // Compiling it costs a software driver seconds, and it gains a tenth on the forms that remain.
                Form::Quadruple => !(is_software && has_subgroups),
                Form::Single | Form::Double => true,
            };
            is_filled && is_able
        };
        Form::ALL.into_iter().filter(comes_into_question).collect()
    }

    /// Elements of a measurement: the first rows, whole groups of tiles of every form.
    pub(crate) fn measured_elements(&self, form: Form, is_software: bool) -> u32 {
        let tiles = if is_software { MEASURED_TILES_OF_SOFTWARE } else { MEASURED_TILES };
        let bands = tiles.div_ceil(2 * self.shape.column_count.div_ceil(TILE)).max(1);
        form.elements(self.shape.row_count.min(2 * TILE * bands), self.shape.column_count)
    }
}

const _: () = assert!(WORKGROUP == TILE);

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
        self.forms.insert(class.key.clone(), form);
        self.has_new = true;
    }

    /// Whether one was measured since they were read.
    pub(crate) fn has_new(&self) -> bool {
        self.has_new
    }

    /// A line a class: kernel, logarithms of the sizes, form.
    pub(crate) fn text(&self) -> String {
        let line = |((kernel, [rows, inner, columns]), form): (&Key, &Form)| {
            format!("{kernel} {rows} {inner} {columns} {}\n", form.name())
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
    let &[kernel, rows, inner, columns, form] = &words[..] else { return None };
    let kernel = Kernel::ALL.into_iter().find(|known| known.is_tiled() && known.name() == kernel)?;
    let form = Form::ALL.into_iter().find(|known| known.name() == form)?;
    let sizes = [rows.parse().ok()?, inner.parse().ok()?, columns.parse().ok()?];
    Some(((kernel.name().to_owned(), sizes), form))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::bytes_of;
    use viewfuse_kernels::network::linear::LinearBlock;

    fn class(row_count: u32, inner_count: u32, column_count: u32) -> Class {
        Class::new(Kernel::Linear, Shape { row_count, inner_count, column_count })
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
    fn empty_tiles_and_little_work_are_no_candidates() {
        let candidates = |rows, inner, columns| class(rows, inner, columns).candidates(false, true);
        assert_eq!(candidates(4096, 512, 512), Form::ALL);
        assert_eq!(candidates(4096, 512, 64), [Form::Single, Form::Subgroup]);
        assert_eq!(candidates(64, 4096, 512), [Form::Single, Form::Double, Form::Buffered, Form::Subgroup]);
        assert_eq!(candidates(128, 128, 128), [Form::Single]);
    }

    #[test]
    fn candidates_depend_on_the_device() {
        let all = Form::ALL.map(|form| form.name());
        let names = |is_software, has_subgroups| -> Vec<&str> {
            let candidates = class(4096, 512, 512).candidates(is_software, has_subgroups);
            candidates.into_iter().map(Form::name).collect()
        };
        assert_eq!(names(false, true), all);
        assert_eq!(names(false, false), ["single", "double", "quadruple", "buffered"]);
        assert_eq!(names(true, true), ["single", "double", "subgroup"]);
        assert_eq!(names(true, false), ["single", "double", "quadruple"]);
    }

    #[test]
    fn a_measurement_has_the_same_outputs_in_every_form() {
        // Five tiles of columns: four bands of two tiles of rows.
        let class = class(10_000, 64, 300);
        let groups = Form::ALL.map(|form| class.measured_elements(form, true) / WORKGROUP);
        assert_eq!(groups, [4 * 5, 4 * 3, 2 * 3, 4 * 3, 4 * 5]);
        let whole = class.measured_elements(Form::Single, false);
        assert_eq!(whole, Form::Single.elements(10_000, 300));
    }

    #[test]
    fn choices_are_kept_by_class() {
        let mut choices = Choices::default();
        choices.set(&class(1000, 64, 128), Form::Double);
        choices.set(&class(1000, 512, 512), Form::Quadruple);
        assert_eq!(choices.get(&class(600, 60, 100)), Some(Form::Double));
        assert_eq!(choices.get(&class(600, 512, 512)), Some(Form::Quadruple));
        assert_eq!(choices.get(&class(2000, 64, 128)), None);
        let parsed = Choices::parse(&choices.text()).expect("choices");
        assert_eq!((parsed.get(&class(600, 60, 100)), parsed.has_new()), (Some(Form::Double), false));
        for broken in ["linear 1 2 3", "lines 1 2 3 double", "linear 1 2 3 triple", "linear 1 b 3 double", "\n"] {
            assert_eq!(Choices::parse(broken), None, "{broken}");
        }
    }
}
