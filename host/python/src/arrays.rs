//! Arrays in and out.

use crate::error::Failure;
use numpy::ndarray::{Array, Dimension, IntoDimension};
use numpy::{Element, IntoPyArray, PyArray, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::borrow::Cow;
use viewfuse::core::camera::Pinhole;

/// A vector as an array of this shape, which takes its memory.
pub(crate) fn array<T: Element, D: IntoDimension>(
    py: Python<'_>,
    shape: D,
    values: Vec<T>,
) -> PyResult<Py<PyArray<T, D::Dim>>>
where
    D::Dim: Dimension,
{
    let array = Array::from_shape_vec(shape.into_dimension(), values);
    Ok(array.map_err(|error| Failure::Other(error.to_string()))?.into_pyarray(py).unbind())
}

/// The values of a picture, `uint8` `[height][width][3]`: borrowed, or copied where they are not contiguous.
pub(crate) struct Picture<'py>(PyReadonlyArray3<'py, u8>);

impl<'py> Picture<'py> {
    /// # Errors
    /// `TypeError` for anything but such an array.
    pub(crate) fn of(object: &Bound<'py, PyAny>) -> PyResult<Picture<'py>> {
        if let Ok(array) = object.extract::<PyReadonlyArray3<'py, u8>>()
            && array.shape()[2] == 3
        {
            return Ok(Picture(array));
        }
        let given = match object.cast::<PyUntypedArray>() {
            Ok(array) => format!("an array of {} of shape {:?}", array.dtype(), array.shape()),
            Err(_) => object.get_type().to_string(),
        };
        Err(PyTypeError::new_err(format!("a picture is an array of uint8, height x width x 3, not {given}")))
    }

    /// Width and height.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.0.shape()[1], self.0.shape()[0]]
    }

    /// Row-major.
    pub(crate) fn values(&self) -> Cow<'_, [u8]> {
        // Not numpy's own slice: of an array whose columns come first that has another order.
        let array = self.0.as_array();
        match array.to_slice() {
            Some(values) => Cow::Borrowed(values),
            None => Cow::Owned(array.iter().copied().collect()),
        }
    }
}

/// The matrix of a pinhole camera, in pixels; the origin is the outer corner of the top left pixel.
pub(crate) fn intrinsic_matrix(pinhole: &Pinhole) -> [[f64; 3]; 3] {
    let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
    [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
}
