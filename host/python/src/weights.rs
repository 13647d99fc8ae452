//! Weights of the sources for targets.

use crate::arrays::array;
use crate::error::Failure;
use crate::interrupt::interruptible;
use crate::request::Request;
use numpy::{PyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use viewfuse::output::weights::{TableError, WeightTable};
use viewfuse::scene::Scene;
use viewfuse::weighting::{Weighting, WeightingSpec, scheme_names};

/// Weights of the sources for targets under schemes.
#[pyclass(name = "Weights", module = "viewfuse", frozen, get_all)]
pub(crate) struct PyWeights {
    /// The text forms of the schemes.
    schemes: Vec<String>,
    /// Names of the targets.
    targets: Vec<String>,
    /// Names of the sources.
    sources: Vec<String>,
    /// float32 [scheme][target][source]; those of a scheme for a target sum to 1.
    values: Py<PyArray3<f32>>,
    /// Camera-to-world matrices of the targets, float64 [target][4][4], as those of the scene.
    poses: Py<PyArray3<f64>>,
}

#[pymethods]
impl PyWeights {
    fn __repr__(&self, py: Python<'_>) -> String {
        let dimensions: Vec<usize> = self.values.bind(py).shape().to_vec();
        format!("<viewfuse.Weights of {} schemes, {} targets, {} sources>", dimensions[0], dimensions[1], dimensions[2])
    }

    /// The values: numpy.asarray(weights).
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let values = self.values.bind(py).as_any();
        match (dtype, copy) {
            (Some(dtype), Some(false)) => {
                let wanted = values.py().import("numpy")?.call_method1("dtype", (dtype,))?;
                match wanted.eq(values.getattr("dtype")?)? {
                    true => Ok(values.clone()),
                    false => Err(PyValueError::new_err(format!("the weights are float32, not {wanted}: copy=False"))),
                }
            }
            (Some(dtype), _) => values.call_method1("astype", (dtype,)),
            (None, Some(true)) => values.call_method0("copy"),
            (None, _) => Ok(values.clone()),
        }
    }
}

/// Which schemes: one text, several, or every one that needs no file.
#[derive(FromPyObject)]
pub(crate) enum Schemes {
    One(String),
    Several(Vec<String>),
}

/// Weighs the sources of a request.
///
/// # Errors
/// `ValueError` for an unknown scheme or view, or too many sources.
pub(crate) fn weigh(py: Python<'_>, scene: &Scene, schemes: Option<Schemes>, request: &Request) -> PyResult<PyWeights> {
    let schemes = match schemes {
        None => scheme_names().into_iter().map(str::to_owned).collect(),
        Some(Schemes::One(scheme)) => vec![scheme],
        Some(Schemes::Several(schemes)) => schemes,
    };
    let table = interruptible(py, |progress| {
        let open = |text: &String| Ok::<Weighting, Failure>(text.parse::<WeightingSpec>()?.open()?);
        let weightings = schemes.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        let job = request.resolve(scene, 1)?;
        WeightTable::of(scene, &job, &weightings, progress).map_err(|error| match error {
            TableError::Interrupted(interrupted) => interrupted.into(),
            TableError::Sources(error) => Failure::Input(error.to_string()),
        })
    })?;
    let [scheme_count, target_count, source_count] = table.shape();
    let mut values = Vec::with_capacity(scheme_count * target_count * source_count);
    for scheme in 0..scheme_count {
        for target in 0..target_count {
            values.extend_from_slice(table.weights(scheme, target));
        }
    }
    let poses: Vec<f64> = table.poses.iter().flatten().flatten().copied().collect();
    Ok(PyWeights {
        values: array(py, [scheme_count, target_count, source_count], values)?,
        poses: array(py, [target_count, 4, 4], poses)?,
        schemes: table.schemes,
        targets: table.targets,
        sources: table.sources,
    })
}
