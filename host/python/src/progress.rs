//! The course of long work for Python: a bar of tqdm, or a function that is called.

use pyo3::exceptions::{PyImportError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use std::ops::Range;

/// How far the work is. The share never falls.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Course {
    pub(crate) stage: String,
    /// From 0 to 1.
    pub(crate) share: f64,
    place: Range<f64>,
    /// Pieces of the stage that are done, of those that are known.
    pieces: (usize, usize),
}

impl Course {
    /// As of `Progress::stage`.
    pub(crate) fn begin(&mut self, stage: &str, place: Range<usize>, of: usize) {
        let share = |part: usize| if of == 0 { 0.0 } else { (part as f64 / of as f64).min(1.0) };
        stage.clone_into(&mut self.stage);
        (self.place, self.pieces) = (share(place.start)..share(place.end), (0, 0));
        self.rise();
    }

    pub(crate) fn expect(&mut self, pieces: usize) {
        self.pieces.1 += pieces;
    }

    pub(crate) fn step(&mut self) {
        self.pieces.0 += 1;
        self.rise();
    }

    fn rise(&mut self) {
        let (done, of) = self.pieces;
        let within = if of == 0 { 0.0 } else { (done as f64 / of as f64).min(1.0) };
        let Range { start, end } = self.place;
        self.share = self.share.max(start + within * (end - start).max(0.0));
    }
}

/// Where it is shown.
pub(crate) enum Reporter {
    /// A bar of tqdm, in percent.
    Bar(Py<PyAny>),
    /// Called with the share and the stage.
    Function(Py<PyAny>),
}

impl Reporter {
    /// What `progress=` says: a function, or whether there is a bar; without it there is one in a notebook where tqdm
    /// is installed.
    ///
    /// # Errors
    /// `TypeError` for anything else, `ImportError` if a bar was asked for and tqdm is not installed.
    pub(crate) fn of(py: Python<'_>, given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Reporter>> {
        match given {
            None => match is_notebook(py)? {
                true => bar(py).map(Some).or_else(|error| match error.is_instance_of::<PyImportError>(py) {
                    true => Ok(None),
                    false => Err(error),
                }),
                false => Ok(None),
            },
            Some(given) => match given.cast::<PyBool>() {
                Ok(given) if given.is_true() => bar(py).map(Some),
                Ok(_) => Ok(None),
                Err(_) if given.is_callable() => Ok(Some(Reporter::Function(given.clone().unbind()))),
                Err(_) => {
                    let kind = given.get_type();
                    let text = format!("progress: True, False, None or a function of a share and a text, not {kind}");
                    Err(PyTypeError::new_err(text))
                }
            },
        }
    }

    /// # Errors
    /// What the function or tqdm raised.
    pub(crate) fn report(&self, py: Python<'_>, course: &Course) -> PyResult<()> {
        match self {
            Reporter::Bar(bar) => {
                bar.setattr(py, "n", (100.0 * course.share).floor())?;
                bar.call_method1(py, "set_description_str", (course.stage.as_str(),))?;
            }
            Reporter::Function(function) => {
                function.call1(py, (course.share, course.stage.as_str()))?;
            }
        }
        Ok(())
    }

    /// The bar stays as it is.
    pub(crate) fn end(&self, py: Python<'_>) -> PyResult<()> {
        if let Reporter::Bar(bar) = self {
            bar.call_method0(py, "close")?;
        }
        Ok(())
    }
}

/// Whether this Python is the kernel of a notebook.
fn is_notebook(py: Python<'_>) -> PyResult<bool> {
    py.import("sys")?.getattr("modules")?.contains("ipykernel")
}

/// A bar as tqdm shows it here: in a notebook its own, elsewhere on standard error.
fn bar(py: Python<'_>) -> PyResult<Reporter> {
    let options = PyDict::new(py);
    options.set_item("total", 100)?;
    options.set_item("bar_format", "{desc} {percentage:3.0f} %|{bar}| {elapsed}")?;
    let bar = py.import("tqdm.auto")?.getattr("tqdm")?.call((), Some(&options))?;
    Ok(Reporter::Bar(bar.unbind()))
}
